"""Figure of keypoints that a detector places well on a whole person and loses on the same person close by."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.images import read_image
from hicp_lib.core.keypoints import NAMES
from hicp_lib.evaluation.cases import Found, Truth
from hicp_lib.study.plots.people import draw_detections, draw_rings, picture_grid
from hicp_lib.study.plots.style import Figure, in_words

_VIEWS = {"whole": "basic", "close": "headless"}


def lost_points(
    errors: pd.DataFrame, folders: Mapping[str, Path], truth: Truth, found: Found, note: str
) -> Figure:
    """One person whole and close for each detector, and the point that it loses, as in the paper's Fig. 1.

    Parameters
    ----------
    errors : pd.DataFrame
        As from `hicp_lib.evaluation.failures.error_kinds.all_errors`.
    folders : mapping of str to Path
        Dataset folders by subset.
    truth : mapping of str to Annotations
        By subset.
    found : mapping of (str, str) to mapping of int to Detections
        By subset and detector, then by image id.
    note : str
        What the data are, for the caption.
    """
    body = errors[errors["group"] == "body"]
    whole, close = (body[body["subset"] == subset] for subset in _VIEWS.values())
    both = whole.merge(close, on=["detector", "annotation_id", "keypoint"], suffixes=("_whole", "_close"))
    lost = both[(both["kind_whole"] == "good") & ~both["hit_close"] & (both["kind_close"] != "not found")]
    lost = lost.sort_values("score_whole", ascending=False, kind="stable").drop_duplicates("detector")
    rows: list[list[np.ndarray]] = [[] for _ in _VIEWS]
    for row, (view, subset) in zip(rows, _VIEWS.items(), strict=True):
        people, cases = truth[subset], lost[["detector", f"image_id_{view}", "annotation_id", "keypoint"]]
        for name, image_id, person, keypoint in cases.itertuples(index=False):
            image = read_image(Path(folders[subset]) / "images" / people.images[image_id].file_name)
            drawn = draw_detections(image, found[subset, name][image_id], name)
            row.append(draw_rings(drawn, people.keypoints_px[people.ids == person, keypoint], 20))
    points = [NAMES[keypoint].replace("_", " ") for keypoint in lost["keypoint"]]
    return picture_grid(
        rows,
        row_titles=list(_VIEWS),
        titles=[f"{name}\n{point}" for name, point in zip(lost["detector"], points, strict=True)],
        caption="The same person whole and close, for each detector. Ringed: the true place of the keypoint "
        "that it is surest of among those that it places well in the one picture and not in the other, "
        f"though it finds the person in both. Data: {note}.",
        alt=f"People with and without their heads. Lost close by: {in_words(points)}.",
        cell_in=11 / max(len(lost), 3),
    )
