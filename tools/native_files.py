"""Files in other pose tools' formats, made from people with known keypoints.

For tests, benchmarks and examples of the importers. Every layout is written out with the names of its
keypoints, from the tools' documentation and not from the library's maps; numbers have the precision of the
tools (single precision, or six digits for OpenPose).
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hicp_lib.core.keypoints import INDEX, NAMES

COCO_17 = NAMES[:17]
_HANDS = list(NAMES[94:])  # the left, then the right
_FACE = [f"face_{i}" for i in range(68)]
_FEET = [f"{side}_{part}" for side in ("left", "right") for part in ("big_toe", "small_toe", "heel")]
LAYOUTS: dict[str, list[str]] = {
    "coco17": list(COCO_17),
    "halpe26": list(NAMES[:26]),
    "halpe136": list(NAMES),
    "wholebody133": [*COCO_17, *_FEET, *_FACE, *_HANDS],
    "coco18": [
        *"nose neck right_shoulder right_elbow right_wrist left_shoulder left_elbow left_wrist".split(),
        *"right_hip right_knee right_ankle left_hip left_knee left_ankle".split(),
        *"right_eye left_eye right_ear left_ear".split(),
    ],
    "body25": [
        *"nose neck right_shoulder right_elbow right_wrist left_shoulder left_elbow left_wrist".split(),
        *"mid_hip right_hip right_knee right_ankle left_hip left_knee left_ankle".split(),
        *"right_eye left_eye right_ear left_ear".split(), *_FEET,
    ],
    "left_hand": _HANDS[:21],
    "right_hand": _HANDS[21:],
}  # fmt: skip


@dataclass(frozen=True)
class Person:
    """Somebody found: keypoints (136, 2) in pixels and scores (136,) in Halpe's order, and a score."""

    points_px: np.ndarray
    scores: np.ndarray
    score: float

    def triples(self, layout: Sequence[str]) -> np.ndarray:
        """x, y, score of a layout's keypoints, shape (n, 3), in single precision."""
        rows = [INDEX[name] for name in layout]
        return np.column_stack([self.points_px[rows], self.scores[rows]]).astype(np.float32).astype(float)

    def box(self) -> list[float]:
        """x1, y1, x2, y2 around the keypoints."""
        return [*self.points_px.min(axis=0).tolist(), *self.points_px.max(axis=0).tolist()]


Found = Mapping[str, Sequence[Person]]  # image file name -> people

# A person in a square of side 1: x to the right, the person's left on the right as seen from the front.
_HALF = {
    "eye": (0.02, 0.07), "ear": (0.04, 0.08), "shoulder": (0.11, 0.19), "elbow": (0.16, 0.34),
    "wrist": (0.19, 0.47), "hip": (0.07, 0.50), "knee": (0.08, 0.72), "ankle": (0.08, 0.92),
    "big_toe": (0.10, 0.98), "small_toe": (0.13, 0.97), "heel": (0.07, 0.95),
}  # fmt: skip
_MIDDLE = {"nose": 0.09, "head_top": 0.0, "neck": 0.18, "mid_hip": 0.50}


def standing_person(centre_px: Sequence[float], height_px: float, rng: np.random.Generator) -> np.ndarray:
    """Keypoints of a person seen from the front, shape (136, 2), each a little off its place."""
    points = {name: (0.5, y) for name, y in _MIDDLE.items()}
    for part, (x, y) in _HALF.items():
        points |= {f"left_{part}": (0.5 + x, y), f"right_{part}": (0.5 - x, y)}
    angles = np.linspace(0, 2 * np.pi, 68, endpoint=False)
    points |= {f"face_{i}": (0.5 + 0.04 * np.sin(a), 0.09 + 0.05 * np.cos(a)) for i, a in enumerate(angles)}
    for side, x, out in (("left", 0.69, 1), ("right", 0.31, -1)):
        names = LAYOUTS[f"{side}_hand"]
        points[names[0]] = (x, 0.48)
        for i, name in enumerate(names[1:]):
            finger, joint = divmod(i, 4)
            points[name] = (x + out * 0.01 * (2 - finger), 0.50 + 0.01 * joint)
    unit = np.array([points[name] for name in NAMES])
    return np.asarray(centre_px) + height_px * (unit - 0.5 + rng.normal(0, 0.002, unit.shape))


