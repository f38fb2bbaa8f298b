"""What a detector does with keypoints that are hidden or outside the picture.

A crop cuts people off, but the image it was cut from knows where the rest of them is. So of a keypoint that
is not in the picture it can be said, too, whether a detector gives it, how surely, where it puts it, and
whether that is right. Bodies only: the 17 keypoints all detectors share.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import COCO_17, SIGMAS
from hicp_lib.core.oks import oks_terms
from hicp_lib.evaluation.calibration.keypoint_hits import HIT_TERM
from hicp_lib.evaluation.failures.error_kinds import matched_people
from hicp_lib.formats.annotations import Annotations, source_images

# Where a keypoint truly is: in the picture and visible, in the picture but hidden, outside the picture, or
# nowhere known (not labelled in the source image).
STATES = ("visible", "hidden", "outside", "unknown")
BORDER = 0.05  # of the picture's side: what counts as at its border
_SIGMAS = SIGMAS["halpe"][COCO_17]
_DTYPES = {
    "subset": object, "detector": object, "image_id": int, "source_image": object, "cut_side": object,
    "keypoint": int, "state": object, "given": bool, "score": float, "x": float, "y": float, "hit": float,
}  # fmt: skip


def placed_keypoints(
    truth: Mapping[str, Annotations],
    found: Mapping[tuple[str, str], Mapping[int, Detections]],
    source: Annotations,
) -> pd.DataFrame:
    """The 17 keypoints of every detection matched to a person who counts (`error_kinds.matched_people`).

    Parameters
    ----------
    truth : subset -> annotations of crops, whose people name their `source_id` and `crop_px`
    found : (subset, detector) -> detections by image id
    source : the annotations that the crops were made from

    Returns
    -------
    DataFrame, columns `subset, detector, image_id, source_image, cut_side` (empty outside Headless),
    `keypoint, state` (one of `STATES`), `given, score` (NaN where not given), `x, y` (where it was put, from
    0 at the left or top border to 1 at the other), `hit` (OKS term of at least .5; NaN where not given or
    unknown)
    """
    source_row = {int(i): row for row, i in enumerate(source.ids)}
    parts = [pd.DataFrame(columns=_DTYPES).astype(_DTYPES)]
    for (subset, detector), run in found.items():
        people, sources = truth[subset], source_images(truth[subset])
        rows_of = pd.Series(range(len(people))).groupby(people.image_ids).indices
        for image_id, detections in run.items():
            here = people.take(rows_of[image_id])
            for person, row in matched_people(here, detections, COCO_17, _SIGMAS).items():
                if here.is_crowd[person]:
                    continue
                true_px, state = _truth(here, person, source, source_row)
                part = _row_per_keypoint(here, person, detections, row, true_px, state)
                labels = {"subset": subset, "detector": detector, "image_id": image_id}
                cut_side = here.extras[person].get("cut_side", "")
                parts.append(part.assign(**labels, source_image=sources[image_id], cut_side=cut_side))
    return pd.concat([part[list(_DTYPES)] for part in parts if len(part)] or parts, ignore_index=True)


def _truth(
    people: Annotations, person: int, source: Annotations, source_row: Mapping[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """True places (17, 2) in the crop's frame, also outside it, and states (17,)."""
    flags = people.visibility[person, COCO_17]
    about = people.extras[person]
    row = source_row[about["source_id"]]
    labelled = source.visibility[row, COCO_17] > 0
    true_px = source.keypoints_px[row, COCO_17] - np.array(about["crop_px"][:2], dtype=float)
    state = np.select([flags >= 2, flags > 0, labelled], STATES[:3], STATES[3])
    return true_px, state


def _row_per_keypoint(
    people: Annotations, person: int, detections: Detections, row: int, true_px: np.ndarray, state: np.ndarray
) -> pd.DataFrame:
    image = people.images[int(people.image_ids[person])]
    points = detections.keypoints_px[row, COCO_17]
    given = np.isfinite(points).all(axis=-1)
    terms = oks_terms(true_px, points, people.areas_px2[person], _SIGMAS)
    x, y = ((points + 0.5) / [image.width_px, image.height_px]).T
    return pd.DataFrame(
        {
            "keypoint": COCO_17, "state": state, "given": given,
            "score": np.where(given, detections.scores[row, COCO_17], np.nan), "x": x, "y": y,
            "hit": np.where(given & (state != "unknown"), terms >= HIT_TERM, np.nan),
        }
    )  # fmt: skip


def landed(placed: pd.DataFrame) -> pd.Series:
    """Where given keypoints were put: "outside" the picture, "at the border" or "inside"."""
    x, y = placed["x"], placed["y"]
    depth = np.minimum(np.minimum(x, 1 - x), np.minimum(y, 1 - y))
    place = np.select([depth < 0, depth < BORDER], ["outside", "at the border"], "inside")
    return pd.Series(place, index=placed.index).where(placed["given"])


def from_the_cut(placed: pd.DataFrame) -> pd.DataFrame:
    """Places in Headless turned so that the head was cut off above: columns `along`, `below`.

    `along` runs from 0 to 1 along the cut and `below` from 0 at the cut to 1 at the far side; it is negative
    where the picture has been cut away.
    """
    x, y, side = placed["x"], placed["y"], placed["cut_side"]
    along = np.where(side.isin(["top", "bottom"]), x, y)
    below = np.select([side == "top", side == "bottom", side == "left"], [y, 1 - y, x], 1 - x)
    return pd.DataFrame({"along": along, "below": below}, index=placed.index)
