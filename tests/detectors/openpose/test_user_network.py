"""OpenPose's networks with known answers: maps of people drawn, and hands at their arms."""

import numpy as np
import pytest
from onnx import helper

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import LEFT_HAND, RIGHT_HAND, TO_HALPE
from hicp_lib.detectors.openpose.hands import OpenPoseHands
from hicp_lib.detectors.openpose.networks import BODY_25, COCO_18, OpenPose
from hicp_lib.detectors.openpose.released import fit
from tests.detectors.onnx.onnx_models import constant_model, save
from tests.detectors.openpose.test_paf import STANDING, draw

IMAGE = np.zeros((184, 216, 3), np.uint8)  # half the size of the network's 368 x 432

# The person of 18 parts as 25: middle of the hips, and feet.
_FROM_18 = [0, 1, 2, 3, 4, 5, 6, 7, None, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17]
STANDING_25 = np.array(
    [STANDING[[8, 11]].mean(axis=0) if i is None else STANDING[i] for i in _FROM_18]
    + [(235, 338), (250, 332), (222, 334), (165, 338), (150, 332), (178, 334)]
)


def body_maps(part_model, person):
    n_fields = 2 * len(part_model.pairs)
    heat_maps, fields = draw([person], (46, 54), part_model, n_fields)
    background = 1 - heat_maps.max(axis=0, keepdims=True)
    return np.concatenate([heat_maps, background])[None].astype(np.float32), fields[None].astype(np.float32)


def body_model(path, part_model=COCO_18, person=STANDING):
    return constant_model(
        path, (1, 3, 368, 432), {"maps": np.concatenate(body_maps(part_model, person), axis=1)}
    )


@pytest.mark.parametrize(("part_model", "person"), [(COCO_18, STANDING), (BODY_25, STANDING_25)])
def test_a_drawn_person_is_found_where_it_stands(tmp_path, part_model, person):
    model = body_model(tmp_path / "m.onnx", part_model, person)
    found = OpenPose(model).detect(IMAGE)
    assert len(found) == 1
    truth = person * 183 / 367
    points = found.keypoints_px[0, TO_HALPE[part_model.convention]]
    assert np.abs(points - truth).max() < 0.75
    assert np.isfinite(found.keypoints_px[0]).all(axis=1).sum() == part_model.n_parts
    assert (found.scores[0, TO_HALPE[part_model.convention]] > 0.8).all()


def test_body_25_knows_its_limbs_by_name():
    parts = (
        "nose neck r_shoulder r_elbow r_wrist l_shoulder l_elbow l_wrist mid_hip r_hip r_knee r_ankle l_hip "
        "l_knee l_ankle r_eye l_eye r_ear l_ear l_big_toe l_small_toe l_heel r_big_toe r_small_toe r_heel"
    ).split()
    limbs = {(parts[a], parts[b]) for a, b in BODY_25.pairs}
    assert {("neck", "mid_hip"), ("mid_hip", "r_hip"), ("l_knee", "l_ankle")} <= limbs
    assert {("l_ankle", "l_big_toe"), ("l_big_toe", "l_small_toe"), ("l_ankle", "l_heel")} <= limbs
    assert {tuple(parts[i] for i in BODY_25.pairs[pair]) for pair in BODY_25.completing} == {
        ("r_shoulder", "r_ear"), ("l_shoulder", "l_ear"),
    }  # fmt: skip
    assert sorted(BODY_25.fields.ravel()) == list(range(52))
    assert {parts[i].split("_", 1)[1] for i in BODY_25.uncounted} == {"big_toe", "small_toe", "heel"}


def test_maps_and_fields_may_come_apart_and_in_any_order(tmp_path):
    heat_maps, fields = body_maps(COCO_18, STANDING)
    model = constant_model(tmp_path / "m.onnx", (1, 3, 368, 432), {"paf": fields, "heat": heat_maps})
    whole = OpenPose(body_model(tmp_path / "whole.onnx")).detect(IMAGE)
    np.testing.assert_array_equal(OpenPose(model).detect(IMAGE).keypoints_px, whole.keypoints_px)


