"""Keypoint R-CNN exports: both programs' outputs, score scales and half pixels."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from onnx import TensorProto, helper

from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import COCO_17
from hicp_lib.detectors.onnx.keypoint_rcnn import KeypointRcnn, logistic_score
from tests.detectors.onnx.onnx_models import constant_model, save

RNG = np.random.default_rng(0)
POINTS = RNG.uniform(5, 70, (2, 17, 2)).astype(np.float32)
BOXES = np.array([[5, 5, 70, 70], [2.5, 3.25, 60.5, 71]], np.float32)
SCORES = np.array([0.9, 0.6], np.float32)
CLASSES = np.zeros(2, np.int64)
IMAGE = np.zeros((60, 120, 3), np.uint8)  # into 80 high x 100 wide: 100 x 50, scale 100/120 and 50/60
SCALE = np.array([100 / 120, 50 / 60])


def detectron2(path, masses, input_shape=(3, 80, 100), **more):
    points = np.concatenate([POINTS, masses[..., None]], axis=2).astype(np.float32)
    outputs = {"boxes": BOXES, "classes": CLASSES, "maps": np.zeros((2, 17, 56, 56), np.float32),
               "points": points, "scores": SCORES, "size": np.array([80, 100])}  # fmt: skip
    return constant_model(path, input_shape, outputs | more)


def torchvision(path, logits, input_shape=(3, 80, 100)):
    points = np.concatenate([POINTS, np.ones((2, 17, 1))], axis=2).astype(np.float32)
    outputs = {"boxes": BOXES, "labels": CLASSES + 1, "scores": SCORES, "points": points,
               "points_scores": logits.astype(np.float32)}  # fmt: skip
    return constant_model(path, input_shape, outputs)


def test_detectron2_loses_half_a_pixel_and_keeps_its_masses(tmp_path):
    masses = RNG.uniform(0.01, 1.3, (2, 17))
    detector = KeypointRcnn(detectron2(tmp_path / "m.onnx", masses))
    found = detector.detect(IMAGE)
    assert detector.settings["family"] == "detectron2"
    np.testing.assert_allclose(found.keypoints_px[:, COCO_17], POINTS / SCALE - 0.5, atol=1e-3)
    np.testing.assert_allclose(found.scores[:, COCO_17], np.minimum(masses, 1), rtol=1e-6)
    np.testing.assert_allclose(found.person_scores, SCORES)
    assert np.isnan(found.keypoints_px[:, 17:]).all()


def test_torchvision_logits_become_scores_in_order_with_two_in_the_middle(tmp_path):
    logits = RNG.normal(2, 6, (2, 17))
    logits[0, 0] = 2.0
    detector = KeypointRcnn(torchvision(tmp_path / "m.onnx", logits))
    found = detector.detect(IMAGE)
    assert detector.settings["family"] == "torchvision"
    np.testing.assert_allclose(found.keypoints_px[:, COCO_17], POINTS / SCALE, atol=1e-3)
    scores = found.scores[:, COCO_17]
    assert ((0 < scores) & (scores < 1)).all() and abs(scores[0, 0] - 0.5) < 1e-6
    np.testing.assert_array_equal(np.argsort(scores.ravel()), np.argsort(logits.astype(np.float32).ravel()))


@given(st.floats(-60, 60))
def test_the_logit_can_be_told_from_the_score(logit):
    score = float(logistic_score(np.array(logit)))
    assert 0 <= score <= 1
    if 1e-9 < score < 1 - 1e-9:
        assert abs(2 + np.log(score / (1 - score)) - logit) < 1e-4


def test_maps_alone_are_decoded(tmp_path):
    """An export that stops before the fragile last step: boxes, scores and maps."""
    y, x = np.mgrid[:56, :56]
    maps = np.tile(9 - 0.5 * ((x - 14.0) ** 2 + (y - 28) ** 2), (2, 17, 1, 1)).astype(np.float32)
    outputs = {"boxes": BOXES, "scores": SCORES, "maps": maps}
    found = KeypointRcnn(constant_model(tmp_path / "m.onnx", (3, 80, 100), outputs)).detect(IMAGE)
    corner, size = BOXES[:, :2], BOXES[:, 2:] - BOXES[:, :2]
    truth = (corner + np.array([14.5, 28.5]) / 56 * size) / SCALE - 0.5
    assert np.abs(found.keypoints_px[:, COCO_17] - truth[:, None]).max() < 1
    # The peak's part of a Gaussian of variance 1.
    np.testing.assert_allclose(found.scores[:, COCO_17], 1 / (2 * np.pi), rtol=0.1)


def test_weak_boxes_are_left_out(tmp_path):
    model = detectron2(tmp_path / "m.onnx", np.full((2, 17), 0.5))
    assert len(KeypointRcnn(model, min_score=0.7).detect(IMAGE)) == 1
    assert len(KeypointRcnn(model, min_score=0.95).detect(IMAGE)) == 0
    assert len(KeypointRcnn(model, min_score=float(SCORES[1])).detect(IMAGE)) == 2
    weak = detectron2(
        tmp_path / "weak.onnx", np.full((2, 17), 0.5), scores=np.array([0.051, 0.049], np.float32)
    )
    assert len(KeypointRcnn(weak).detect(IMAGE)) == 1


def colour_echo(path, rank):
    """Keypoint scores (third column) are the means of the input's channels 0, 1, 2, 0, ..."""
    make = helper.make_node
    axes = [1, 2] if rank == 3 else [0, 2, 3]
    nodes = [
        make("ReduceMean", ["image"], ["means"], axes=axes, keepdims=0),
        make("Gather", ["means", "which"], ["column"]),
        make("Reshape", ["column", "shape"], ["masses"]),
        make("Concat", ["positions", "masses"], ["points"], axis=2),
        make("Identity", ["box"], ["boxes"]),
        make("Identity", ["one"], ["scores"]),
    ]
    constants = {
        "which": np.arange(17) % 3, "shape": np.array([1, 17, 1]),
        "positions": np.ones((1, 17, 2), np.float32),
        "box": np.array([[0, 0, 9, 9]], np.float32), "one": np.ones(1, np.float32),
    }  # fmt: skip
    shape = [3, None, None] if rank == 3 else [1, 3, None, None]
    outputs = {"points": [None, 17, 3], "boxes": [None, 4], "scores": [None]}
    return save(path, nodes, {"image": shape}, outputs, constants, dtype=TensorProto.FLOAT)


