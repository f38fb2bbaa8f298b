"""Pictures, videos, networks and sets of pictures; names mislead on purpose."""

from __future__ import annotations

import zipfile
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from tests.core.test_video import write_video
from tests.detectors.onnx.onnx_models import constant_model, told
from tests.inspection.cases import case
from tests.inspection.made_annotations import ALL, annotated

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


@case("folder of images", {"images": "3; pixels: 64 x 48 (2)"},
      notes=["1 images have a rotation flag", "1 images cannot", "1 others (.gif) passed over"],
      needs={"hicp detect": "this folder", "hicp dataset create": "--annotations"})  # fmt: skip
def image_folder(folder):
    flagged(folder / "a.jpg", 6)
    flagged(folder / "b.JPG", 1)
    (folder / "c.png").write_bytes(b"no picture")
    (folder / "d.gif").touch()
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
    notes=["1 images are not of the annotated size: "],
    needs=OF_SET,
)
def dataset_folder(folder):
    return dataset(folder / "rgb")


@case("HiCP crops: Basic and Headless", {
      "basic": "2 in 2 images", "headless": "2 in 2 images", "layout": "halpe136"},
      notes=["0.jpg: is 64x48 pixels, annotated as 640x480; expected the image"] * 2,
      needs={"hicp detect": "--dataset, one of them"})  # fmt: skip
def hicp_folder(folder):
    dataset(folder / "basic")
    dataset(folder / "headless")
    return folder
