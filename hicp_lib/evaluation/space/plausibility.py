"""Anatomically implausible detections: hips in the abdomen, broken fingers, tilted shoulders.

Keypoints are compared with anatomy, so recordings without ground truth can be evaluated, too; with ground
truth, the same measure on it gives the rate of false alarms.

- A hip is *in the abdomen* when it lies more than 5 cm nearer to the shoulder of its side than the shortest
  adults' trunk is long: .288 of the stature (Winter 2009) of a woman of 1.52 m, the 5th percentile.
- A finger is *broken* when its middle and its end joint bend to opposite sides, each by more than 20 degrees
  as the image shows it. Fingers bend in one plane and to one side only (Chen Chen et al. 2013), so in any
  view a finger bends in the same direction at all joints, and the image alone is sufficient. Angles in space
  would not work: with noise in depth, even true pixels give broken fingers.
- The *shoulder line* of a person who sits upright is horizontal: its angle to the horizontal is its tilt.
"""

from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd

from hicp_lib.evaluation.space.sightings import ROW
from hicp_lib.evaluation.space.stability import PARTS, PIXEL, POSITION, LiftedViews, Parts
from hicp_lib.evaluation.statistics.proportions import mean_with_interval
from hicp_lib.evaluation.statistics.resampling import Draws

SHORTEST_TRUNK_M = 0.288 * 1.52
IN_ABDOMEN_M = SHORTEST_TRUNK_M - 0.05
BACKWARDS_RAD = float(np.radians(20))
# Of a hand's keypoints, from knuckle to tip; the thumb bends differently.
_FINGERS = np.arange(5, 21).reshape(4, 4)


def implausible(lifted: LiftedViews, draws: Draws = Draws()) -> pd.DataFrame:
    """The measures of this module for every detector in every view.

    Parameters
    ----------
    lifted : LiftedViews
        With pixels.
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        Columns `view, detector, method, part, measure`; `value` with `low, high` (95 %), as a share of the
        `n_images` of `n_people` in which the part is found, or for the shoulder line the mean angle in
        radians; `of_truth`, the same for the true keypoints (NaN if unknown).
    """
    rows = []
    for measure, (values_of, kind, parts, columns) in _MEASURES.items():
        for case, part, subjects, found, true in lifted.cases(parts, columns):
            values = values_of(found)
            seen = np.flatnonzero(np.isfinite(values))
            whose = subjects[seen]
            interval = mean_with_interval(values[seen].astype(kind), seen, draws, whose)
            of_truth = np.nan if true is None else np.nanmean(values_of(true))
            rows.append((*case, part, measure, *interval, len(seen), len(set(whose)), of_truth))
    return pd.DataFrame(rows, columns=[*ROW, "value", "low", "high", "n_images", "n_people", "of_truth"])


def backwards(hands_px: np.ndarray) -> np.ndarray:
    """Which hands have a broken finger.

    Parameters
    ----------
    hands_px : array, shape (n, 21, 2)
        In the order of `hicp_lib.core.keypoints.HAND_NAMES`; NaN where not found.

    Returns
    -------
    array, shape (n,)
        1 or 0; NaN if no finger is found completely.
    """
    fingers = hands_px[:, _FINGERS] @ [1, 1j]  # (n, finger, 4), as complex numbers
    bones = np.diff(fingers, axis=2)
    bends_rad = np.angle(bones[:, :, 1:] * bones[:, :, :-1].conj())
    broken = (bends_rad.min(axis=2) < -BACKWARDS_RAD) & (bends_rad.max(axis=2) > BACKWARDS_RAD)
    whole = np.isfinite(bends_rad).all(axis=2).any(axis=1)
    return np.where(whole, broken.any(axis=1), np.nan)


def _short(trunk_m: np.ndarray) -> np.ndarray:
    """Whether a shoulder and its hip, (n, 2, 3), are closer than in the shortest adult."""
    length_m = np.linalg.norm(np.diff(trunk_m, axis=1)[:, 0], axis=1)
    return np.where(np.isfinite(length_m), length_m < IN_ABDOMEN_M, np.nan)


def _tilt_rad(shoulders_m: np.ndarray) -> np.ndarray:
    """Angle of the line between two points, (n, 2, 3), to the horizontal; the base frame's z is up."""
    line_m = np.diff(shoulders_m, axis=1)[:, 0]
    return np.arctan2(np.abs(line_m[:, 2]), np.linalg.norm(line_m[:, :2], axis=1))


_TRUNKS = {f"{side} hip": (f"{side}_shoulder", f"{side}_hip") for side in ("left", "right")}
_HANDS = {part: PARTS[part] for part in ("left hand", "right hand")}
_SHOULDERS = {"shoulders": ("left_shoulder", "right_shoulder")}
_MEASURES: dict[str, tuple[Callable[[np.ndarray], np.ndarray], type, Parts, Sequence[str]]] = {
    "hips in the abdomen": (_short, bool, _TRUNKS, POSITION),
    "broken fingers": (backwards, bool, _HANDS, PIXEL),
    "shoulder line tilt [rad]": (_tilt_rad, float, _SHOULDERS, POSITION),
}
