"""What a detector does with keypoints that are hidden or outside the picture.

A crop cuts people off, but the image it was cut from knows where the rest of them is. So of a keypoint that
is not in the picture it can be said, too, whether a detector gives it, how surely, where it puts it, and
whether that is right. Bodies only: the 17 keypoints all detectors share.
"""

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import COCO_17, SIGMAS
from hicp_lib.core.oks import oks_terms
from hicp_lib.evaluation.calibration.keypoint_hits import HIT_TERM
from hicp_lib.evaluation.cases import Found, Truth
from hicp_lib.evaluation.matching import matched_people
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


def placed_keypoints(truth: Truth, found: Found, source: Annotations) -> pd.DataFrame:
    """The 17 keypoints of every detection matched to a person who counts (`matching.matched_people`).

    Parameters
    ----------
    truth : Truth
        Of crops, by subset; people name their `source_id` and `crop_px`.
    found : Found
        By image id, of every subset and detector.
    source : Annotations
        What the crops were made from.

    Returns
    -------
    DataFrame
        Columns `subset, detector, image_id, source_image, cut_side` (empty outside Headless), `keypoint,
        state` (one of `STATES`), `given, score` (NaN where not given), `x, y` (where it was put, from 0 at
        the left or top border to 1 at the other), `hit` (OKS term of at least .5; NaN where not given or
        unknown).
    """
    source_row = {int(i): row for row, i in enumerate(source.ids)}
    parts = [pd.DataFrame(columns=list(_DTYPES)).astype(_DTYPES)]
    for (subset, detector), run in found.items():
        people, sources = truth[subset], source_images(truth[subset])
        rows_of = pd.Series(range(len(people))).groupby(people.image_ids).indices
        for image_id, detections in run.items():
            here = people.take(rows_of[image_id])
            for person, row in matched_people(here, detections, COCO_17, _SIGMAS).items():
                if here.is_crowd[person]:
                    continue
                about = here.extras[person]
                part = _row_per_keypoint(
                    here, person, detections, row, source, source_row[about["source_id"]]
                )
                labels = {"subset": subset, "detector": detector, "image_id": image_id}
                labels |= {"source_image": sources[image_id], "cut_side": about.get("cut_side", "")}
                parts.append(part.assign(**labels)[list(_DTYPES)])
    return pd.concat(parts[1:] or parts, ignore_index=True)


def _row_per_keypoint(
    people: Annotations, person: int, found: Detections, row: int, source: Annotations, source_row: int
) -> pd.DataFrame:
    """What detection `row` makes of a person; the truth, also outside the crop, is the source's."""
    image, flags = people.images[int(people.image_ids[person])], people.visibility[person, COCO_17]
    known = source.visibility[source_row, COCO_17] > 0
    state = np.select([flags >= 2, flags > 0, known], STATES[:3], STATES[3])
    corner_px = np.array(people.extras[person]["crop_px"][:2], dtype=float)
    points_px = found.keypoints_px[row, COCO_17]
    given = np.isfinite(points_px).all(axis=-1)
    true_px = source.keypoints_px[source_row, COCO_17] - corner_px
    terms = oks_terms(true_px, points_px, people.areas_px2[person], _SIGMAS)
    x, y = ((points_px + 0.5) / [image.width_px, image.height_px]).T
    score = np.where(given, found.scores[row, COCO_17], np.nan)
    hit = np.where(given & (state != "unknown"), terms >= HIT_TERM, np.nan)
    columns = {
        "keypoint": COCO_17,
        "state": state,
        "given": given,
        "score": score,
        "x": x,
        "y": y,
        "hit": hit,
    }
    return pd.DataFrame(columns)


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
