"""How detectors treat keypoints that are occluded or outside the picture.

A crop truncates people, but in the source image the rest of them is labelled. So for a keypoint outside the
crop, too, it is known whether a detector gives it, with which score, where, and whether that is correct.
Bodies only: the 17 keypoints that all detectors share.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import COCO_17, SIGMAS
from hicp_lib.core.oks import oks_terms
from hicp_lib.datasets.crops import image_sizes, with_outside
from hicp_lib.evaluation.calibration.keypoint_hits import HIT_TERM
from hicp_lib.evaluation.cases import Found, Truth
from hicp_lib.evaluation.matching import matched_people
from hicp_lib.formats.annotations import Annotations, rows_by_image, source_images

# True state of a keypoint: visible in the picture, occluded in the picture, outside the picture, or unknown
# (not labelled in the source image).
STATES = ("visible", "hidden", "outside", "unknown")
BORDER = 0.05  # fraction of the picture's side that counts as its border
_SIGMAS = SIGMAS["halpe"][COCO_17]
_DTYPES = {
    "subset": str, "detector": str, "image_id": int, "source_image": int, "keypoint": int,
    "state": str, "given": bool, "score": float, "x": float, "y": float, "hit": float,
}  # fmt: skip


def placed_keypoints(truth: Truth, found: Found, source: Annotations) -> pd.DataFrame:
    """The 17 keypoints of every detection matched to an evaluated person (`matching.matched_people`).

    Parameters
    ----------
    truth : Truth
        Of crops, by subset; people have `source_id` and `crop_px`.
    found : Found
        By image id, of every subset and detector.
    source : Annotations
        What the crops were made from.

    Returns
    -------
    DataFrame
        Columns `subset, detector, image_id, source_image, keypoint, state` (one of `STATES`), `given, score`
        (NaN if not given), `x, y` (its given position, from 0 at the left or top border to 1 at the other),
        `hit` (OKS term of at least .5; NaN if not given or unknown).
    """
    seen = {subset: with_outside(people, source) for subset, people in truth.items()}
    parts = [_of_case(seen[subset], run, subset, detector) for (subset, detector), run in found.items()]
    return pd.concat([part for part in parts if len(part)] or parts, ignore_index=True)


def _of_case(people: Annotations, run: Mapping[int, Detections], subset: str, detector: str) -> pd.DataFrame:
    """The rows of one detector on one subset."""
    rows_of = rows_by_image(people.image_ids)
    pairs = [
        (rows_of[image_id][person], detections, row)
        for image_id, detections in run.items()
        for person, row in matched_people(
            people.take(rows_of[image_id]), detections, COCO_17, _SIGMAS
        ).items()
    ]
    pairs = [pair for pair in pairs if not people.is_crowd[pair[0]]]
    who = np.array([pair[0] for pair in pairs], dtype=int)
    points_px = np.array([found.keypoints_px[row, COCO_17] for _, found, row in pairs]).reshape(-1, 17, 2)
    scores = np.array([found.scores[row, COCO_17] for _, found, row in pairs]).reshape(-1, 17)
    flags, true_px = people.visibility[who][:, COCO_17], people.keypoints_px[who][:, COCO_17]
    state = np.select([flags >= 2, flags > 0, flags < 0], STATES[:3], STATES[3])
    given = np.isfinite(points_px).all(axis=-1)
    terms = oks_terms(points_px - true_px, people.areas_px2[who], _SIGMAS)
    x, y = np.moveaxis((points_px + 0.5) / image_sizes(people)[who][:, None], -1, 0)
    sources, image_ids = source_images(people), people.image_ids[who]
    of_person = {
        "subset": subset, "detector": detector, "image_id": image_ids,
        "source_image": [sources[i] for i in image_ids.tolist()],
    }  # fmt: skip
    of_keypoint = {
        "keypoint": np.broadcast_to(COCO_17, flags.shape), "state": state, "given": given,
        "score": np.where(given, scores, np.nan), "x": x, "y": y,
        "hit": np.where(given & (flags != 0), terms >= HIT_TERM, np.nan),
    }  # fmt: skip
    table = pd.DataFrame(of_person, index=np.arange(len(who))).loc[np.repeat(np.arange(len(who)), 17)]
    table = table.assign(**{name: values.ravel() for name, values in of_keypoint.items()})
    return table.astype(_DTYPES)[list(_DTYPES)]


def landed(placed: pd.DataFrame) -> pd.Series:
    """Where given keypoints are: "outside" the picture, "at the border" or "inside"."""
    x, y = placed["x"], placed["y"]
    depth = np.minimum(np.minimum(x, 1 - x), np.minimum(y, 1 - y))
    place = np.select([depth < 0, depth < BORDER], ["outside", "at the border"], "inside")
    return pd.Series(place, index=placed.index).where(placed["given"])