def _dump(path: Path, value: object) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value))


def _flat(triples: np.ndarray) -> list[float]:
    return triples.ravel().tolist()


def write_openpose(folder: Path, found: Found, body: str = "body25", with_hands: bool = True) -> None:
    """`--write_json`: a file per image; a part with score 0 is 0, 0, 0; bodies half a pixel on."""

    def part(person: Person, layout: Sequence[str], extra: int = 0, on_px: float = 0.0) -> list[float]:
        triples = np.concatenate([person.triples(layout) + [on_px, on_px, 0], np.zeros((extra, 3))])
        triples[triples[:, 2] == 0] = 0
        return [float(f"{value:.6g}") for value in triples.ravel()]

    for name, people in found.items():
        rows = [
            {
                "person_id": [-1],
                "pose_keypoints_2d": part(person, LAYOUTS[body], on_px=0.5),
                "face_keypoints_2d": part(person, _FACE, extra=2) if with_hands else [],
                "hand_left_keypoints_2d": part(person, LAYOUTS["left_hand"]) if with_hands else [],
                "hand_right_keypoints_2d": part(person, LAYOUTS["right_hand"]) if with_hands else [],
                "pose_keypoints_3d": [],
                "face_keypoints_3d": [],
                "hand_left_keypoints_3d": [],
                "hand_right_keypoints_3d": [],
            }
            for person in people
        ]
        _dump(folder / f"{Path(name).stem}_keypoints.json", {"version": 1.3, "people": rows})


def write_openpose_coco(path: Path, found: Found) -> None:
    """`--write_coco_json`: flags in place of scores, -1, -1, 0 for what was not found; half a pixel on."""
    rows = []
    for name, people in found.items():
        for person in people:
            triples = person.triples(COCO_17) + [0.5, 0.5, 0]
            triples[triples[:, 2] == 0] = (-1, -1, 0)
            triples[:, 2] = triples[:, 2] > 0
            rows.append(_result(_number(name), triples, person.score))
    _dump(path, rows)


def write_alphapose(path: Path, found: Found, layout: str = "halpe136", with_names: bool = True) -> None:
    """`alphapose-results.json`, with `--eval` where `with_names` is false; no entry for an empty image."""
    rows = [
        {
            **_result(name if with_names else _number(name), person.triples(LAYOUTS[layout]), person.score),
            "box": _xywh(person.box()),
            "idx": [0.0],
        }
        for name, people in found.items()
        for person in people
    ]
    _dump(path, rows)


def write_mmpose(folder: Path, found: Found, layout: str = "wholebody133") -> None:
    """MMPoseInferencer's `pred_out_dir`: a file per image, the box in a list of one."""
    for name, people in found.items():
        rows = []
        for person in people:
            triples = person.triples(LAYOUTS[layout])
            points, scores = triples[:, :2].tolist(), triples[:, 2].tolist()
            rows.append({"keypoints": points, "keypoint_scores": scores, "bbox": [person.box()]})
            rows[-1]["bbox_score"] = person.score
        _dump(folder / f"{Path(name).stem}.json", rows)


def write_detectron2(path: Path, found: Found, ids: Mapping[str, int]) -> None:
    """`coco_instances_results.json`, from coordinates in which the first pixel's centre is at 0.5."""
    rows = []
    for name, people in found.items():
        for person in people:
            continuous = person.triples(COCO_17) + (0.5, 0.5, 0)
            written = continuous - (0.5, 0.5, 0)
            rows.append(_result(ids[name], written, person.score) | {"bbox": _xywh(person.box())})
    _dump(path, rows)


def write_coco(path: Path, found: Found, ids: Mapping[str, int], layout: str = "halpe136") -> None:
    """Plain COCO keypoint results."""
    rows = [
        _result(ids[name], person.triples(LAYOUTS[layout]), person.score)
        for name, people in found.items()
        for person in people
    ]
    _dump(path, rows)


def _result(image_id: int | str, triples: np.ndarray, score: float) -> dict:
    return {"image_id": image_id, "category_id": 1, "keypoints": _flat(triples), "score": score}


def _xywh(box: Sequence[float]) -> list[float]:
    x1, y1, x2, y2 = box
    return [x1, y1, x2 - x1, y2 - y1]


def _number(name: str) -> int:
    return int(Path(name).stem.split("_")[-1])
