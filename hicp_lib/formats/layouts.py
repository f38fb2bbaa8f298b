"""Which keypoint of Halpe-136 a file's own names mean.

A name is read without regard to case and separators, with its side first or last: `left_shoulder`,
`Left Shoulder`, `LShoulder`, `shoulder.l` and `lShoulder` are one. What data sets call differently:

- `upper_neck` and `head_bottom` (MPII, PoseTrack) are taken for the neck; `pelvis`, `root` and a `hip`
  without a side for the middle of the hips; `foot` for the ankle where no ankle is named (Human3.6M's are
  ankles); `foot_index` (MediaPipe) for the big toe.
- `head` is the head's top in CrowdPose's and Halpe's layouts; in others it is the middle of the face or of
  the skull, which has no counterpart, as have thorax, spine, belly, the points of Human-Art's hands and toes,
  and MediaPipe's other points of face and hands.
"""

import re
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.core.keypoints import COCO_17, COCO_NAMES, HAND_NAMES, INDEX, NAMES, TO_HALPE
from hicp_lib.formats.json_validation import BY_NUMBER

KeypointMap = Mapping[str, str | None] | Sequence[str]
_NO_COUNTERPART = "no counterpart"
_SIDES = ("left", "l"), ("right", "r")
_MIDDLE = {
    "nose": "nose",
    "head_top": "headtop tophead topofhead vertex",
    "neck": "neck upperneck headbottom",
    "mid_hip": "midhip hip hips pelvis root rootpelvis pelvisroot hipcenter hipcentre centerhip midpelvis",
    _NO_COUNTERPART: "head thorax spine belly torso chest neckbase face",
}
_SIDED = {
    **{part: part for part in ("eye", "ear", "shoulder", "elbow", "wrist", "hip", "knee", "ankle", "heel")},
    "big_toe": "bigtoe footindex",
    "small_toe": "smalltoe littletoe",
    **{name: name.replace("_", "") for name in HAND_NAMES},
    _NO_COUNTERPART: "foot hand finger toe thumb index pinky eyeinner eyeouter mouth",
}
_FINGERS = {"index": "forefinger", "middle": "middlefinger", "ring": "ringfinger", "little": "pinkyfinger"}
_NEAR = re.compile("upperneck|headbottom|footindex|foot")  # told when they are taken for another
_TOPPED = [{NAMES[i] for i in TO_HALPE[of]} for of in ("crowdpose14", "halpe26", "halpe136")]


def _spellings() -> dict[str, str]:
    table = {f"face{i}": f"face_{i}" for i in range(68)}
    table |= {spelling: name for name, all in _MIDDLE.items() for spelling in all.split()}
    for name, words in _SIDED.items():
        finger, _, joint = name.partition("_")
        also = [_FINGERS[finger] + joint] if finger in _FINGERS else []
        for word, (side, short) in product([*words.split(), *also], _SIDES):
            ours = name if name == _NO_COUNTERPART else f"{side}_{name}"
            table |= dict.fromkeys((side + word, short + word, word + side, word + short), ours)
    return table


_TABLE = _spellings()


def _compact(name: str) -> str:
    return re.sub(r"[\W_]", "", name.lower())


def halpe_name(name: str) -> str | None:
    """The keypoint that a name means: a name of ours, "no counterpart", or None if it is not understood.

    Examples
    --------
    >>> [halpe_name(name) for name in ("L_Shoulder", "knee right", "Thorax", "tail")]
    ['left_shoulder', 'right_knee', 'no counterpart', None]
    """
    return _TABLE.get(_compact(name))


def read_keypoint_map(path: str | Path) -> KeypointMap:
    """Read what a user says of a file's keypoint names.

    Parameters
    ----------
    path : str or Path
        A JSON file: an object of their names to ours, null for a keypoint to leave out; or, for a file
        without names, the list of its keypoints' names.

    Returns
    -------
    dict of str to str, or list of str

    Raises
    ------
    InputError
        For anything else.
    """
    value = read_json(path)
    names = list(value.values()) if isinstance(value, dict) else value
    if not isinstance(names, list) or not names or isinstance(value, list) and None in names:
        raise InputError(f"{path}: expected an object of their names to ours (or null), or a list of names")
    for name in names:
        if name is not None and (not isinstance(name, str) or halpe_name(name) is None):
            raise InputError(
                f"{path}: {name!r} is no keypoint; expected such as {', '.join(NAMES[5:9])}, ..."
            )
    return value


