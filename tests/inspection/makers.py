"""Files of every kind that `hicp inspect` knows, with what is right to say of each.

Names mislead on purpose wherever content decides.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
from PIL import Image

from hicp_lib.core.camera import Camera
from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import NAMES
from hicp_lib.formats.annotations import write_detections
from hicp_lib.formats.detection_files import open_detections
from hicp_lib.recordings.camera_file import write_camera
from hicp_lib.recordings.qualisys import MotionCapture, write_c3d, write_tsv
from hicp_lib.recordings.tum import write_file_list, write_poses
from hicp_lib.robot.kinematics import HEAD_JOINTS
from tests.core.test_video import write_video
from tests.detectors.onnx.onnx_models import constant_model, told
from tests.formats.importers.native_people import make_person
from tests.recordings.conftest import write_small
from tests.recordings.ros_bags import write_bag

from native_files import (  # isort: skip
    LAYOUTS, write_alphapose, write_coco, write_detectron2, write_mmpose, write_openpose, write_openpose_coco,
)  # fmt: skip

EXAMPLES = Path(__file__).parents[2] / "data" / "examples" / "native"


@dataclass(frozen=True)
class Case:
    """What is right to say of a file; texts are parts of what is said, needs all there are."""

    make: Callable[[Path], Path]
    kind: str
    says: dict[str, str]
    notes: list[str] = field(default_factory=list)
    needs: dict[str, str] = field(default_factory=dict)
    problem: str = ""


CASES: dict[str, Case] = {}


def case(kind: str, says: dict[str, str] | None = None, **more):
    """Register what is right of the file that the function makes in a folder."""

    def registered(make):
        CASES[make.__name__] = Case(make, kind, says or {}, **more)
        return make

    return registered


def dump(path: Path, value: object) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value))
    return path


# Annotations

SETS = {
    "coco17": list(NAMES[:17]), "halpe26": list(NAMES[:26]), "halpe136": list(NAMES),
    "crowdpose14": [f"{side}_{part}" for part in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
                    for side in ("left", "right")] + ["head", "neck"],
    "aic14": [f"{side}_{part}" for parts in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle"))
              for side in ("right", "left") for part in parts] + ["head_top", "neck"],
    "mpii16": ["right_ankle", "right_knee", "right_hip", "left_hip", "left_knee", "left_ankle", "pelvis", "thorax",
               "upper_neck", "head_top", "right_wrist", "right_elbow", "right_shoulder", "left_shoulder",
               "left_elbow", "left_wrist"],
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
    common = {"people": "2 in 2 images; crowds 0; category 1", "units": "pixels, origin top left", "flags": "2.0;",
              "handedness": "in 100 %: as of people facing", "area": "0.49 of the box"}  # fmt: skip
    needs = BODY_ONLY if body_only else NEEDS_OF_SET
    case("COCO annotations of people", common | {"layout": layout} | says, notes=list(notes), needs=needs)(
        make
    )


BODY = {"people with labelled": "body 2, face 0, hands 0"}
ALL = {"people with labelled": "body 2, face 2, hands 2"}
set_case("coco17", BODY)
set_case("halpe26", BODY)
set_case("halpe136", ALL, body_only=False)
set_case("crowdpose14", BODY, ["names no nose"])
set_case("aic14", BODY, ["names no nose"])
set_case("mpii16", BODY, ["without a counterpart", "taken: upper_neck for neck", "names no nose"])
set_case("posetrack17", BODY, ["taken: head_bottom for neck", "names no left_eye"])
set_case("h36m17", BODY, ["without a counterpart", "taken", "names no nose"])


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


@case("COCO annotations of people", needs=BODY_ONLY, notes=["lie outside their images"])
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


# Detections

FOUND = {"a_1.jpg": [make_person(1), make_person(2)], "b_2.jpg": [make_person(3)]}
IDS = {"a_1.jpg": 1, "b_2.jpg": 2}
PEOPLE = {"people": "3 in 2 of 2 images", "units": "pixels, origin top left, pixel centres at integers",
          "handedness": "in 100 %"}  # fmt: skip
IN_01 = {"scores": "divided by 1"}


def imported(tool: str, more: str = "") -> dict[str, str]:
    return {"hicp import": f"--format {tool} --annotations{more}"}


@case("COCO keypoint results", PEOPLE | IN_01 | {"layout": "coco17 3"}, needs=imported("coco"))
def coco_results(folder):
    write_coco(folder / "annotations.json", FOUND, IDS, "coco17")
    return folder / "annotations.json"


@case("COCO keypoint results", PEOPLE | {"layout": "halpe136 3", "scores": "give --score-scale"},
      needs=imported("coco", " --score-scale"))  # fmt: skip
def coco_results_of_large_scores(folder):
    loud = {
        name: [make_person(k, scores=np.full(136, 7.0)) for k, _ in enumerate(of)]
        for name, of in FOUND.items()
    }
    write_coco(folder / "alphapose-results.json", loud, IDS)
    return folder / "alphapose-results.json"


@case("COCO keypoint results", problem="[0, 1]; expected pixels")
def coco_results_in_fractions(folder):
    small = {"a_1.jpg": [make_person(1, points_px=make_person(1).points_px / 640)]}
    write_coco(folder / "results.json", small, IDS)
    return folder / "results.json"


@case("COCO keypoint results", problem="expected a finite number")
def coco_results_with_nan(folder):
    write_coco(folder / "results.json", FOUND, IDS)
    text = (folder / "results.json").read_text()
    (folder / "results.json").write_text(
        text.replace('"keypoints": [', '"keypoints": [NaN, ', 1).replace(", ", "", 0)
    )
    value = json.loads((folder / "results.json").read_text())
    value[0]["keypoints"].pop()
    return dump(folder / "results.json", value)


@case("COCO keypoint results with boxes, as Detectron2 writes", PEOPLE | IN_01 | {"layout": "coco17 3"},
      needs=imported("detectron2 (of other tools coco)"))  # fmt: skip
def detectron2_results(folder):
    write_detectron2(folder / "openpose.json", FOUND, IDS)
    return folder / "openpose.json"


@case("AlphaPose results", PEOPLE | IN_01 | {"layout": "halpe136 3"}, needs=imported("alphapose"))
def alphapose_results(folder):
    write_alphapose(folder / "results.json", FOUND)
    return folder / "results.json"


@case("AlphaPose results", PEOPLE | {"layout": "coco17 3"}, needs=imported("alphapose"))
def alphapose_results_by_number(folder):
    write_alphapose(folder / "coco_instances_results.json", FOUND, "coco17", with_names=False)
    return folder / "coco_instances_results.json"


@case("AlphaPose results", PEOPLE | {"layout": "halpe26 3"}, needs=imported("alphapose"))
def alphapose_folder(folder):
    write_alphapose(folder / "alphapose-results.json", FOUND, "halpe26")
    return folder


OPENPOSE = PEOPLE | {"units": "half a pixel is taken off OpenPose's bodies"} | IN_01


@case("OpenPose keypoints", OPENPOSE | {"layout": "openpose_body25 3, openpose_face70 3, left_hand21 3"},
      needs=imported("openpose"))  # fmt: skip
def openpose_folder_of_25(folder):
    write_openpose(folder, FOUND)
    return folder


@case("OpenPose keypoints", OPENPOSE | {"layout": "openpose_coco18 3;", "people with keypoints": "hands 0"},
      needs=imported("openpose"))  # fmt: skip
def openpose_folder_of_18(folder):
    write_openpose(folder, FOUND, "coco18", with_hands=False)
    return folder


@case("OpenPose keypoints", {"people": "2 in 1 of 1 images"}, needs=imported("openpose"))
def openpose_file(folder):
    write_openpose(folder, FOUND)
    return (folder / "a_1_keypoints.json").rename(folder / "results.txt")


@case("OpenPose keypoints", {"people": "0 in 0 of 1 images", "scores": "none"}, needs=imported("openpose"))
def openpose_file_of_nobody(folder):
    return dump(folder / "x.json", {"version": 1.3, "people": []})


@case("OpenPose keypoints", problem="is a list of 7")
def openpose_file_of_7(folder):
    return dump(folder / "x.json", {"version": 1.3, "people": [{"pose_keypoints_2d": [1.0] * 7}]})


@case("OpenPose's COCO results", PEOPLE | {"scores": "no scores", "units": "half a pixel is taken off"},
      needs=imported("openpose"))  # fmt: skip
def openpose_coco_results(folder):
    unsure = {
        name: [make_person(k, scores=1.0 * (np.arange(136) > 0)) for k, _ in enumerate(of)]
        for name, of in FOUND.items()
    }
    write_openpose_coco(folder / "results.json", unsure)
    return folder / "results.json"


@case("MMPose predictions", PEOPLE | IN_01 | {"layout": "wholebody133 3"}, needs=imported("mmpose"))
def mmpose_folder(folder):
    write_mmpose(folder, FOUND)
    return folder


@case("MMPose predictions", {"people": "1 in 1 of 1 images", "layout": "coco17 1"}, needs=imported("mmpose"))
def mmpose_file(folder):
    write_mmpose(folder, FOUND, "coco17")
    return (folder / "b_2.json").rename(folder / "openpose_keypoints.json")


@case("MMPose predictions", {"layout": "wholebody133 3", "scores": "(10 if RTMW"},
      needs=imported("mmpose", " --score-scale"))  # fmt: skip
def mmpose_folder_of_rtmw(folder):
    loud = {
        name: [make_person(k, scores=np.full(136, 7.0)) for k, _ in enumerate(of)]
        for name, of in FOUND.items()
    }
    write_mmpose(folder, loud)
    return folder


@case("MMPose predictions", {"people": "2 in 1 of 1 images", "layout": "halpe26 2"}, needs=imported("mmpose"))
def mmpose_saved_predictions(folder):
    write_mmpose(folder / "x", FOUND, "halpe26")
    names = {str(i): name for i, name in enumerate(LAYOUTS["halpe26"])}
    people = json.loads((folder / "x/a_1.json").read_text())
    return dump(
        folder / "results_a_1.json", {"meta_info": {"keypoint_id2name": names}, "instance_info": people}
    )


@case("empty list: nobody was found", {"people": "0 in 0 of 0 images", "scores": "none"}, needs={"hicp evaluate": "--annotations"})
def empty_list(folder):
    return dump(folder / "results.json", [])


def detections() -> dict[int, Detections]:
    people = {image: [person for person in FOUND[name]] for name, image in IDS.items()}
    return {
        image: Detections(
            *(np.array([getattr(p, key) for p in of]) for key in ("points_px", "scores", "score"))
        )
        for image, of in people.items()
    }


HICP = {"hicp evaluate": "--annotations", "hicp draw": "--images"}


def detected(path: Path) -> Path:
    with open_detections(path) as write:
        for image, found in detections().items():
            write(image, {"file_name": f"{image}.jpg"}, found)
    return path


@case("detections by hicp detect", PEOPLE | IN_01 | {"layout": "halpe136 3"}, needs=HICP)
def hicp_json(folder):
    return detected(folder / "d.json")


@case("detections by hicp detect", PEOPLE | IN_01, needs=HICP, notes=["ends in .csv"])
def hicp_csv(folder):
    return detected(folder / "d.csv").rename(folder / "trajectory.txt")


@case("detections by hicp detect (Parquet)", PEOPLE | IN_01, needs=HICP, notes=["ends in .parquet"])
def hicp_parquet(folder):
    return detected(folder / "d.parquet").rename(folder / "d.bin")


@case("detections by hicp detect", {"times": "5 per second (median), 0.4 s"}, needs=HICP)
def hicp_json_of_a_video(folder):
    with open_detections(folder / "d.json") as write:
        for k in range(3):
            write(k, {"file_name": "v.mp4", "frame": k, "time_s": k / 5}, detections()[2])
    return folder / "d.json"


@case("detections by hicp import", PEOPLE, needs=HICP)
def hicp_import(folder):
    extras = {i: [{"raw_keypoint_scores": [0.1] * 136}] * len(of) for i, of in detections().items()}
    write_detections(folder / "d.json", detections(), extras)
    return folder / "d.json"


@case("names of images by id", {"objects": "2"}, needs={"hicp draw": "lies beside"})
def image_names(folder):
    return dump(folder / "x.images.json", [{"id": 1, "file_name": "a"}, {"id": 2, "file_name": "b"}])


@case("detections by hicp detect (Parquet)", problem="is no table that hicp detect wrote")
def another_parquet(folder):
    pd.DataFrame({"x_m": [1.0, 2.0]}).to_parquet(folder / "results.json")
    return folder / "results.json"


# Cameras and recordings

CAMERA = Camera(640, 480, 600.0, 610.0, 319.5, 239.5)
INTRINSIC = {"width": 640, "height": 480, "intrinsic_matrix": [600, 0, 0, 0, 610, 0, 320, 240, 1]}
CAMERA_SAYS = {"image": "640 x 480 pixels, focal lengths 600.00, 610.00"}
AS_POSES = {"hicp record import": "this file as --poses"}


@case("intrinsics of a camera", CAMERA_SAYS | {"depth": "5000 units per metre", "distortion": "none"},
      needs={"hicp record import": "--open3d, its folder"})  # fmt: skip
def camera(folder):
    write_camera(folder / "registration.json", CAMERA, 5000)
    return folder / "registration.json"


@case("intrinsics of a camera", CAMERA_SAYS | {"depth": "not in the file"},
      needs={"hicp record import": "--depth-scale"})  # fmt: skip
def camera_without_scale(folder):
    return dump(folder / "camera_intrinsic.json", INTRINSIC)


@case("intrinsics of a camera", {"distortion": "some; undone"}, needs={"hicp record import": "its folder"})
def camera_distorted(folder):
    return dump(
        folder / "x",
        INTRINSIC | {"depth_scale": 1000, "distortion_model": "plumb_bob", "coeffs": [0.1, -0.05, 0, 0, 0]},
    )


@case("intrinsics of a camera", problem="column by column")
def camera_by_rows(folder):
    return dump(folder / "x.json", INTRINSIC | {"intrinsic_matrix": [600, 0, 320, 0, 610, 240, 0, 0, 1]})


AGAINST = {"errors against motion capture": "in its folder"}


@case("registration of motion capture", {"units": "at 0.000, 1.000, 0.000"}, needs=AGAINST)
def registration(folder):
    T = np.eye(4)
    T[1, 3] = 1
    return dump(folder / "camera.json", {"T_base_mocap": T.tolist()})


@case("registration of motion capture", problem="not a rotation")
def registration_with_scale(folder):
    return dump(folder / "x.json", {"T_base_mocap": np.diag([1000.0, 1000, 1000, 1]).tolist()})


TIMES_S = 1.6e9 + np.arange(4) / 30
POSES = np.tile(np.eye(4), (4, 1, 1))
POSES[:, 0, 3] = np.arange(4) / 10


@case("list of images and their times (TUM)", needs={"hicp record check": "folder"}, says={
      "images": "4, of which 4 are not there", "times": "30 per second (median), 0.1 s, from 1600000000.000 s (since 1970: 2020"})  # fmt: skip
def rgb_list(folder):
    write_file_list(folder / "groundtruth.txt", TIMES_S, [f"rgb/{k}.png" for k in range(4)])
    return folder / "groundtruth.txt"


@case(
    "list of images and their times (TUM)", notes=["look like milliseconds"], needs={"hicp record check": ""}
)
def rgb_list_in_ms(folder):
    write_file_list(folder / "rgb.txt", np.arange(4) * 33.3, [f"rgb/{k}.png" for k in range(4)])
    return folder / "rgb.txt"


TRAJECTORY = {"poses": "4, camera to", "units": "metres; moved by 0.300, 0.000, 0.000"}


@case("trajectory of a camera (TUM)", TRAJECTORY | {"times": "30 per second"}, needs=AS_POSES)
def tum_poses(folder):
    write_poses(folder / "rgb.txt", TIMES_S, POSES)
    return folder / "rgb.txt"


@case("trajectory of a camera (TUM)", needs=AS_POSES, notes=["look like milliseconds"])
def tum_poses_in_ms(folder):
    write_poses(folder / "x.txt", np.arange(4) * 33.3, POSES)
    return folder / "x.txt"


@case("trajectory of a camera (TUM)", needs=AS_POSES, notes=["are these millimetres?"])
def tum_poses_in_mm(folder):
    far = POSES.copy()
    far[:, :3, 3] = 1000 * (1 + POSES[:, :3, 3])
    write_poses(folder / "x.txt", TIMES_S, far)
    return folder / "x.txt"


@case("trajectory of a camera (TUM)", {"poses": "4,"}, needs=AS_POSES, notes=["1 lines repeat the time"])
def tum_poses_repeated(folder):
    lines = [f"{t} 0 0 0 0 0 0 1\n" for t in (1, 2, 2, 3, 4)]
    (folder / "x.txt").write_text("".join(lines))
    return folder / "x.txt"


@case("trajectory of a camera (TUM)", problem="quaternion of length 2")
def tum_poses_without_unit_length(folder):
    (folder / "x.txt").write_text("1 0 0 0 0 0 0 2\n")
    return folder / "x.txt"


@case("trajectory of a camera (Open3D's log)", TRAJECTORY | {"times": "none"}, needs=AS_POSES)
def open3d_log(folder):
    with open(folder / "rgb.txt", "w") as file:
        for k, T in enumerate(POSES):
            file.write(f"{k} {k} {k + 1}\n" + "\n".join(" ".join(map(str, row)) for row in T) + "\n")
    return folder / "rgb.txt"


@case("trajectory of a camera (KITTI)", TRAJECTORY | {"times": "none"}, needs=AS_POSES)  # fmt: skip
def kitti_poses(folder):
    np.savetxt(folder / "rgb.txt", POSES[:, :3].reshape(4, 12))
    return folder / "rgb.txt"


@case("trajectory of a camera (EuRoC)", TRAJECTORY | {"times": "20 per second"}, needs=AS_POSES)
def euroc_poses(folder):
    header = "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []"
    lines = [f"{1403636580838555648 + k * 50_000_000},{k / 10},0,0,1,0,0,0" for k in range(4)]
    (folder / "x.csv").write_text("\n".join([header, *lines]) + "\n")
    return folder / "x.csv"


@case(
    "joint angles of the robot",
    {"poses": "4, camera to the robot's world", "times": "10 per second"},
    needs=AS_POSES,
)
def joints(folder):
    table = pd.DataFrame(0.0, range(4), ["t_s", *(f"{joint}_deg" for joint in HEAD_JOINTS)])
    table.assign(t_s=np.arange(4) / 10).to_csv(folder / "clicks.csv", index=False)
    return folder / "clicks.csv"


@case("clicks on markers", {"clicks": "3 on 2 markers in 2 frames", "units": "pixels"},
      needs={"the registration": "motion capture"})  # fmt: skip
def clicks(folder):
    (folder / "joints.csv").write_text("frame,marker,u_px,v_px\n0,a,1,2\n0,b,3.5,4\n1,a,5,6\n")
    return folder / "joints.csv"


POINTS_M = np.arange(30.0).reshape(5, 2, 3) / 10 + 0.1
MOCAP = {"markers": "2: elbow, wrist", "frames": "5; markers seen in 100.0 %",
         "units": "metres once read; extent 2.700, 2.700, 2.700", "times": "100 Hz stated; 100 per second"}  # fmt: skip


def capture(names=("elbow", "wrist")) -> MotionCapture:
    return MotionCapture(np.arange(5) / 100, names, POINTS_M, 100.0)


@case("motion capture, Qualisys TSV", MOCAP, needs=AGAINST, notes=["ends in .tsv"])
def qualisys(folder):
    write_tsv(folder / "a.tsv", capture())
    return (folder / "a.tsv").rename(folder / "groundtruth.txt")


@case("motion capture, Qualisys TSV", problem="FREQUENCY is 'absent'")
def qualisys_without_rate(folder):
    write_tsv(folder / "mocap.tsv", capture())
    text = (folder / "mocap.tsv").read_text()
    (folder / "mocap.tsv").write_text("\n".join(x for x in text.split("\n") if "FREQUENCY\t100" not in x))
    return folder / "mocap.tsv"


@case("motion capture, C3D", MOCAP, needs=AGAINST)
def c3d(folder):
    write_c3d(folder / "mocap.c3d", capture())
    return folder / "mocap.c3d"


@case("motion capture, C3D", MOCAP | {"markers": "2: élbow, wrist"}, needs=AGAINST, notes=["ends in .c3d"])
def c3d_in_latin_1(folder):
    write_c3d(folder / "mocap.c3d", capture(("Xlbow", "wrist")))
    content = (folder / "mocap.c3d").read_bytes().replace(b"Xlbow", "élbow".encode("latin-1"))
    (folder / "picture.png").write_bytes(content)
    return folder / "picture.png"


@case("motion capture, C3D", problem="ezc3d cannot read it")
def c3d_cut_off(folder):
    write_c3d(folder / "mocap.c3d", capture())
    content = (folder / "mocap.c3d").read_bytes()
    (folder / "mocap.c3d").write_bytes(content[:600])
    return folder / "mocap.c3d"


BAG = {"colour": "4 on /camera/color/image_raw, about 13", "depth unit": "1000 per metre", "messages": "on 4 topics",
       "poses": "none"}  # fmt: skip
OF_BAG = {"hicp record import": "--bag; --poses, unless"}


@case("bag of ROS 1", BAG, needs=OF_BAG, notes=["ends in .bag"])
def ros1_bag(folder):
    return write_bag(folder, "ros1").rename(folder / "recording.mcap")


@case("bag of ROS 2", BAG, needs=OF_BAG)
def ros2_folder(folder):
    return write_bag(folder, "mcap")


@case("bag of ROS 2 (SQLite)", BAG, needs=OF_BAG, notes=["ends in .db3"])
def ros2_sqlite(folder):
    (path,) = write_bag(folder, "sqlite3").glob("*.db3")
    return path.rename(folder / "x.bag")


@case("bag of ROS 2 (MCAP)", BAG, needs=OF_BAG)
def ros2_mcap(folder):
    (path,) = write_bag(folder, "mcap").glob("*.mcap")
    return path


@case("bag of ROS 2", needs=OF_BAG, notes=["distortion undone"])
def ros2_distorted(folder):
    return write_bag(folder, info={"frame": "color_optical", "D": [0.1, 0, 0, 0, 0]})


@case("bag of ROS 1", problem="expected a bag of ROS")
def ros1_cut_off(folder):
    content = write_bag(folder, "ros1").read_bytes()
    (folder / "x.bag").write_bytes(content[:300])
    return folder / "x.bag"


LIFT = {"hicp lift": "--detector", "errors against motion capture": "mocap.tsv or mocap.c3d in it"}


@case("recording of an RGB-D camera", needs=LIFT, says={
      "frames": "4 of 32 x 24 pixels", "depth": "1000 units per metre", "times": "10 per second",
      "poses": "moved by 0.030,", "motion capture": "none"})  # fmt: skip
def recording(folder):
    return write_small(folder / "bag")


@case("recording of an RGB-D camera", needs=LIFT | {"errors against motion capture": ""},
      says={"motion capture": "mocap.c3d"}, notes=["lasts 0.04 s", "does not overlap"])  # fmt: skip
def recording_with_mocap(folder):
    write_c3d(write_small(folder / "r") / "mocap.c3d", capture())
    return folder / "r"


@case("recording of an RGB-D camera", problem="is not there; 1 of 4 listed are not")
def recording_without_an_image(folder):
    next(iter(sorted((write_small(folder / "r") / "rgb").iterdir()))).unlink()
    return folder / "r"


def open3d(folder: Path, name: str, content: dict) -> Path:
    for k in range(3):
        for kind in ("color", "depth"):
            (folder / kind).mkdir(exist_ok=True)
            cv2.imwrite(str(folder / kind / f"{k:05d}.png"), np.full((48, 64), 900, np.uint16))
    dump(folder / name, content)
    return folder


@case("RGB-D folder of Open3D's tools", CAMERA_SAYS | {
      "images": "3 in each", "times": "20.0 per second, as intrinsic.json says"},
      needs={"hicp record import": "--open3d --poses"})  # fmt: skip
def open3d_folder(folder):
    return open3d(folder, "intrinsic.json", INTRINSIC | {"fps": 20.0, "depth_scale": 1000})


@case("RGB-D folder of Open3D's tools", {"times": "not known"},
      needs={"hicp record import": "--open3d --rate --depth-scale --poses"})  # fmt: skip
def open3d_python_folder(folder):
    return open3d(folder, "camera_intrinsic.json", INTRINSIC)


@case("RGB-D folder of Open3D's tools", problem="3 and 2 images; expected as many")
def open3d_folder_of_unequal_numbers(folder):
    open3d(folder, "intrinsic.json", INTRINSIC)
    (folder / "depth/00001.png").unlink()
    return folder


# Pictures, networks, sets

DETECT = {"hicp detect": "--images"}
NOISE = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8)


@case("image", {"size": "64 x 48 pixels, RGB"}, needs=DETECT)
def png(folder):
    Image.fromarray(NOISE).save(folder / "mocap.tsv", format="PNG")
    return folder / "mocap.tsv"


def flagged(path: Path, flag: int) -> Path:
    exif = Image.Exif()
    exif[0x0112] = flag
    Image.fromarray(NOISE).save(path, format="JPEG", exif=exif)
    return path


def flag_case(flag: int) -> None:
    def make(folder: Path) -> Path:
        return flagged(folder / "x.png", flag)

    make.__name__ = f"jpeg_of_flag_{flag}"
    notes = [f"rotation flag {flag} (EXIF)"] if flag > 1 else []
    case("image", {"size": "64 x 48 pixels"}, notes=notes, needs=DETECT)(make)


for _flag in range(1, 9):
    flag_case(_flag)


@case("image", problem="truncated")
def jpeg_cut_off(folder):
    content = flagged(folder / "x.jpg", 1).read_bytes()
    (folder / "x.jpg").write_bytes(content[: len(content) // 2])
    return folder / "x.jpg"


@case("image", problem="truncated")
def png_cut_off(folder):
    path = png(folder)
    path.write_bytes(path.read_bytes()[:2000])
    return path


@case("depth image", {"size": "64 x 48 pixels", "depth": "16 bits, raw units; 50 % measured, median 900"},
      needs={"hicp record import": "--depth-scale"})  # fmt: skip
def depth_png(folder):
    depth = np.full((48, 64), 900, np.uint16)
    depth[:24] = 0
    cv2.imwrite(str(folder / "x.png"), depth)
    return (folder / "x.png").rename(folder / "x.jpg")


def video_case(suffix: str) -> None:
    def make(folder: Path) -> Path:
        write_video(folder / f"x{suffix}")
        return (folder / f"x{suffix}").rename(folder / "x.bag")

    make.__name__ = f"video{suffix.replace('.', '_')}"
    says = {"size": "64 x 48 pixels", "frames": "6, as", "times": "12.5 per second"}
    case("video", says, needs={"hicp detect": "--images, this file"})(make)


for _suffix in (".avi", ".mp4", ".mov"):
    video_case(_suffix)


@case("ONNX network", {"kinds of operators": "3", "author": "nobody"}, needs={"hicp detect": "as --model"})
def onnx(folder):
    path = constant_model(folder / "x.png", (1, 3, 8, 8), {"answer": np.zeros((1, 2), np.float32)})
    return told(path, author="nobody")


@case("ONNX network", problem="is cut off")
def onnx_cut_off(folder):
    path = onnx(folder)
    path.write_bytes(path.read_bytes()[:-20])
    return path


def archive(path: Path, *members: str) -> Path:
    with zipfile.ZipFile(path, "w") as written:
        for member in members:
            written.writestr(member, b"TFL3")
    return path


@case(
    "MediaPipe task bundle",
    {"task": "pose"},
    needs={"hicp detect": "mediapipe-pose, this file"},
)
def pose_task(folder):
    return archive(folder / "x.zip", "pose_detector.tflite", "pose_landmarks_detector.tflite")


@case(
    "MediaPipe task bundle",
    {"task": "hand"},
    needs={"hicp detect": "mediapipe-hands, this file"},
)
def hand_task(folder):
    return archive(folder / "x.onnx", "hand_detector.tflite", "hand_landmarks_detector.tflite")


@case("zip archive", problem="of no kind that is known; it holds a.txt")
def another_archive(folder):
    return archive(folder / "x.task", "a.txt")


@case("folder of images", {"images": "3; pixels: 64 x 48 (2)"}, notes=["1 images have a rotation flag", "1 images cannot"],
      needs={"hicp detect": "this folder", "hicp dataset create": "--annotations"})  # fmt: skip
def image_folder(folder):
    flagged(folder / "a.jpg", 6)
    flagged(folder / "b.JPG", 1)
    (folder / "c.png").write_bytes(b"no picture")
    return folder


def dataset(folder: Path) -> Path:
    (folder / "images").mkdir(parents=True)
    flagged(folder / "images/0.jpg", 1)
    annotated(folder, "halpe136").rename(folder / "annotations.json")
    return folder


OF_SET = {"hicp detect": "--dataset, this folder", "hicp evaluate": "--detections"}


@case(
    "data set: images and annotations",
    ALL | {"people": "2 in 2 images", "images": "1; pixels: 64 x 48 (1)"},
    needs=OF_SET,
)
def dataset_folder(folder):
    return dataset(folder / "rgb")


@case("HiCP crops: Basic and Headless", {
      "basic": "2 in 2 images", "headless": "2 in 2 images", "layout": "halpe136"},
      needs={"hicp detect": "--dataset, one of them"})  # fmt: skip
def hicp_folder(folder):
    dataset(folder / "basic")
    dataset(folder / "headless")
    return folder
