"""How far networks for close range agree with MoveNet Thunder on photographs, to choose them by.

    python tools/closerange/agreement.py PHOTOGRAPHS NAME=PEOPLE.onnx,HANDS.onnx [...] --out FILE.csv

The study's are the 20 of `examples/media` in github.com/CMU-Perceptual-Computing-Lab/openpose and the 3 of
`examples/demo` in github.com/MVIG-SJTU/AlphaPose. Nobody need have annotated the photographs of the folder,
so that those of `evaluate.py --photographs` are kept for judging. Each large person that Thunder finds
there is cut out, with the head (Basic) and without (Headless); what Thunder is sure of in the first crop
counts as true. Writes the mean OKS of body points, also of MoveNet Lightning, below which no training
should bring a network.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from hicp_lib.core.images import read_image
from hicp_lib.core.keypoints import COCO_17, INDEX, SIGMAS
from hicp_lib.core.oks import oks_terms
from hicp_lib.detectors.registry import make_detector

MIN_PIXELS, SURE, LEAST = 10_000, 0.4, {"basic": 6, "headless": 4}
_MARGIN = 0.15  # of a person's extent, around its points
_FILLED = 0.53  # of a box by a person, as COCO's areas have it on average
_SHOULDERS = [INDEX["left_shoulder"], INDEX["right_shoulder"]]
_N_HEAD = 5  # nose, eyes and ears come first


class Case(NamedTuple):
    """A crop, Thunder's keypoints there, shape (17, 2), and which of them count."""

    subset: str
    crop: np.ndarray
    keypoints_px: np.ndarray
    counts: np.ndarray


def cases(photographs: Path) -> Iterator[Case]:
    """Everybody that Thunder finds in a folder's photographs, with and without the head."""
    finder, thunder = make_detector("movenet-thunder", boxes="detected"), make_detector("movenet-thunder")
    for path in sorted(photographs.glob("*.jpg")):
        image = read_image(path)
        found = finder.detect(image)
        for points, scores in zip(found.keypoints_px[:, COCO_17], found.scores[:, COCO_17], strict=True):
            if (scores >= SURE).sum() < LEAST["basic"]:
                continue
            crop = _cut(image, points[scores >= SURE])
            if crop.shape[0] * crop.shape[1] < MIN_PIXELS:
                continue
            again = thunder.detect(crop)
            sure = again.scores[0, COCO_17] >= SURE
            whole = Case("basic", crop, again.keypoints_px[0, COCO_17], sure)
            yield from (case for case in (whole, _headless(whole)) if case.counts.sum() >= LEAST[case.subset])


def _cut(image: np.ndarray, points_px: np.ndarray) -> np.ndarray:
    low, high = points_px.min(axis=0), points_px.max(axis=0)
    margin = _MARGIN * (high - low).max()
    left, top = np.maximum(low - margin, 0).astype(int)
    right, bottom = (high + margin).astype(int) + 1
    return np.ascontiguousarray(image[top:bottom, left:right])


def _headless(case: Case) -> Case:
    """Cut below what is sure of the head; nothing counts if that is nothing, or shoulders do not count."""
    head = case.counts & (np.arange(len(case.counts)) < _N_HEAD)
    cut = int(case.keypoints_px[head, 1].max()) + 1 if head.any() else 0
    below = case.keypoints_px - [0, cut]
    is_cut = head.any() and case.counts[_SHOULDERS].any()
    counts = case.counts & ~head & (below[:, 1] >= 0) & is_cut
    return Case("headless", np.ascontiguousarray(case.crop[cut:]), below, counts)


def agreement(detector, case: Case) -> float:
    """OKS of a detector's person against Thunder's; 0 if there is nobody."""
    found = detector.detect(case.crop)
    off_px = found.keypoints_px[:1, COCO_17] - case.keypoints_px
    area_px2 = _FILLED * case.crop.shape[0] * case.crop.shape[1]
    terms = oks_terms(off_px, np.full(len(off_px), area_px2), SIGMAS["halpe"][COCO_17])
    return float(terms[:, case.counts].mean()) if len(terms) else 0.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("photographs", type=Path)
    parser.add_argument("models", nargs="*", help="NAME=PEOPLE.onnx,HANDS.onnx")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    detectors = {"movenet-lightning": make_detector("movenet-lightning")}
    for name, files in (text.split("=", 1) for text in arguments.models):
        model, hand_model = files.split(",")
        detectors[name] = make_detector("closerange", model=model, hand_model=hand_model, look_again=False)
    people, rows = list(cases(arguments.photographs)), []
    for subset in LEAST:
        of_subset = [case for case in people if case.subset == subset]
        for name, detector in detectors.items():
            values = [agreement(detector, case) for case in of_subset]
            error = np.std(values, ddof=1) / np.sqrt(len(values))
            rows.append((subset, name, np.mean(values), error, len(values)))
    table = pd.DataFrame(rows, columns=["subset", "network", "value", "standard_error", "n_people"])
    table.to_csv(arguments.out, index=False, float_format="%.4f", lineterminator="\n")
    print(table.to_string())


if __name__ == "__main__":
    main()
