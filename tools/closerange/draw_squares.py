"""Draw squares that the network for close range was trained on, with the truth, for its page.

    python tools/closerange/draw_squares.py FOLDER

FOLDER is one of `make_samples.py`. Writes data/reference/closerange/squares.jpg: some squares of each view,
visible keypoints in green, hidden ones in orange.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np

from hicp_lib.recordings.writer import write_rgb
from hicp_lib.study.closerange import FOLDER

VIEWS, PER_VIEW, GAP_PX = ("whole", "headless", "part", "hand"), 5, 4
COLOURS = {1: (255, 150, 0), 2: (80, 255, 80)}


def drawn(square: np.ndarray, points: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """A square with its keypoints as dots."""
    square = square.copy()
    for (x, y), state in zip(points[seen > 0], seen[seen > 0], strict=True):
        cv2.circle(square, (round(float(x)), round(float(y))), 1, COLOURS[int(state)], -1, cv2.LINE_AA)
    return square


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    folder, wanted = parser.parse_args().folder, {view: [] for view in VIEWS}
    for path in [path for of in ("people", "hands") for path in sorted((folder / of).glob("*_0.npz"))[::7]]:
        part = np.load(path)
        for k, view in enumerate(part["view"][:1]):
            if len(wanted[view]) < PER_VIEW:
                wanted[view].append(drawn(part["squares"][k], part["keypoints_px"][k], part["seen"][k]))
    gap = ((0, GAP_PX), (0, GAP_PX), (0, 0))
    rows = [[np.pad(square, gap, constant_values=255) for square in of] for of in wanted.values()]
    picture = np.concatenate([np.concatenate(row, axis=1) for row in rows])[:-GAP_PX, :-GAP_PX]
    FOLDER.mkdir(exist_ok=True)
    write_rgb(FOLDER / "squares.jpg", picture)


if __name__ == "__main__":
    main()
