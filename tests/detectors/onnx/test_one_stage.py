"""RTMO and YOLO-pose on networks with known answers, back in the image."""

import numpy as np
import pytest
from onnx import helper

from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import COCO_17, TO_HALPE
from hicp_lib.detectors.onnx.one_stage import OneStage
from tests.detectors.onnx.onnx_models import constant_model, save, told

IMAGE = np.zeros((120, 200, 3), np.uint8)  # into 64 x 64: 64 x 38 pixels, in the middle 13 lower
SCALE = np.array([64 / 200, 38 / 120])
BOXES = np.array([[10, 12, 40, 37], [11, 12, 40, 37], [30, 20, 60, 38]], float)
SCORES = np.array([0.8, 0.9, 0.3])


def points(k):
    rng = np.random.default_rng(k)
    return np.concatenate([rng.uniform(0, 38, (3, k, 2)), rng.uniform(0.1, 1, (3, k, 1))], axis=2)


def rtmo(path, keypoints):
    rows = np.concatenate([BOXES, SCORES[:, None]], axis=1)
    outputs = {"dets": rows[None].astype(np.float32), "keypoints": keypoints[None].astype(np.float32)}
    return constant_model(path, (1, 3, 64, 64), outputs)


def yolo(path, keypoints, *, suppressed):
    flat = keypoints.reshape(3, -1)
    if suppressed:
        rows = np.concatenate([BOXES, SCORES[:, None], np.zeros((3, 1)), flat], axis=1)
    else:
        centre, size = (BOXES[:, :2] + BOXES[:, 2:]) / 2, BOXES[:, 2:] - BOXES[:, :2]
        rows = np.concatenate([centre, size, SCORES[:, None], flat], axis=1).T
    return constant_model(path, (1, 3, 64, 64), {"output0": rows[None].astype(np.float32)})


@pytest.mark.parametrize("kind", ["rtmo", "yolo", "yolo, suppressed"])
def test_people_come_back_to_the_image_and_the_less_likely_copy_goes(tmp_path, kind):
    keypoints = points(17)
    if kind == "rtmo":
        model, corner_px = rtmo(tmp_path / "m.onnx", keypoints), (0, 0)
    else:
        model = yolo(tmp_path / "m.onnx", keypoints, suppressed="suppressed" in kind)
        corner_px = (0, 13)
    found = OneStage(model).detect(IMAGE)
    np.testing.assert_allclose(found.person_scores, [0.9, 0.3], rtol=1e-6)
    truth = (keypoints[[1, 2], :, :2] - corner_px) / SCALE
    np.testing.assert_allclose(found.keypoints_px[:, COCO_17], truth, atol=1e-3)
    np.testing.assert_allclose(found.scores[:, COCO_17], keypoints[[1, 2], :, 2], rtol=1e-6)
    assert len(OneStage(model, min_score=0.5).detect(IMAGE)) == 1
    assert len(OneStage(model, max_overlap=1.0).detect(IMAGE)) == 3


def test_crowdpose_has_head_top_and_neck(tmp_path):
    found = OneStage(rtmo(tmp_path / "m.onnx", points(14))).detect(IMAGE)
    assert np.isfinite(found.keypoints_px[0]).all(axis=1).nonzero()[0].tolist() == list(range(5, 19))
    np.testing.assert_allclose(
        found.keypoints_px[0, TO_HALPE["crowdpose14"]], points(14)[1, :, :2] / SCALE, atol=1e-3
    )


def test_rtmo_sees_bgr_0_to_255_and_yolo_pose_rgb_0_to_1(tmp_path):
    """The score of a network's only point is the first channel of its input's first pixel of the image."""
    image = np.full((64, 64, 3), (51, 20, 1), np.uint8)
    for name, seen in (("rtmo", 1.0), ("yolo", 0.2)):
        (found,) = OneStage(echo_model(tmp_path / f"{name}.onnx", name)).detect(image).scores
        np.testing.assert_allclose(found[COCO_17], seen, rtol=1e-6)


def echo_model(path, kind, size=(64, 64)):
    make = helper.make_node
    nodes = [
        make("Slice", ["image", "start", "stop"], ["pixel"]),
        make("Reshape", ["pixel", "one"], ["score"]),
        make("Expand", ["score", "shape"], ["scores"]),
    ]
    constants = {"start": np.zeros(4, np.int64), "stop": np.ones(4, np.int64)}
    if kind == "rtmo":
        constants |= {"one": np.ones(4, np.int64), "shape": np.array([1, 1, 17, 1])}
        constants |= {
            "xy": np.ones((1, 1, 17, 2), np.float32),
            "box": np.array([[[0, 0, 9, 9, 1]]], np.float32),
        }
        nodes += [make("Concat", ["xy", "scores"], ["points"], axis=3), make("Identity", ["box"], ["dets"])]
        outputs = {"dets": [1, 1, 5], "points": [1, 1, 17, 3]}
    else:
        constants |= {"one": np.ones(3, np.int64), "shape": np.array([17, 1, 1])}
        constants |= {"xy": np.ones((17, 2, 1), np.float32), "flat": np.array([1, 51, 1])}
        constants["box"] = np.array([4, 4, 8, 8, 1], np.float32).reshape(1, 5, 1)
        nodes += [
            make("Concat", ["xy", "scores"], ["triples"], axis=1),
            make("Reshape", ["triples", "flat"], ["row"]),
            make("Concat", ["box", "row"], ["o"], axis=1),
        ]
        outputs = {"o": [1, 56, 1]}
    return save(path, nodes, {"image": [1, 3, *size]}, outputs, constants)


@pytest.mark.parametrize("shape", [(1, 3, 5), (1, 84, 8), (2, 56, 9), (1, 57, 500), (56, 9), (1, 53, 4)])
def test_other_outputs_are_refused_in_one_line(tmp_path, shape):
    model = constant_model(tmp_path / "m.onnx", (1, 3, 64, 64), {"o": np.zeros(shape, np.float32)})
    with pytest.raises(InputError) as caught:
        OneStage(model)
    assert f"gives o {shape}" in str(caught.value) and "\n" not in str(caught.value)


def test_an_open_input_is_as_large_as_the_metadata_say(tmp_path):
    model = echo_model(tmp_path / "m.onnx", "yolo", size=(None, None))
    facts = [{fact.what: fact.value for fact in OneStage(model).describe()}]
    told(model, imgsz="[320, 256]")
    facts.append({fact.what: fact.value for fact in OneStage(model).describe()})
    assert [fact["input"] for fact in facts] == ["640 wide, 640 high", "256 wide, 320 high"]


def test_what_is_assumed_is_told(tmp_path):
    facts = {fact.what: fact.value for fact in OneStage(rtmo(tmp_path / "m.onnx", points(17))).describe()}
    assert (
        facts["family"] == "RTMO" and facts["keypoints"] == "coco17" and facts["input"] == "64 wide, 64 high"
    )
