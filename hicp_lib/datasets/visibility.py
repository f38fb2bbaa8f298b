"""Which parts of a person an image shows: the classes of the paper's section IV-D, defined by rules.

The paper names the classes without defining them; the rules here are ours. A part is in the picture when one
of its keypoints is labelled there, visible or occluded (Halpe does not document what its flags say about
this). An arm is an elbow or a wrist; a whole arm is both. "No head" requires the trunk (shoulders and hips)
and both whole arms, and "both arms" shoulders without hips, so that a person has at most one class. People
who match no rule are in the class "none of these".
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from hicp_lib.core.keypoints import HEAD, INDEX
from hicp_lib.formats.annotations import Annotations

# A proportion of 20 people has a 95 % interval up to 0.44 wide, nearly half the scale: smaller classes are
# counted, but not evaluated.
MIN_PEOPLE = 20

NONE = "none of these"

_WHOLE_ARMS = ("left_shoulder", "right_shoulder", "whole_left_arm", "whole_right_arm")
# Class: parts that must be in the picture, and parts that must not.
RULES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "whole upper body": (("head", *_WHOLE_ARMS), ()),
    "only head": (("head",), ("shoulder", "arm", "hip", "leg")),
    "no head": ((*_WHOLE_ARMS, "hip"), ("head",)),
    "only left arm": (("left_arm",), ("right_arm", "right_shoulder", "head", "hip", "leg")),
    "only right arm": (("right_arm",), ("left_arm", "left_shoulder", "head", "hip", "leg")),
    "both arms": (("left_arm", "right_arm", "shoulder"), ("head", "hip", "leg")),
    "both arms without shoulders": (("left_arm", "right_arm"), ("head", "shoulder", "leg")),
    "only legs": (("leg",), ("head", "shoulder", "arm")),
}
CLASSES = (*RULES, NONE)

_PART_JOINTS = {joint: (joint,) for joint in ("shoulder", "elbow", "wrist", "hip")} | {
    "leg": ("knee", "ankle")
}
_PART_KEYPOINTS = {"head": HEAD} | {
    f"{side}_{part}": np.array([INDEX[f"{side}_{joint}"] for joint in joints])
    for side in ("left", "right")
    for part, joints in _PART_JOINTS.items()
}


def visible_parts(visibility: np.ndarray) -> dict[str, np.ndarray]:
    """Which parts are in the picture.

    Parameters
    ----------
    visibility : array, shape (n, 136)
        Flags; above 0 is in the picture.

    Returns
    -------
    dict of str to array of bool, shape (n,)
        By name of the part.
    """
    parts = {name: np.any(visibility[:, points] > 0, axis=1) for name, points in _PART_KEYPOINTS.items()}
    for side in ("left", "right"):
        elbow, wrist = parts[f"{side}_elbow"], parts[f"{side}_wrist"]
        parts |= {f"{side}_arm": elbow | wrist, f"whole_{side}_arm": elbow & wrist}
    for part in ("shoulder", "arm", "hip", "leg"):
        parts[part] = parts[f"left_{part}"] | parts[f"right_{part}"]
    return parts


def visibility_class(visibility: np.ndarray) -> np.ndarray:
    """The class of each person.

    Parameters
    ----------
    visibility : array, shape (n, 136)
        Flags; above 0 is in the picture.

    Returns
    -------
    array of str, shape (n,)
        Names of `CLASSES`.

    Examples
    --------
    >>> flags = np.zeros((2, 136))
    >>> flags[0, INDEX["left_wrist"]] = 2
    >>> visibility_class(flags).tolist()
    ['only left arm', 'none of these']
    """
    parts = visible_parts(visibility)
    fits = [
        np.logical_and.reduce([*(parts[name] for name in seen), *(~parts[name] for name in unseen)])
        for seen, unseen in RULES.values()
    ]
    return np.select(fits, list(RULES), NONE)


def people_classes(truth: Mapping[str, Annotations]) -> pd.DataFrame:
    """The class of each evaluated person: columns `subset, image_id, annotation_id, class`."""
    tables = []
    for subset, of_subset in truth.items():
        people = of_subset.take(~of_subset.is_crowd)
        columns = {"subset": subset, "image_id": people.image_ids, "annotation_id": people.ids}
        tables.append(pd.DataFrame({**columns, "class": visibility_class(people.visibility)}))
    return pd.concat(tables, ignore_index=True)


def class_counts(classes: pd.DataFrame) -> pd.DataFrame:
    """People per class: columns `class`, one per subset, `people`, `judged` ("yes" or "too few").

    Examples
    --------
    >>> people = pd.DataFrame({"subset": "basic", "class": ["no head"] * 20 + ["only legs"] * 19})
    >>> class_counts(people).set_index("class").loc[["no head", "only legs"], "judged"].tolist()
    ['yes', 'too few']
    """
    counts = pd.crosstab(classes["class"], classes["subset"]).reindex(CLASSES, fill_value=0)
    counts = counts[list(dict.fromkeys(classes["subset"]))]
    total = counts.sum(axis=1)
    judged = np.where(total >= MIN_PEOPLE, "yes", "too few")
    return counts.assign(people=total, judged=judged).rename_axis(columns=None).reset_index()