@pytest.mark.parametrize("rank", [3, 4])
def test_detectron2_sees_bgr(tmp_path, rank):
    image = np.zeros((600, 900, 3), np.uint8)
    image[:, :, 0] = 1  # red only: the third channel of BGR
    found = KeypointRcnn(colour_echo(tmp_path / "m.onnx", rank)).detect(image)
    np.testing.assert_allclose(found.scores[0, :3], [0, 0, 1], atol=1e-6)


@pytest.mark.parametrize(
    ("shape", "expected"), [((600, 900), (800, 1200)), ((500, 2000), (333, 1333)), ((90, 60), (1200, 800))]
)
def test_an_open_input_gets_detectron2s_size(tmp_path, shape, expected):
    detector = KeypointRcnn(colour_echo(tmp_path / "m.onnx", 3))
    fitted = detector._fit(np.zeros((*shape, 3), np.uint8))
    assert fitted.pixels.shape[:2] == expected
    np.testing.assert_allclose(fitted.scale, np.array(expected[::-1]) / shape[::-1])


def test_a_torchvision_open_input_gets_the_image_as_it_is(tmp_path):
    logits = np.zeros((2, 17))
    detector = KeypointRcnn(torchvision(tmp_path / "m.onnx", logits, input_shape=(3, None, None)))
    image = np.zeros((40, 30, 3), np.uint8)
    assert detector._fit(image).pixels is image
    assert detector._feed(np.full((4, 4, 3), 255, np.uint8)).max() == 1


def test_a_network_without_the_familys_outputs_is_refused_before_it_runs(tmp_path):
    with pytest.raises(InputError, match="keypoint scores") as caught:
        KeypointRcnn(colour_echo(tmp_path / "m.onnx", 3), family="torchvision")
    assert "image (3, ?, ?) tensor(float) and gives points (1, 17, 3)" in str(caught.value)
    with pytest.raises(InputError, match="one-stage"):
        KeypointRcnn(constant_model(tmp_path / "n.onnx", (3, 8, 8), {"out": np.zeros((2, 5), np.float32)}))


@given(data=st.data())
@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_outputs_of_any_shape_are_used_or_refused_in_one_line(data, tmp_path):
    rows = st.sampled_from([0, 1, 2, 3])
    tails = st.sampled_from([(), (4,), (17,), (17, 3), (17, 2), (17, 5, 6), (3,)])
    fill = data.draw(st.sampled_from([0.0, 1.0, -1.0, 30.0, np.nan, np.inf]))
    shapes = data.draw(st.lists(st.tuples(rows, tails), min_size=1, max_size=6))
    outputs = {f"o{i}": np.full((n, *tail), fill, np.float32) for i, (n, tail) in enumerate(shapes)}
    model = constant_model(tmp_path / "fuzz.onnx", (3, 80, 100), outputs)
    family = data.draw(st.sampled_from([None, "detectron2", "torchvision"]))
    try:
        found = KeypointRcnn(model, family).detect(IMAGE)
    except InputError as error:
        assert str(model) in str(error) and "\n" not in str(error)
    else:
        np.testing.assert_array_equal(found.scores > 0, np.isfinite(found.keypoints_px).all(axis=-1))


def test_everything_assumed_is_told(tmp_path):
    for model, family in [
        (detectron2(tmp_path / "d.onnx", np.ones((2, 17))), "detectron2"),
        (torchvision(tmp_path / "t.onnx", np.ones((2, 17))), "torchvision"),
    ]:
        facts = {fact.what: fact.value for fact in KeypointRcnn(model).describe()}
        assert facts["family"] == family and facts["input"] == "100 wide, 80 high"
        assert ("softmax" in facts["keypoint score"]) == (family == "detectron2")
    with pytest.raises(InputError, match="expected one of: detectron2, torchvision"):
        KeypointRcnn(model, family="caffe")


@pytest.mark.parametrize(
    ("shape", "size"),
    [((600, 800), (800, 1067)), ((300, 1000), (400, 1333)), ((1600, 1600), (800, 800))],
)
def test_detectron2_sees_the_short_side_at_800_and_the_long_one_up_to_1333(tmp_path, shape, size):
    detector = KeypointRcnn(colour_echo(tmp_path / "m.onnx", 3))
    fitted = detector._fit(np.zeros((*shape, 3), np.uint8))
    assert fitted.pixels.shape[:2] == size
    np.testing.assert_allclose(fitted.scale, (size[1] / shape[1], size[0] / shape[0]))
