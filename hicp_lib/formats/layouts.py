"""The meaning of names in a file: which category is people, and which Halpe-136 keypoint each name is.

Case and separators in a keypoint's name are ignored, and the side may come first or last: `left_shoulder`,
`Left Shoulder`, `LShoulder`, `shoulder.l` and `lShoulder` are the same. `data/keypoint_names.json` lists the
names of each keypoint in data sets:

- `upper_neck` and `head_bottom` (MPII, PoseTrack) are read as the neck; `pelvis`, `root` and a `hip` without
  a side as the middle of the hips; `foot` as the ankle if no ankle is named (as in Human3.6M); `foot_index`
  (MediaPipe) as the big toe.
- `head` is the head's top in CrowdPose's and Halpe's layouts; in others it is the middle of the face or of
  the skull, which is left out, as are thorax, spine, belly, the points of Human-Art's hands and toes, and
  MediaPipe's other points of face and hands.
"""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.core.keypoints import COCO_17, COCO_NAMES, INDEX, NAMES, TO_HALPE
from hicp_lib.formats.json_validation import CONVENTIONS, Layouts, Rows

PERSON_CATEGORY = 1  # if a file does not name its categories
_PEOPLE = ("person", "persons", "people", "human", "humans", "pedestrian")
_NEAR = re.compile("upper.?neck|head.?bottom|foot", re.IGNORECASE)  # reported when read as another keypoint
_TOPPED = [{NAMES[i] for i in TO_HALPE[of]} for of in ("crowdpose14", "halpe26", "halpe136")]


@dataclass(frozen=True)
class PersonCategory:
    """The category of people.

    Attributes
    ----------
    id : int
        The id that objects refer to.
    keypoints : list of str
        Its keypoints' names; empty if the file does not give them.
    others : set of int
        Ids of the file's other categories.
    """

    id: int = PERSON_CATEGORY
    keypoints: list[str] = field(default_factory=list)
    others: set[int] = field(default_factory=set)


def person_category(path: Path, value: Any) -> PersonCategory:
    """Find the people among a file's categories.

    Parameters
    ----------
    path : Path
        The file, for messages.
    value : Any
        What it has as `categories`; None or an empty list means people only, as category 1.

    Returns
    -------
    PersonCategory

    Raises
    ------
    InputError
        If no category, or more than one, is of people, or one is malformed.
    """
    if not value and value in (None, []):
        return PersonCategory()
    rows = Rows.of(path, "categories", value)
    ids = rows.unique_integers("id").tolist()
    unnamed = {"default": _PEOPLE[0]} if len(ids) == 1 else {}
    names = rows.column("name", lambda name: isinstance(name, str), "a name", **unnamed)
    keypoints = rows.column("keypoints", _are_names, "a list of names", default=[])
    people = [i for i, name in enumerate(names) if name.strip().lower() in _PEOPLE]
    people = [i for i in people if keypoints[i]] or people
    if len(people) != 1:
        which = "several of its categories are" if people else "none of its categories is"
        raise InputError(f"{path}: {which} of people: {', '.join(map(repr, names))}; name one 'person'")
    chosen = ids.pop(people[0])
    return PersonCategory(chosen, keypoints[people[0]] or [], set(ids))


def _are_names(value: Any) -> bool:
    return value is None or (isinstance(value, list) and all(isinstance(name, str) for name in value))


def _spellings() -> dict[str, str]:
    names = json.loads((DATA_DIR / "keypoint_names.json").read_text())
    table = {word: name for name, words in names["middle"].items() for word in words}
    for (name, words), side in product(names["sided"].items(), ("left", "right")):
        for word, short in product(words, (side, side[0])):
            table |= dict.fromkeys((short + word, word + short), f"{side}_{name}")
    return table


_TABLE = _spellings()


def halpe_name(name: str) -> str | None:
    """The Halpe keypoint of a name; "other" for a known name without a counterpart, None for an unknown one.

    Examples
    --------
    >>> [halpe_name(name) for name in ("L_Shoulder", "knee right", "Thorax", "tail")]
    ['left_shoulder', 'right_knee', 'other', None]
    """
    return _TABLE.get(re.sub(r"[\W_]", "", name.lower()))


def _keypoint_map(path: str | Path) -> dict[str, str | None] | list[str]:
    value = read_json(path)
    names = [name for name in value.values() if name is not None] if isinstance(value, dict) else value
    if not isinstance(names, list) or not all(isinstance(name, str) and halpe_name(name) for name in names):
        expected = f"an object of their keypoints' names to ours ({NAMES[5]}, ...) or null, or a list of ours"
        raise InputError(f"{path}: does not say what keypoints mean; expected {expected}")
    return value


def layouts_of(
    where: str, names: Sequence[str], keypoint_map: str | Path | None = None
) -> tuple[Layouts, dict[str, str]]:
    """The Halpe indices of a file's keypoints, by the number of keypoints per person.

    Parameters
    ----------
    where : str
        File and key, for messages.
    names : sequence of str
        The names the file gives its keypoints; none if it does not.
    keypoint_map : str or Path, optional
        A JSON file: an object from their names to ours, null for a keypoint to leave out; or a list of names
        that replaces the file's.

    Returns
    -------
    layouts : dict of int to array of int
        As of `hicp_lib.formats.json_validation.Rows.points`.
    notes : dict of str to str
        What was left out, and which names were read as which keypoint.

    Raises
    ------
    InputError
        For unknown names, and two names of the same keypoint.
    """
    given = _keypoint_map(keypoint_map) if keypoint_map else {}
    names, given = (given, {}) if isinstance(given, list) else (names, given)
    if not names:
        return CONVENTIONS, {}
    ours = _meanings(where, names, given)
    indices = np.array([INDEX.get(name, -1) for name in ours])
    layouts: dict[int, str | np.ndarray] = {len(names): indices}
    if indices[:17].tolist() == COCO_17.tolist():  # WholeBody names only the body, Human-Art four more
        layouts |= {17: "coco17"} | ({133: "wholebody133"} if len(names) == 17 else {})
    pairs = list(zip(names, ours, strict=True))
    lists = {
        "keypoints left out": [name for name, of in pairs if of not in INDEX],
        "keypoints taken": [f"{name} for {of}" for name, of in pairs if of in INDEX and _NEAR.search(name)],
        "the body has no": [name for name in COCO_NAMES if name not in ours],
    }
    return layouts, {about: f"{about}: {', '.join(of)}" for about, of in lists.items() if of}


def _meanings(where: str, names: Sequence[str], given: Mapping[str, str | None]) -> list[str]:
    told = [given.get(name, name) for name in names]
    ours = ["other" if name is None else halpe_name(name) or "" for name in told]
    if not any(of.endswith("ankle") for of in ours):
        ours = [of.replace("foot", "ankle") for of in ours]
    topped = ["head_top" if of == "head" else of for of in ours]
    ours = topped if set(topped) in _TOPPED else ours
    pairs = list(zip(names, ours, strict=True))
    problems = {
        "not understood": [name for name, of in pairs if not of],
        "several mean one": [name for name, of in pairs if of in INDEX and ours.count(of) > 1],
        "none is a person's": [] if set(ours) & set(INDEX) else names,
        "not in the file": [name for name in given if name not in names],
    }
    for problem, of in problems.items():
        if of:
            example = f'{{"{of[0]}": "left_shoulder"}}, one of our names, or null to leave it out'
            listed = ", ".join(map(repr, of[:20]))[:300]
            raise InputError(f"{where}: {problem}: {listed}; give --keypoint-map FILE.json with {example}")
    return ours
