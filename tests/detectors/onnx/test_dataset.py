"""A data set through `detect_dataset`: annotated boxes reach the network, and are part of what is kept."""

import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.core.images import write_png
from hicp_lib.core.keypoints import COCO_17, N_KEYPOINTS
from hicp_lib.detectors.runtime.run import detect_dataset, detect_images
from hicp_lib.formats.annotations import Annotations, ImageInfo, write_annotations
from tests.detectors.onnx.onnx_models import colour_maps_model
from tests.detectors.onnx.test_mmpose import dots

POSITIONS = [
    np.array([[60.0, 70.0], [75.5, 60.25], [66.0, 88.0]]),
    np.array([[100.0, 50], [120, 62], [118, 84]]),
]


def write_dataset(folder, boxes, crowd=(False, False, True)):
    for number, positions in enumerate(POSITIONS, start=1):
        write_png(folder / "images" / f"{number}.png", dots(positions))
    images = {number: ImageInfo(number, f"{number}.png", 200, 160) for number in (1, 2)}
    points = np.zeros((3, N_KEYPOINTS, 2))
    people = Annotations(
        images, np.arange(1, 4), np.array([1, 2, 2]), np.array(boxes, float), np.full(3, 1e4),
        np.array(crowd), points, np.full((3, N_KEYPOINTS), 2.0), [{}] * 3,
    )  # fmt: skip
    write_annotations(folder / "annotations.json", people)


@pytest.fixture
def model(tmp_path, monkeypatch):
    monkeypatch.setenv("HICP_CACHE", str(tmp_path / "cache"))
    return colour_maps_model(tmp_path / "m.onnx", (192, 256), 17)


def test_annotated_boxes_are_used_but_not_those_of_crowds(tmp_path, model):
    write_dataset(tmp_path, [[30, 40, 70, 80], [70, 30, 80, 80], [0, 0, 20, 20]])
    found = detect_dataset("mmpose", tmp_path, workers=2, model=model, boxes="gt")
    assert [len(people) for people in found.values()] == [1, 1]
    for number, positions in enumerate(POSITIONS, start=1):
        points = found[number].keypoints_px[0, COCO_17]
        assert np.abs(points - positions[np.arange(17) % 3]).max() < 0.5


def test_other_boxes_are_other_results_and_equal_ones_are_kept(tmp_path, model):
    kept = tmp_path / "cache" / "detections" / "mmpose"
    write_dataset(tmp_path, [[30, 40, 70, 80], [70, 30, 80, 80], [0, 0, 20, 20]])
    first = detect_dataset("mmpose", tmp_path, model=model, boxes="gt")
    again = detect_dataset("mmpose", tmp_path, model=model, boxes="gt")
    np.testing.assert_array_equal(first[1].keypoints_px, again[1].keypoints_px)
    assert len(list(kept.rglob("*.bin"))) == 2
    write_dataset(tmp_path, [[0, 0, 20, 20], [70, 30, 80, 80], [0, 0, 20, 20]])
    assert (
        np.abs(detect_dataset("mmpose", tmp_path, model=model, boxes="gt")[1].scores - first[1].scores).max()
        > 0.1
    )
    assert len(list(kept.rglob("*.bin"))) == 3


def test_images_without_annotations_have_no_annotated_boxes(tmp_path, model):
    write_png(tmp_path / "a.png", dots(POSITIONS[0]))
    with pytest.raises(InputError, match="need the annotated boxes"):
        detect_images("alphapose", {1: tmp_path / "a.png"}, model=model, boxes="gt")
    assert len(detect_images("alphapose", {1: tmp_path / "a.png"}, model=model)[1].detections) == 1
