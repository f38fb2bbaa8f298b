"""OpenPose on MobileNet-thin: real maps from real weights."""

import os
import shutil
import subprocess
import sys

import cv2
import numpy as np
import onnx
import pytest
from onnx.reference import ReferenceEvaluator
from packaging.version import Version

from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import COCO_17, INDEX
from hicp_lib.detectors.openpose import networks
from hicp_lib.detectors.registry import make_detector
from hicp_lib.detectors.weights import default
from tests.detectors.plain_people import errors_px, render_person


def test_rendered_people_are_found_to_a_few_pixels():
    errors = errors_px(make_detector("openpose-mobilenet"))
    assert np.isfinite(errors).mean() > 0.8
    assert np.nanmedian(errors) < 8
    shoulders = errors[:, [5, 6]]
    assert np.nanmax(shoulders) < 40, "left and right shoulder are 90 px apart"


def test_two_people_are_two_people():
    """Twice the same rendering, side by side."""
    image, truth_px = render_person(0)
    middle = image[:, 120:360]
    found = make_detector("openpose-mobilenet").detect(np.hstack([middle, middle]))
    nose_x = np.sort(found.keypoints_px[:, 0, 0])
    expected = truth_px[0, 0] - 120 + np.array([0, 240])
    assert len(found) == 2
    assert nose_x == pytest.approx(expected, abs=8)


def test_a_photograph(photograph):
    """A portrait, facing the camera: his left shoulder is on the right."""
    found = make_detector("openpose-mobilenet").detect(photograph)
    best = np.argmax(found.person_scores)
    nose, left_shoulder, right_shoulder = found.keypoints_px[best, [0, 5, 6]]
    assert np.linalg.norm(nose - (270, 225)) < 20
    assert left_shoulder[0] - right_shoulder[0] == pytest.approx(360, abs=50)


def test_it_gives_coco_points_and_the_neck_only(photograph):
    found = make_detector("openpose-mobilenet").detect(photograph)
    given = np.isfinite(found.keypoints_px).all(axis=-1)
    assert set(np.flatnonzero(given.any(axis=0))) <= {*COCO_17, INDEX["neck"]}
    assert np.array_equal(found.scores > 0, given)
    assert found.scores.max() <= 1 and found.person_scores.max() <= 1


def test_an_empty_image_has_nobody():
    found = make_detector("openpose-mobilenet").detect(np.full((90, 50, 3), 128, np.uint8))
    assert found.keypoints_px.shape == (0, 136, 2)
    assert found.scores.shape == (0, 136) and found.person_scores.shape == (0,)


def test_the_size_of_the_network_is_checked():
    with pytest.raises(InputError, match="multiple of 16"):
        make_detector("openpose-mobilenet", net_height_px=100)


def test_it_needs_no_download(tmp_path):
    program = "from hicp_lib.detectors.registry import make_detector; make_detector('openpose-mobilenet')"
    environment = os.environ | {"HICP_CACHE": str(tmp_path)}
    subprocess.run([sys.executable, "-c", program], env=environment, check=True)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(Version(onnx.__version__) < Version("1.23"), reason="its reference pads strides wrongly")
def test_its_maps_are_those_of_the_reference_implementation(photograph):
    """On a small part of the photograph: the reference is slow."""
    detector = networks.OpenPoseMobileNet(net_height_px=96)
    net_input = networks.scaled(photograph, 96)
    model = ReferenceEvaluator(onnx.load_from_string(default.load(f"{networks.OpenPoseMobileNet.name}.onnx")))
    blob = cv2.dnn.blobFromImage(net_input.pixels, swapRB=True)
    expected = model.run(None, {model.input_names[0]: blob})[0][0]
    assert expected.max() > 0.5
    np.testing.assert_allclose(detector.maps(net_input), expected, atol=1e-4)


@pytest.mark.parametrize("position", [0, 1000, -1])
def test_a_damaged_weight_is_refused(tmp_path, monkeypatch, position):
    path = tmp_path / "weights" / f"{networks.OpenPoseMobileNet.name}.onnx"
    path.parent.mkdir()
    content = bytearray(default.load(f"{networks.OpenPoseMobileNet.name}.onnx"))
    content[position] ^= 1
    path.write_bytes(content)
    shutil.copy(default.REGISTRY_PATH, tmp_path / "detectors.json")
    monkeypatch.setattr(default, "REGISTRY_PATH", tmp_path / "detectors.json")
    with pytest.raises(InputError, match=r"openpose-mobilenet\.onnx.*damaged.*: git restore data/weights"):
        make_detector("openpose-mobilenet")
    with pytest.raises(InputError, match="is corrupt; get it with: git restore"):
        default.fetch(["openpose-mobilenet"])
    path.unlink()
    with pytest.raises(InputError, match="cannot be read .*; get it with: git restore"):
        make_detector("openpose-mobilenet")