def test_an_image_of_another_shape_is_padded_not_bent(tmp_path):
    """A tall image fills the height of 368; the same drawn person stands at another scale."""
    model = body_model(tmp_path / "m.onnx")
    tall = OpenPose(model).detect(np.zeros((736, 400, 3), np.uint8))
    points = tall.keypoints_px[0, TO_HALPE["openpose_coco18"]]
    assert np.abs(points - STANDING * 735 / 367).max() < 3
    wide = OpenPose(model).detect(np.zeros((100, 864, 3), np.uint8))
    points = wide.keypoints_px[0, TO_HALPE["openpose_coco18"]]
    assert np.abs(points - STANDING * 863 / 431).max() < 3


@pytest.mark.parametrize(
    ("image_size", "net_width"),
    [((640, 480), 496), ((640, 429), 544), ((1280, 425), 656), ((1280, 720), 656), ((429, 640), 240)],
)
def test_the_input_is_as_large_as_openposes(image_size, net_width):
    """Width in proportion, to a multiple of 16, at most 16 / 9 of 368; corner pixels' centres meet."""
    width, height = image_size
    image = np.zeros((height, width, 3), np.uint8)
    image[: height // 2, : width // 2] = 255
    fitted = fit(image, 368)
    assert fitted.pixels.shape == (368, net_width, 3)
    zoom = min((net_width - 1) / (width - 1), 367 / (height - 1))
    # The white quarter's border, half a pixel beyond its last pixel's centre.
    border = np.array([width // 2 - 0.5, height // 2 - 0.5]) * zoom
    for axis, line in enumerate((fitted.pixels[0, :, 0], fitted.pixels[:, 0, 0])):
        assert abs(np.flatnonzero(line > 127)[-1] + 0.5 - border[axis]) <= 1
    covered = [int(zoom * side + 0.5) for side in image_size]
    back = min((side - 1) / (n - 1) for side, n in zip(image_size, covered, strict=True))
    np.testing.assert_allclose(fitted.to_image_px(np.array([10.0, 20.0])), [10 * back, 20 * back])


def test_an_open_input_is_tried_before_an_image_is_shown(tmp_path):
    """A network of convolutions gives its maps for any size; one of another number of maps is refused."""
    for n_maps, match in ((57, None), (56, "57 .COCO. or 78 .BODY_25. maps of 46 x 46")):
        constants = {"weights": np.zeros((n_maps, 3, 8, 8), np.float32)}
        node = helper.make_node("Conv", ["image", "weights"], ["maps"], strides=[8, 8])
        shapes = {"image": [1, 3, None, None]}, {"maps": [1, n_maps, None, None]}
        model = save(tmp_path / f"{n_maps}.onnx", [node], *shapes, constants)
        if match is None:
            facts = {fact.what: fact.value for fact in OpenPose(model).describe()}
            assert facts["keypoints"] == "openpose_coco18" and len(OpenPose(model).detect(IMAGE)) == 0
        else:
            with pytest.raises(InputError, match=match):
                OpenPose(model)


def hand_colours(path):
    """A hand network whose point k is where channel k % 3 of BGR is highest, in cells of 8 x 8 pixels."""
    weights = np.zeros((22, 3, 8, 8), np.float32)
    for k in range(21):
        weights[k, k % 3] = 1 / 64
    node = helper.make_node("Conv", ["image", "weights", "bias"], ["maps"], strides=[8, 8])
    constants = {"weights": weights, "bias": np.full(22, 0.5, np.float32)}
    return save(path, [node], {"image": [1, 3, 368, 368]}, {"maps": [1, 22, 46, 46]}, constants)


def test_hands_are_found_at_their_arms_and_on_their_side(tmp_path):
    detector = OpenPose(body_model(tmp_path / "m.onnx"), hand_model=hand_colours(tmp_path / "hand.onnx"))
    body = (STANDING + 0.5) / 2 - 0.5
    image = np.zeros((184, 216, 3), np.uint8)
    v, u = np.mgrid[:184, :216]
    dots = {}
    for side, wrist, elbow in (("right", body[4], body[3]), ("left", body[7], body[6])):
        centre = wrist + 0.33 * (wrist - elbow)
        for channel, offset in enumerate([(-6.0, -3.0), (5.0, 4.0), (2.0, -7.0)]):
            dots[side, channel] = centre + offset
            dot = 250 * np.exp(-((u - dots[side, channel][0]) ** 2 + (v - dots[side, channel][1]) ** 2) / 18)
            image[..., channel] = np.maximum(image[..., channel], dot.astype(np.uint8))
    found = detector.detect(image)
    for side, indices in (("right", RIGHT_HAND), ("left", LEFT_HAND)):
        truth = np.array([dots[side, 2 - k % 3] for k in range(21)])  # the network sees BGR
        assert np.abs(found.keypoints_px[0, indices] - truth).max() < 1.0
        np.testing.assert_allclose(found.scores[0, indices], 250 / 256, atol=0.12)


def test_the_square_of_a_hand_follows_the_arm_and_a_part_of_an_arm_has_none(tmp_path, monkeypatch):
    hands, asked = OpenPoseHands(hand_colours(tmp_path / "hand.onnx")), []

    def find(image, corner_px, side_px, is_left):
        asked.append((corner_px, side_px, is_left))
        return np.full((21, 2), 7.0), np.full(21, 0.6)

    monkeypatch.setattr(hands, "find", find)
    points, scores = np.full((2, 136, 2), np.nan), np.zeros((2, 136))
    points[:, [5, 7, 9]], scores[:, [5, 7, 9]] = [(0, 0), (100, 0), (100, 60)], 0.5
    scores[1, 9] = 0.02
    points[0, [8, 10]], scores[0, [8, 10]] = [(50, 50), (60, 90)], 0.5  # no right shoulder
    found = hands.complete(IMAGE, Detections(points, scores, np.ones(2)))
    ((corner, side, is_left),) = asked
    assert side == pytest.approx(1.5 * 90) and is_left  # 0.9 x upper arm is longer than the forearm
    np.testing.assert_allclose(corner + side / 2, (100, 60 + 0.33 * 60))
    assert (found.keypoints_px[0, LEFT_HAND] == 7).all() and (found.scores[0, LEFT_HAND] == 0.6).all()
    assert np.isnan(found.keypoints_px[0, RIGHT_HAND]).all() and np.isnan(found.keypoints_px[1, 94:]).all()


@pytest.mark.parametrize(
    "shape", [(1, 57, 46, 46), (1, 56, 46, 54), (57, 46, 54), (2, 57, 46, 54), (1, 0, 46, 54)]
)
def test_other_outputs_are_refused_in_one_line(tmp_path, shape):
    model = constant_model(tmp_path / "m.onnx", (1, 3, 368, 432), {"maps": np.zeros(shape, np.float32)})
    with pytest.raises(InputError) as caught:
        OpenPose(model)
    assert str(model) in str(caught.value) and "\n" not in str(caught.value)


def test_maps_that_are_no_numbers_are_refused(tmp_path):
    maps = np.full((1, 57, 46, 54), np.nan, np.float32)
    with pytest.raises(InputError, match="output maps is NaN in places"):
        OpenPose(constant_model(tmp_path / "m.onnx", (1, 3, 368, 432), {"maps": maps}))


@pytest.mark.parametrize("fill", [np.inf, -1.0, 1.0])
def test_maps_of_nonsense_are_nobody_or_finite(tmp_path, fill):
    maps = np.full((1, 57, 46, 54), fill, np.float32)
    found = OpenPose(constant_model(tmp_path / "m.onnx", (1, 3, 368, 432), {"maps": maps})).detect(IMAGE)
    assert np.isfinite(found.keypoints_px[found.scores > 0]).all() and np.isfinite(found.person_scores).all()


def test_everything_assumed_is_told(tmp_path):
    hand = hand_colours(tmp_path / "hand.onnx")
    detector = OpenPose(body_model(tmp_path / "m.onnx"), hand_model=hand)
    facts = {fact.what: fact.value for fact in detector.describe()}
    assert facts["input"] == "432 wide, 368 high" and facts["hands"] == "by the hand model"
    with pytest.raises(InputError, match="multiple of 16"):
        OpenPose(tmp_path / "m.onnx", net_height_px=100)
    with pytest.raises(InputError, match="expected squares"):
        OpenPose(tmp_path / "m.onnx", hand_model=tmp_path / "m.onnx")
    with pytest.raises(InputError, match="expected 57"):
        OpenPose(hand)