def layouts_of(
    where: str, names: Sequence[str], keypoint_map: KeypointMap | None = None
) -> tuple[Mapping[int, np.ndarray], dict[str, str]]:
    """Where a file's keypoints belong, by the number of them that a person has.

    Parameters
    ----------
    where : str
        File and key, for messages.
    names : sequence of str
        The names the file gives its keypoints; none if it does not.
    keypoint_map : mapping or sequence, optional
        As of `read_keypoint_map`.

    Returns
    -------
    layouts : dict of int to array of int
        Number of keypoints -> their indices in Halpe-136, -1 where it has no counterpart.
    notes : dict of str to str
        What was left out, and what was taken for what.

    Raises
    ------
    InputError
        For names that are not understood, and two that mean one.
    """
    if isinstance(keypoint_map, Sequence):
        if names and len(names) != len(keypoint_map):
            raise InputError(
                f"{where} has {len(names)} names, the map {len(keypoint_map)}; give one for each"
            )
        names, keypoint_map = keypoint_map, None
    if not names:
        return BY_NUMBER, {}
    ours = _meanings(where, names, keypoint_map or {})
    indices = np.array([INDEX.get(name, -1) for name in ours])
    layouts = {len(names): indices}
    if (
        list(indices[:17]) == COCO_17.tolist()
    ):  # WholeBody names its body; Human-Art 21 points, of which 17 are
        layouts |= {17: indices[:17]} | ({133: TO_HALPE["wholebody133"]} if len(names) == 17 else {})
    return layouts, _notes(names, ours)


def _meanings(where: str, names: Sequence[str], given: Mapping[str, str | None]) -> list[str]:
    for name in given:
        if name not in names:
            raise InputError(f"{where}: has no {name!r}, which the map names; it has {', '.join(names)}")
    meant = [halpe_name(given[n] or "head") if n in given else halpe_name(n) for n in names]
    unknown = [name for name, ours in zip(names, meant, strict=True) if ours is None]
    if unknown or not set(meant) & set(INDEX):
        example = f'{{"{(unknown or names)[0]}": "left_shoulder" or another name of ours, or null}}'
        raise InputError(
            f"{where}: not understood: {', '.join(map(repr, unknown or names))}; give "
            f"--keypoint-map FILE.json with {example}"
        )
    ours = [str(name) for name in meant]
    compact = [_compact(name) for name in names]
    topped = [("head_top" if n == "head" else o) for n, o in zip(compact, ours, strict=True)]
    ours = topped if set(topped) in _TOPPED else ours
    if not any(name.endswith("ankle") for name in ours):
        feet = {
            f"{side}_ankle": (f"{side}foot", f"{short}foot", f"foot{side}", f"foot{short}")
            for side, short in _SIDES
        }
        ours = [next((a for a, of in feet.items() if n in of), o) for n, o in zip(compact, ours, strict=True)]
    for name in set(ours) - {_NO_COUNTERPART}:
        if ours.count(name) > 1:
            both = " and ".join(repr(n) for n, o in zip(names, ours, strict=True) if o == name)
            raise InputError(
                f'{where}: {both} mean {name}; leave one out by --keypoint-map FILE.json: {{"...": null}}'
            )
    return ours


def _notes(names: Sequence[str], ours: list[str]) -> dict[str, str]:
    out = [name for name, o in zip(names, ours, strict=True) if o == _NO_COUNTERPART]
    near = [
        f"{n} for {o}" for n, o in zip(names, ours, strict=True) if o in INDEX and _NEAR.search(_compact(n))
    ]
    absent = [name for name in COCO_NAMES if name not in ours]
    notes = {
        "dropped": out and f"keypoints without a counterpart left out: {', '.join(out)}",
        "taken": near and f"keypoints taken: {', '.join(near)}",
        "absent": absent and f"names no {', '.join(absent)}: the body is evaluated without",
    }
    return {about: note for about, note in notes.items() if note}
