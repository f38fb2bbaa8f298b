"""Prior knowledge of people: how keypoints are connected, and how far apart they can be.

Measured on the body model by `tools/measure_body.py`, over the development bodies in many poses. No recording
and no held-out identity was used.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hicp_lib.core.datafiles import DATA_DIR, read_arrays
from hicp_lib.core.files import read_json
from hicp_lib.core.keypoints import FACE, HAND_LIMBS, INDEX, LEFT_HAND, N_KEYPOINTS, RIGHT_HAND
from hicp_lib.core.memo import memoised

MEASURES_FILE = DATA_DIR / "body_measures.npz"
_WRISTS = [INDEX["left_wrist"], INDEX["right_wrist"]]
_KNUCKLES = np.concatenate([hand[[5, 9, 13, 17]] for hand in (LEFT_HAND, RIGHT_HAND)])
# Chosen on development identities. The measured body is undressed; and seen from the front, its hanging hands
# show their edges to the camera, other people's hands their backs.
_SLEEVE_M, _BACK_OF_HAND_M = 0.010, 0.011


def _parents() -> np.ndarray:
    parents = np.full(N_KEYPOINTS, -1)
    for chain in read_json(DATA_DIR / "keypoints.json")["chains"]:
        above, *below = (INDEX[name] for name in chain)
        parents[below] = [above, *below[:-1]]
    parents[FACE] = INDEX["nose"]
    begin, end = np.array(HAND_LIMBS).T
    for hand in (LEFT_HAND, RIGHT_HAND):
        parents[hand[end]] = hand[begin]
    return parents


PARENTS = _parents()
"""The parent of each keypoint, shape (136,), -1 for the root: a tree from the right shoulder outwards."""


def _level(keypoint: int) -> int:
    return 0 if PARENTS[keypoint] < 0 else 1 + _level(PARENTS[keypoint])


LEVELS = np.array([*map(_level, range(N_KEYPOINTS))])
"""Depth of each keypoint in the tree, shape (136,)."""


@dataclass(frozen=True)
class BodyMeasures:
    """Measures of people, metres.

    Attributes
    ----------
    below_skin_m : array, shape (136,)
        Depth of the keypoint below the surface seen from the front, including sleeves.
    closest_m, farthest_m : array, shape (136, 136)
        Minimum and maximum distance between two keypoints.
    """

    below_skin_m: np.ndarray
    closest_m: np.ndarray
    farthest_m: np.ndarray


@memoised()
def load_measures(path: Path = MEASURES_FILE) -> BodyMeasures:
    """The measures of the project's body model.

    Parameters
    ----------
    path : Path, optional

    Returns
    -------
    BodyMeasures

    Raises
    ------
    InputError
        If the file is missing or not such a file.

    Examples
    --------
    >>> elbow, wrist = INDEX["left_elbow"], INDEX["left_wrist"]
    >>> measures = load_measures()
    >>> bool(0.15 < measures.closest_m[elbow, wrist] < measures.farthest_m[elbow, wrist] < 0.35)
    True
    """
    shapes = {"below_skin_mm": (136,), "closest_mm": (136, 136), "farthest_mm": (136, 136)}
    tables_mm = read_arrays(path, shapes, "the measures of the body model", "tools/measure_body.py")
    below_m, closest_m, farthest_m = (table_mm / 1000 for table_mm in tables_mm)
    below_m[_WRISTS] += _SLEEVE_M
    below_m[_KNUCKLES] = np.minimum(below_m[_KNUCKLES], _BACK_OF_HAND_M)
    return BodyMeasures(below_m, closest_m, farthest_m)


def found_parents(found: np.ndarray) -> np.ndarray:
    """The nearest detected ancestor of each detected keypoint.

    Parameters
    ----------
    found : array of int, shape (n,)
        Keypoints in the Halpe order, increasing.

    Returns
    -------
    array of int, shape (n,)
        Index into `found`, -1 for those without one.

    Examples
    --------
    >>> found_parents(np.array([INDEX["left_shoulder"], INDEX["left_wrist"]]))
    array([-1,  0])
    """
    place = np.full(N_KEYPOINTS + 1, -1)
    place[found] = np.arange(len(found))
    parents = np.append(PARENTS, -1)
    above = parents[found]
    while (lost := (above >= 0) & (place[above] < 0)).any():
        above[lost] = parents[above[lost]]
    return place[above]
