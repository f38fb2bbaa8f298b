"""A folder of small good inputs of every kind, which each hostile one is a change of."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from hicp_lib.core.keypoints import NAMES
from hicp_lib.recordings.qualisys import MotionCapture, write_tsv
from tests.core.test_video import write_video
from tests.detectors.onnx.onnx_models import colour_maps_model
from tests.recordings.c3d_files import make_c3d
from tests.recordings.conftest import write_small
from tests.recordings.ros_bags import write_bag

# Commands without their outputs.
IMPORT = "import --format coco --predictions results.json --annotations annotations.json"
EVALUATE = "evaluate --annotations annotations.json --detections results.json"
FIT = "calibration fit --annotations annotations.json --detections results.json"
APPLY = "calibration apply --calibrations calibrations.csv --detections results.json"
DETECT = "detect --detector movenet-lightning --images pictures"
MMPOSE = "detect --detector mmpose --model model.onnx --images pictures"
CREATE = "dataset create --annotations annotations.json --images pictures"
DRAW = "draw --annotations annotations.json --detections results.json --images pictures"
LIFT = "lift --recording rec --detector movenet-lightning"
IMPORT_OPEN3D = "record import out --open3d open3d"

WIDTH, HEIGHT = 320, 400
INTRINSIC = {"width": 64, "height": 48, "intrinsic_matrix": [60, 0, 0, 0, 61, 0, 31.5, 23.5, 1]}
# How each file is read by some command; {} is where the file lies.
PICTURES = ("a.png", "b.jpg", "c.png")


def picture(seed: int) -> np.ndarray:
    """A smooth picture, so that files are small."""
    noise = np.random.default_rng(seed).integers(0, 255, (10, 8, 3), np.uint8)
    return cv2.resize(noise, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC)


def write_c3d(path: Path, seen: MotionCapture) -> None:
    """A C3D file of motion capture."""
    path.write_bytes(make_c3d(1000 * seen.points_m, tuple(name.encode() for name in seen.names)))


def annotations() -> dict:
    """A person in each picture, all 136 keypoints labelled."""
    points = np.stack([60 + np.arange(136.0), 60 + 2 * np.arange(136.0), np.full(136, 2.0)], axis=1)
    person = {"category_id": 1, "iscrowd": 0, "bbox": [40, 30, 240, 340], "area": 60000}
    person["keypoints"] = points.ravel().tolist()
    images = [
        {"id": i, "file_name": name, "width": WIDTH, "height": HEIGHT} for i, name in enumerate(PICTURES, 1)
    ]
    people = [person | {"id": 10 + image["id"], "image_id": image["id"]} for image in images]
    categories = [{"id": 1, "name": "person", "keypoints": list(NAMES)}]
    return {"images": images, "annotations": people, "categories": categories}


def results() -> list[dict]:
    """COCO results that find everybody."""
    people = annotations()["annotations"]
    kept = [{key: person[key] for key in ("image_id", "category_id", "keypoints")} for person in people]
    for person in kept:
        person["keypoints"][2::3] = [0.9] * 136
    return [person | {"score": 0.9} for person in kept]


def make_good(folder: Path) -> Path:
    """Write all of it."""
    (folder / "pictures").mkdir(parents=True)
    for seed, name in enumerate(PICTURES):
        cv2.imwrite(str(folder / "pictures" / name), picture(seed))
    (folder / "annotations.json").write_text(json.dumps(annotations()))
    (folder / "results.json").write_text(json.dumps(results()))
    (folder / "map.json").write_text(json.dumps({NAMES[1]: None}))
    _other_tools(folder)
    _recordings(folder)
    colour_maps_model(folder / "model.onnx", (192, 256), 133)
    write_video(folder / "clip.avi")
    curves = {"detector": "d", "group": "body", "score": [0.0, 1.0], "rate": [0.1, 0.9]}
    pd.DataFrame(curves).to_csv(folder / "calibrations.csv", index=False)
    return folder


def _other_tools(folder: Path) -> None:
    openpose = {"version": 1.3, "people": [{"pose_keypoints_2d": [100.0, 100, 0.9] * 25}]}
    (folder / "openpose").mkdir()
    (folder / "openpose" / "a_keypoints.json").write_text(json.dumps(openpose))
    alphapose = [{"image_id": "a.png", "category_id": 1, "keypoints": [100.0, 100, 0.9] * 136, "score": 2.0}]
    (folder / "alphapose.json").write_text(json.dumps(alphapose))
    person = {"keypoints": [[100.0, 100]] * 17, "keypoint_scores": [0.9] * 17, "bbox": [[40, 30, 280, 370]]}
    (folder / "mmpose").mkdir()
    (folder / "mmpose" / "a.json").write_text(json.dumps([person | {"bbox_score": 0.9}]))


def _recordings(folder: Path) -> None:
    write_small(folder / "rec")
    seen = MotionCapture(100 + np.arange(40) / 100, ("elbow", "wrist"), np.full((40, 2, 3), 0.5), 100.0)
    write_tsv(folder / "mocap.tsv", seen)
    write_c3d(folder / "mocap.c3d", seen)
    write_bag(folder, "ros1")
    for kind in ("mcap", "sqlite3"):
        write_bag(folder / kind, kind).rename(folder / f"{kind}.tmp")
        (folder / kind).rmdir()
        (folder / f"{kind}.tmp").rename(folder / kind)
    for kind in ("color", "depth"):
        (folder / "open3d" / kind).mkdir(parents=True)
        for k in range(3):
            pixels = np.full((48, 64), 900, np.uint16)
            pixels = pixels if kind == "depth" else cv2.cvtColor((pixels >> 2).astype(np.uint8), 8)
            cv2.imwrite(str(folder / "open3d" / kind / f"{k:05d}.png"), pixels)
    (folder / "open3d" / "intrinsic.json").write_text(
        json.dumps(INTRINSIC | {"fps": 20.0, "depth_scale": 1000})
    )
    (folder / "poses.txt").write_text("".join(f"{k} 0 0 0 0 0 0 1\n" for k in range(5)))


# Where each kind of file is read: the good command, and the file in it.
READERS: dict[str, tuple[str, str]] = {
    "pictures": (f"{DETECT} --out out.json", "pictures/b.jpg"),
    "detect folder": (f"{DETECT} --out out.json", "pictures"),
    "video": ("detect --detector movenet-lightning --images clip.avi --out out.json", "clip.avi"),
    "inspect video": ("inspect clip.avi", "clip.avi"),
    "detect dataset": (
        "detect --detector movenet-lightning --dataset set --out out.json",
        "set/annotations.json",
    ),
    "detect model": (
        f"{MMPOSE} --out out.json",
        "model.onnx",
    ),
    "detect person model": (
        f"{MMPOSE} --person-model person.onnx --out out.json",
        "person.onnx",
    ),
    "models show": ("models show --detector mmpose --model model.onnx", "model.onnx"),
    "task bundle": (
        "detect --detector mediapipe-pose -o model x.task --images pictures --out out.json",
        "x.task",
    ),
    "create annotations": (
        f"{CREATE} --out out",
        "annotations.json",
    ),
    "create picture": (
        f"{CREATE} --out out",
        "pictures/a.png",
    ),
    "keypoint map": (
        f"{CREATE} --keypoint-map map.json --out out",
        "map.json",
    ),
    "import openpose": (
        "import --format openpose --predictions openpose --annotations annotations.json --out out.json",
        "openpose/a_keypoints.json",
    ),
    "import alphapose": (
        "import --format alphapose --predictions alphapose.json --annotations annotations.json "
        "--out out.json",
        "alphapose.json",
    ),
    "import mmpose": (
        "import --format mmpose --predictions mmpose --annotations annotations.json --out out.json",
        "mmpose/a.json",
    ),
    "import coco": (
        f"{IMPORT} --out out.json",
        "results.json",
    ),
    "export": ("export --detections results.json --format coco --out out.json", "results.json"),
    "evaluate annotations": (
        f"{EVALUATE} --group body",
        "annotations.json",
    ),
    "evaluate detections": (
        f"{EVALUATE} --group body",
        "results.json",
    ),
    "draw detections": (
        f"{DRAW} --out out.html",
        "results.json",
    ),
    "draw picture": (
        f"{DRAW} --out out.html",
        "pictures/a.png",
    ),
    "calibration fit": (
        f"{FIT} --out out.csv",
        "annotations.json",
    ),
    "calibration apply": (
        f"{APPLY} --out out.json",
        "calibrations.csv",
    ),
    "import ros1": ("record import out --bag x.bag", "x.bag"),
    "import mcap": ("record import out --bag mcap", "mcap/x.mcap"),
    "import sqlite": ("record import out --bag sqlite3", "sqlite3/x.db3"),
    "import open3d": (IMPORT_OPEN3D, "open3d/intrinsic.json"),
    "import open3d picture": (IMPORT_OPEN3D, "open3d/depth/00001.png"),
    "import poses": (f"{IMPORT_OPEN3D} --poses poses.txt", "poses.txt"),
    "check camera": ("record check rec", "rec/camera.json"),
    "check list": ("record check rec", "rec/rgb.txt"),
    "check poses": ("record check rec", "rec/groundtruth.txt"),
    "check c3d": ("record check rec", "rec/mocap.c3d"),
    "check tsv": ("record check rec", "rec/mocap.tsv"),
    "lift camera": (
        f"{LIFT} --out out.parquet",
        "rec/camera.json",
    ),
    "lift depth": (
        f"{LIFT} --out out.parquet",
        "rec/depth/000001.png",
    ),
    "inspect tsv": ("inspect mocap.tsv", "mocap.tsv"),
    "inspect c3d": ("inspect mocap.c3d", "mocap.c3d"),
}
