"""Draw the pictures of the page on the network for close range.

    python tools/closerange/draw_pictures.py FOLDER PEOPLE.onnx HANDS.onnx --out TABLES

FOLDER is one of `make_samples.py`. Writes into TABLES pictures.csv, and as JPEG: some squares of each view
that it names, visible keypoints in green and hidden ones in orange; held-out people of whom the network is
surest where it is wrong, and those that it overlooks; and a photograph as it and MoveNet Lightning see it.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).parents[1]))

from closerange.detector import CloseRange  # noqa: E402
from closerange.evaluate import OURS, detect, held_out  # noqa: E402
from hicp_lib.core.datafiles import DATA_DIR  # noqa: E402
from hicp_lib.core.images import read_image  # noqa: E402
from hicp_lib.detectors.registry import make_detector  # noqa: E402
from hicp_lib.evaluation.failures.error_kinds import all_errors  # noqa: E402
from hicp_lib.evaluation.failures.worst_cases import worst_cases  # noqa: E402
from hicp_lib.formats.annotations import read_annotations  # noqa: E402
from hicp_lib.recordings.writer import write_rgb  # noqa: E402
from hicp_lib.study.plots.people import draw_detections, draw_truth  # noqa: E402

VIEWS, PER_VIEW, GAP_PX, N_WORST, MAX_PX = ("whole", "headless", "part", "hand"), 5, 4, 3, 420
COLOURS = {1: (255, 150, 0), 2: (80, 255, 80)}
TRUE_COLOUR = "#39D353"
LIGHTNING, MIN_SCORE = "movenet-lightning", 0.3


def drawn(square: np.ndarray, points: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """A square with its keypoints as dots."""
    square = square.copy()
    for (x, y), state in zip(points[seen > 0], seen[seen > 0], strict=True):
        cv2.circle(square, (round(float(x)), round(float(y))), 1, COLOURS[int(state)], -1, cv2.LINE_AA)
    return square


def squares(folder: Path) -> np.ndarray:
    """A grid of squares, a row per view."""
    wanted: dict[str, list] = {view: [] for view in VIEWS}
    for path in [path for of in ("people", "hands") for path in sorted((folder / of).glob("*_0.npz"))[::7]]:
        part = np.load(path)
        for k, view in enumerate(part["view"][:1]):
            if len(wanted[view]) < PER_VIEW:
                wanted[view].append(drawn(part["squares"][k], part["keypoints_px"][k], part["seen"][k]))
    gap = ((0, GAP_PX), (0, GAP_PX), (0, 0))
    rows = [[np.pad(square, gap, constant_values=255) for square in of] for of in wanted.values()]
    return np.concatenate([np.concatenate(row, axis=1) for row in rows])[:-GAP_PX, :-GAP_PX]


def failures(network: CloseRange) -> list[tuple]:
    """Rows of the table, with pictures: a row of pictures per kind of case."""
    folders = {subset: of for subset, of in held_out()[0].items() if subset != "near"}
    truth = {subset: read_annotations(folder / "annotations.json") for subset, folder in folders.items()}
    found = {(subset, OURS): detect(network, folder) for subset, folder in folders.items()}
    cases = worst_cases(all_errors(truth, found), N_WORST)
    kinds, rows = list(cases["case"].unique()), []
    for case in cases.to_dict("records"):
        subset, image_id, people = case["subset"], case["image_id"], truth[case["subset"]]
        of_image = (people.image_ids == image_id) & ~people.is_crowd
        images_dir = folders[subset] / "images"
        image = draw_truth(people, images_dir, image_id, of_image, TRUE_COLOUR, n_keypoints=26)
        image = draw_detections(image, found[subset, OURS][image_id], OURS, MIN_SCORE)
        title = f"{case['case']}\n{case['mistakes']}"
        rows.append(("failures", kinds.index(case["case"]), title, image))
    return rows


def photograph(network: CloseRange) -> list[tuple]:
    """As `failures`: the study's photograph, by the network and by Lightning."""
    image = read_image(DATA_DIR / "photograph.jpg")
    detectors = {OURS: network, LIGHTNING: make_detector(LIGHTNING)}
    return [
        ("photograph", 0, name, draw_detections(image, its.detect(image), name, MIN_SCORE))
        for name, its in detectors.items()
    ]


def smaller(image: np.ndarray) -> np.ndarray:
    """At most `MAX_PX` wide and high."""
    scale = min(1.0, MAX_PX / max(image.shape[:2]))
    return cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("hand_model", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    network, out = CloseRange(arguments.model, arguments.hand_model), arguments.out
    out.mkdir(parents=True, exist_ok=True)
    write_rgb(out / "squares.jpg", squares(arguments.folder))
    table = [("squares", 0, "", "squares.jpg")]
    for k, (figure, row, title, image) in enumerate([*failures(network), *photograph(network)]):
        write_rgb(out / f"{figure}_{k}.jpg", smaller(image))
        table.append((figure, row, title, f"{figure}_{k}.jpg"))
    columns = ["figure", "row", "title", "file"]
    pd.DataFrame(table, columns=columns).to_csv(out / "pictures.csv", index=False, lineterminator="\n")


if __name__ == "__main__":
    main()
