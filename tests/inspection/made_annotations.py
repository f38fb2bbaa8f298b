"""Annotations of people in the layouts of data sets; names of files mislead on purpose."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from hicp_lib.core.keypoints import NAMES
from tests.formats.importers.native_people import make_person
from tests.inspection.cases import case, dump

from native_files import LAYOUTS  # isort: skip

SETS = {
    "coco17": list(NAMES[:17]), "halpe26": list(NAMES[:26]), "halpe136": list(NAMES),
    "crowdpose14": [f"{side}_{part}" for part in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
                    for side in ("left", "right")] + ["head", "neck"],
    "aic14": [f"{side}_{part}" for parts in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle"))
              for side in ("right", "left") for part in parts] + ["head_top", "neck"],
    "mpii16": ["right_ankle", "right_knee", "right_hip", "left_hip", "left_knee", "left_ankle", "pelvis",
               "thorax", "upper_neck", "head_top", "right_wrist", "right_elbow", "right_shoulder",
               "left_shoulder", "left_elbow", "left_wrist"],
    "posetrack17": ["nose", "head_bottom", "head_top", *NAMES[3:17]],
    "h36m17": ["root", "right_hip", "right_knee", "right_foot", "left_hip", "left_knee", "left_foot", "spine",
               "thorax", "neck_base", "head", "left_shoulder", "left_elbow", "left_wrist", "right_shoulder",
               "right_elbow", "right_wrist"],
}  # fmt: skip
NEEDS_OF_SET = {"hicp dataset create": "--images", "hicp evaluate": "--detections"}
BODY_ONLY = NEEDS_OF_SET | {"hicp evaluate": "--detections (the body only"}


def annotated(
    folder: Path, layout: str, n: int = 2, names: bool = True, category: int = 1, **changes
) -> Path:
    """COCO annotations of `n` people in as many images; where Halpe has no such keypoint, a flag of 0."""
    points = dict(zip(NAMES, make_person().points_px.round(2).tolist(), strict=True))
    points |= {"head": points["head_top"], "head_bottom": points["neck"], "upper_neck": points["neck"]}
    points |= {"pelvis": points["mid_hip"], "root": points["mid_hip"]}
    points |= {f"{side}_foot": points[f"{side}_ankle"] for side in ("left", "right")}
    flat = [
        number for name in SETS[layout] for number in ([*points[name], 2] if name in points else [0, 0, 0])
    ]
    person = {"category_id": category, "bbox": [150.0, 30.0, 340.0, 420.0], "area": 70000, "iscrowd": 0,
              "keypoints": flat} | changes  # fmt: skip
    images = [{"id": i, "file_name": f"{i}.jpg", "width": 640, "height": 480} for i in range(n)]
    people = [person | {"id": 10 + i, "image_id": i} for i in range(n)]
    categories = [{"id": category, "name": "person"} | ({"keypoints": SETS[layout]} if names else {})]
    value = {"images": images, "annotations": people, "categories": categories}
    return dump(folder / "detections.txt", value)


def set_case(layout: str, says: dict[str, str], notes: tuple = (), body_only: bool = True) -> None:
    def make(folder: Path) -> Path:
        return annotated(folder, layout)

    make.__name__ = f"annotations_{layout}"
    common = {"people": "2 in 2 images; crowds 0; category 1", "units": "pixels, origin top left",
              "flags": "2.0;", "handedness": "in 100 %: as of people facing",
              "area": "0.49 of the box"}  # fmt: skip
    needs = BODY_ONLY if body_only else NEEDS_OF_SET
    case("COCO annotations of people", common | {"layout": layout} | says, notes=list(notes), needs=needs)(
        make
    )


BODY = {"people with labelled": "body 2, face 0, hands 0"}
ALL = {"people with labelled": "body 2, face 2, hands 2"}
set_case("coco17", BODY)
set_case("halpe26", BODY)
set_case("halpe136", ALL, body_only=False)
set_case("crowdpose14", BODY, ["the body has no: nose"])
set_case("aic14", BODY, ["the body has no: nose"])
set_case("mpii16", BODY, ["keypoints left out", "taken: upper_neck for neck", "the body has no: nose"])
set_case("posetrack17", BODY, ["taken: head_bottom for neck", "the body has no: left_eye"])
set_case("h36m17", BODY, ["keypoints left out", "taken", "the body has no: nose"])


@case("COCO annotations of people", {"layout": "its own, by the 17 names", **BODY}, needs=BODY_ONLY)
def annotations_of_permuted_names(folder):
    path = annotated(folder, "coco17")
    value = json.loads(path.read_text())
    order = [*range(16, -1, -1)]
    value["categories"][0]["keypoints"] = [SETS["coco17"][k] for k in order]
    for person in value["annotations"]:
        person["keypoints"] = [person["keypoints"][3 * k + j] for k in order for j in range(3)]
    return dump(path, value)


@case("COCO annotations of people", {"layout": "17 keypoints by their number"}, needs=BODY_ONLY,
      notes=["17 keypoints without names"])  # fmt: skip
def annotations_without_names(folder):
    return annotated(folder, "coco17", names=False)


@case("COCO annotations of people", {"layout": "136 keypoints by their number", **ALL}, needs=NEEDS_OF_SET)
def annotations_of_halpe_without_names(folder):
    return annotated(folder, "halpe136", names=False)


@case("COCO annotations of people", {"layout": "wholebody133, by the 17 names", **ALL}, needs=NEEDS_OF_SET)
def annotations_wholebody(folder):
    path = annotated(folder, "halpe136")
    value = json.loads(path.read_text())
    value["categories"][0]["keypoints"] = SETS["coco17"]
    for person in value["annotations"]:
        triples = make_person().points_px[[NAMES.index(name) for name in LAYOUTS["wholebody133"]]]
        flat = np.column_stack([triples, np.full(133, 2)]).ravel().tolist()
        parts = [("keypoints", 17), ("foot_kpts", 6), ("face_kpts", 68), ("lefthand_kpts", 21)]
        for key, n in [*parts, ("righthand_kpts", 21)]:
            person[key], flat = flat[: 3 * n], flat[3 * n :]
    return dump(path, value)


@case("COCO annotations of people", {"people": "category 0"}, needs=BODY_ONLY)
def annotations_of_category_0(folder):
    return annotated(folder, "coco17", category=0)


@case("COCO annotations of people", {"people": "2 in 3 images; crowds 0; category 2"}, needs=BODY_ONLY,
      notes=["other categories"])  # fmt: skip
def annotations_of_category_2_beside_cats(folder):
    path = annotated(folder, "coco17", n=3, category=2)
    value = json.loads(path.read_text())
    value["categories"].insert(0, {"id": 1, "name": "cat"})
    value["annotations"][0]["category_id"] = 1
    return dump(path, value)


@case(
    "COCO annotations of people", {"area": "0.53 of the box"}, needs=BODY_ONLY, notes=["the area of 2 of 2"]
)
def annotations_without_area(folder):
    return annotated(folder, "coco17", area=0)


@case("COCO annotations of people", {"people": "crowds 2", "flags": "2.0"}, needs=BODY_ONLY)
def annotations_of_crowds(folder):
    return annotated(folder, "coco17", iscrowd=1)


@case(
    "COCO annotations of people", {"people": "0 in 0 images", "flags": "nothing is labelled"}, needs=BODY_ONLY
)
def annotations_of_nobody(folder):
    return annotated(folder, "coco17", n=0)


@case("COCO annotations of people", problem="[0, 1]; expected pixels")
def annotations_in_fractions(folder):
    points = (make_person().points_px[:17] / [640, 480]).tolist()
    flat = [number for point in points for number in (*point, 2)]
    return annotated(folder, "coco17", keypoints=flat)


@case("COCO annotations of people", problem="not understood: 'tail'")
def annotations_of_an_animal(folder):
    path = annotated(folder, "coco17")
    return dump(path, json.loads(path.read_text().replace('"left_eye"', '"tail"')))


@case("COCO annotations of people", needs=BODY_ONLY, notes=["outside images"])
def annotations_of_images_that_were_turned(folder):
    path = annotated(folder, "coco17")
    return dump(path, json.loads(path.read_text().replace('"width": 640', '"width": 360')))


@case("COCO annotations of people", {"handedness": "in 0 %: as of backs"}, needs=BODY_ONLY)
def annotations_with_sides_of_the_picture(folder):
    path = annotated(folder, "coco17")
    swap = {"left": "right", "right": "left"}
    value = json.loads(path.read_text())
    names = value["categories"][0]["keypoints"]
    value["categories"][0]["keypoints"] = [
        swap.get(side, side) + bar + rest for side, bar, rest in (name.partition("_") for name in names)
    ]
    return dump(path, value)
