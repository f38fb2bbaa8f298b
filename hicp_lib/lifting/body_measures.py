"""What is known of people before they are seen: how keypoints hang together, how far apart they can be.

Measured on the body model by `tools/measure_body.py`, over people of 18 shapes in many poses. No
recording had a part in it.
"""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import FACE, HAND_LIMBS, INDEX, LEFT_HAND, N_KEYPOINTS, RIGHT_HAND
from hicp_lib.core.memo import memoised

MEASURES_FILE = DATA_DIR / "body_measures.npz"


def _parents() -> np.ndarray:
    parents = np.full(N_KEYPOINTS, -1)
    parents[INDEX["left_shoulder"]] = INDEX["right_shoulder"]
    for side in ("left", "right"):
        chain = [f"{side}_{joint}" for joint in ("shoulder", "hip", "knee", "ankle")]
        chains = [chain, [f"{side}_{joint}" for joint in ("shoulder", "elbow", "wrist", "hand_root")]]
        chains += [[f"{side}_ankle", f"{side}_{end}"] for end in ("big_toe", "small_toe", "heel")]
        chains += [["nose", f"{side}_{end}"] for end in ("eye", "ear")]
        for names in chains:
            for parent, child in zip(names, names[1:], strict=False):
                parents[INDEX[child]] = INDEX[parent]
    for child, parent in (("neck", "right_shoulder"), ("nose", "right_shoulder"), ("head_top", "nose"),
                          ("mid_hip", "left_hip")):  # fmt: skip
        parents[INDEX[child]] = INDEX[parent]
    parents[FACE] = INDEX["nose"]
    for hand in (LEFT_HAND, RIGHT_HAND):
        for parent, child in HAND_LIMBS:
            parents[hand[child]] = hand[parent]
    return parents


PARENTS = _parents()
"""The keypoint each one hangs on, (136,), -1 for the root: a tree from the right shoulder outwards."""


def _levels() -> np.ndarray:
    levels, above = np.zeros(N_KEYPOINTS, int), PARENTS
    while (above >= 0).any():
        levels += above >= 0
        above = np.where(above >= 0, PARENTS[above], -1)
    return levels


LEVELS = _levels()
"""How many keypoints each one is away from the root, (136,)."""


@dataclass(frozen=True)
class BodyMeasures:
    """Measures of people, metres.

    Attributes
    ----------
    below_skin_m : (136,), how deep the keypoint lies below the surface that is seen from the front
    closest_m, farthest_m : (136, 136), least and most distance between two keypoints
    """

    below_skin_m: np.ndarray
    closest_m: np.ndarray
    farthest_m: np.ndarray


@memoised()
def load_measures(path: Path = MEASURES_FILE) -> BodyMeasures:
    """The measures of the project's body model.

    Raises
    ------
    InputError
        If the file is missing or not such a file.
    """
    shapes = {"below_skin_mm": (136,), "closest_mm": (136, 136), "farthest_mm": (136, 136)}
    try:
        with np.load(path, allow_pickle=False) as stored:
            tables = [stored[name].reshape(shape) / 1000 for name, shape in shapes.items()]
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(
            f"{path}: not the measures of the body model ({error}); run tools/measure_body.py"
        ) from None
    return BodyMeasures(*tables)


def hang_together(found: np.ndarray) -> np.ndarray:
    """Which found keypoint each found keypoint hangs on, when those between are not found.

    Parameters
    ----------
    found : (n,) keypoints, increasing

    Returns
    -------
    array, (n,): index into `found`, -1 for those that hang on none
    """
    place = np.full(N_KEYPOINTS + 1, -1)
    place[found] = np.arange(len(found))
    parents = np.append(PARENTS, -1)
    above = parents[found]
    while (lost := (above >= 0) & (place[above] < 0)).any():
        above[lost] = parents[above[lost]]
    return place[above]
