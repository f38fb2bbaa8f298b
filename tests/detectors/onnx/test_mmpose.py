"""MMPose on networks with known answers: peaks through the whole path, from colours to image pixels."""

import numpy as np
import onnx
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from onnx import helper

from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import COCO_17, LEFT_HAND, RIGHT_HAND, TO_HALPE
from hicp_lib.detectors.onnx.mmpose import MMPose
from tests.detectors.onnx.onnx_models import (
    colour_maps_model,
    colour_simcc_model,
    constant_model,
    save,
    told,
)

SIZE = (48, 64)
BOXES = [(20.0, 30.0, 60.0, 80.0), (10.5, 7.25, 200.0, 33.0), (-20, -10, 70.5, 90), (150.5, 100, 49.5, 60.0)]


def dots(positions, size=(200, 160), sigma=6.0):
    """An image with one soft dot per channel: R, G, B at the three positions (u, v)."""
    v, u = np.mgrid[: size[1], : size[0]]
    planes = [250 * np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * sigma**2)) for x, y in positions]
    return np.stack(planes, axis=-1).astype(np.uint8)


def back_to_image(fraction, box, size=SIZE):
    """The documented way back: position / (W, H) * scale + centre - scale / 2."""
    x, y, w, h = box
    aspect = size[0] / size[1]
    scale = 1.25 * np.array((w, w / aspect) if w > aspect * h else (h * aspect, h))
    return np.asarray(fraction) * scale + (x + w / 2, y + h / 2) - scale / 2


def heat_maps(n_keypoints, cells, size, sigma=1.5):
    y, x = np.mgrid[: size[1], : size[0]]
    return np.stack(
        [np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * sigma**2)) for cx, cy in cells[:n_keypoints]]
    )[None].astype(np.float32)


@pytest.mark.parametrize("box", BOXES)
def test_constant_peaks_return_to_the_image_within_a_thousandth_of_a_pixel(tmp_path, box):
    rng = np.random.default_rng(0)
    cells = rng.integers((12, 12), (36, 52), (17, 2)) * 1.0
    model = constant_model(tmp_path / "m.onnx", (1, 3, 256, 192), {"maps": heat_maps(17, cells, (48, 64))})
    for dark in (True, False):
        found = MMPose(model, boxes="gt", dark=dark).detect(np.zeros((160, 200, 3), np.uint8), [box])
        truth = back_to_image(cells / (48, 64), box)
        np.testing.assert_allclose(found.keypoints_px[0, COCO_17], truth, atol=1e-3)
        np.testing.assert_allclose(found.scores[0, COCO_17], 1, atol=1e-6)


@pytest.mark.parametrize("box", BOXES)
def test_simcc_bins_return_to_the_image(tmp_path, box):
    rng = np.random.default_rng(1)
    x, y = rng.integers(0, 96, 133), rng.integers(0, 128, 133)  # borders and half pixels included
    outputs = {
        "simcc_x": np.eye(96, dtype=np.float32)[x][None],
        "simcc_y": 0.5 * np.eye(128, dtype=np.float32)[y][None],
    }
    for order in (list(outputs), list(outputs)[::-1]):
        model = constant_model(tmp_path / "m.onnx", (1, 3, 64, 48), {name: outputs[name] for name in order})
        found = MMPose(model, boxes="gt").detect(np.zeros((160, 200, 3), np.uint8), [box])
        truth = back_to_image(np.stack([x / 2 / 48, y / 2 / 64], axis=1), box)
        indices = TO_HALPE["wholebody133"]
        np.testing.assert_allclose(found.keypoints_px[0, indices], truth, atol=1e-3)
        np.testing.assert_allclose(found.scores[0, indices], 0.5)
        assert np.isnan(found.keypoints_px[0, 17:20]).all() and (found.scores[0, 17:20] == 0).all()


@pytest.mark.parametrize("batch", [1, None, 4])
@pytest.mark.parametrize("kind", ["maps", "simcc"])
def test_dots_of_an_image_are_found_where_they_are(tmp_path, kind, batch):
    """Crop, colours, network and decoding together: red, green and blue dots, three boxes, any batch."""
    positions = np.array([[60.0, 70.0], [75.5, 60.25], [66.0, 88.0]])
    image = dots(positions)
    build = colour_maps_model if kind == "maps" else colour_simcc_model
    model = build(tmp_path / "m.onnx", (96, 128), 17, batch=batch)
    boxes = [(30, 30, 80, 100), (40.5, 45, 60, 55), (20, 50, 85, 60)]
    found = MMPose(model, boxes="gt", flip_test=False).detect(image, boxes)
    # The three boxes show the same dots: one person remains of them.
    assert len(found) == 1
    assert np.abs(found.keypoints_px[0, COCO_17] - positions[np.arange(17) % 3]).max() < 1.0
    # The network undoes the documented normalisation; the score is the dot's colour.
    np.testing.assert_allclose(found.scores[0, COCO_17], 250 / 255, atol=0.1)


@pytest.mark.parametrize("box", BOXES[:2])
def test_dots_are_found_with_dark_to_a_tenth_of_a_pixel(tmp_path, box):
    positions = np.array([[60.0, 70.0], [68.5, 62.25], [66.0, 80.0]])
    model = colour_maps_model(tmp_path / "m.onnx", (192, 256), 17)
    found = MMPose(model, boxes="gt").detect(dots(positions, sigma=9.0), [(20.0, 30.0, 90.0, 80.0)])
    assert np.abs(found.keypoints_px[0, COCO_17] - positions[np.arange(17) % 3]).max() < 0.1


@pytest.mark.parametrize("kind", ["maps", "simcc"])
def test_flip_test_averages_the_mirrored_answer_on_the_right_side(tmp_path, kind):
    """Keypoints take their colour from their pair, so mirroring swaps nothing in the answer."""
    positions = np.array([[50.0, 70.0], [75.0, 60.0], [66.0, 88.0]])
    build = colour_maps_model if kind == "maps" else colour_simcc_model
    model = build(tmp_path / "m.onnx", (96, 128), 21, batch=None)
    plain = MMPose(model, boxes="image").detect(dots(positions))
    flipped = MMPose(model, boxes="image", flip_test=True).detect(dots(positions))
    assert np.abs(plain.keypoints_px - flipped.keypoints_px)[0, RIGHT_HAND].max() < 2.5
    sided = build(tmp_path / "sided.onnx", (96, 128), 17, batch=None)
    found = MMPose(sided, boxes="image", flip_test=True).detect(dots(positions))
    # Left and right eye (1, 2) look for green and blue: each now also answers to the other's colour.
    middle_scores = found.scores[0, [1, 2]]
    assert (middle_scores < MMPose(sided, boxes="image").detect(dots(positions)).scores[0, [1, 2]]).all()


def test_hand_networks_give_the_hand_they_are_shown(tmp_path):
    model = colour_maps_model(tmp_path / "m.onnx", (64, 64), 21)
    image = dots([[50.0, 70.0], [75.0, 60.0], [66.0, 88.0]])
    for hand, indices in (("left", LEFT_HAND), ("right", RIGHT_HAND)):
        found = MMPose(model, boxes="image", hand=hand).detect(image)
        assert np.isfinite(found.keypoints_px[0, indices]).all()
        assert np.isnan(np.delete(found.keypoints_px[0], indices, axis=0)).all()


@pytest.mark.parametrize("n_keypoints", [14, 17, 26, 133, 136])
def test_every_layout_lands_on_its_halpe_points(tmp_path, n_keypoints):
    x = np.arange(n_keypoints) % 90
    outputs = {name: np.eye(bins, dtype=np.float32)[x][None] for name, bins in (("x", 96), ("y", 128))}
    model = constant_model(tmp_path / "m.onnx", (1, 3, 64, 48), outputs)
    found = MMPose(model).detect(np.zeros((64, 48, 3), np.uint8))
    convention = {14: "crowdpose14", 17: "coco17", 26: "halpe26", 133: "wholebody133", 136: "halpe136"}[
        n_keypoints
    ]
    at = back_to_image(np.stack([x / 2 / 48, x / 2 / 64], axis=1), (0, 0, 48, 64))
    np.testing.assert_allclose(found.keypoints_px[0, TO_HALPE[convention]], at, atol=1e-3)
    assert np.isfinite(found.keypoints_px[0]).all(axis=1).sum() == n_keypoints


def test_scores_of_rtmw_are_scaled_to_one(tmp_path):
    image = dots([[50.0, 70.0], [75.0, 60.0], [66.0, 88.0]])
    plain = MMPose(colour_simcc_model(tmp_path / "rtmpose.onnx", SIZE, 17))
    rtmw = MMPose(colour_simcc_model(tmp_path / "rtmw.onnx", SIZE, 17, shuffles=True))
    given_scale = MMPose(tmp_path / "rtmpose.onnx", score_scale=5)
    assert (plain.settings["score_scale"], rtmw.settings["score_scale"]) == (1.0, 10.0)
    scores = [detector.detect(image).scores[0, COCO_17] for detector in (plain, given_scale, rtmw)]
    np.testing.assert_allclose(scores[1], scores[2] * 2, rtol=1e-6)
    assert all((score >= 0).all() and (score <= 1).all() for score in scores)
    # MMPose itself ranks people by the network's own scores, as predictions it wrote are imported.
    raw = plain.detect(image).scores[0, COCO_17]
    assert raw.max() < 1
    for detector in (plain, given_scale, rtmw):
        np.testing.assert_allclose(detector.detect(image).person_scores, raw[raw > 0.2].mean(), rtol=1e-6)


def test_person_boxes_detected_given_and_missing(tmp_path):
    pose = colour_maps_model(tmp_path / "m.onnx", SIZE, 17)
    rows = np.array([[[8, 8, 40, 48, 0.5]]], np.float32)
    person = constant_model(tmp_path / "p.onnx", (1, 3, 64, 64), {"dets": rows})
    image = dots([[50.0, 70.0], [75.0, 60.0], [66.0, 88.0]])
    detected = MMPose(pose, person_model=person)
    box = np.array([8, 8, 32, 40]) * np.tile([200 / 64, 160 / 51], 2)
    given_box = MMPose(pose, boxes="gt")
    assert given_box.takes_boxes and not detected.takes_boxes
    same, half = given_box.detect(image, [box]), detected.detect(image)
    np.testing.assert_allclose(half.keypoints_px, same.keypoints_px, atol=0.01)
    np.testing.assert_allclose(half.person_scores, same.person_scores / 2, rtol=0.02)
    assert len(given_box.detect(image, np.zeros((0, 4)))) == 0
    for options in (
        {"boxes": "gt"},
        {"boxes": "image", "person_min_score": 0.5},
        {"boxes": "detected", "person_family": "yolox"},
        {"boxes": "some"},
        {"boxes": "gt", "person_model": person},
    ):
        with pytest.raises(InputError, match="boxes"):
            MMPose(pose, **options).detect(image)


def test_everything_assumed_is_told(tmp_path):
    facts = {
        fact.what: fact.value
        for fact in MMPose(colour_simcc_model(tmp_path / "m.onnx", SIZE, 133)).describe()
    }
    assert facts["input"] == "48 wide, 64 high" and facts["keypoints"] == "wholebody133"
    assert facts["decoding"] == "SimCC" and facts["output"] == "96x128 bins" and facts["batch"] == "any"
    assert {
        "pixels",
        "crop",
        "flip test",
        "keypoint score",
        "person score",
        "boxes",
        "runs on",
    } <= facts.keys()


UDP_BOX = np.array([[100.0, 100.0, 240.0, 480.0]])
UDP_TRUTH = np.stack([np.linspace(110, 330, 17), np.linspace(120, 570, 17)], axis=1)


def udp_model(path, udp):
    """Heat maps as a network has for points of a person of 240 x 480 pixels, trained with UDP or without.

    The box, padded and grown to 3 : 4, is 450 x 600 around (220, 340); the input is 192 x 256, the maps
    are a quarter. With UDP all sizes are less one.
    """
    fraction = (UDP_TRUTH - (220 - 225, 340 - 300)) / (450, 600)
    cells = fraction * (np.array([48, 64]) - udp)
    return constant_model(path, (1, 3, 256, 192), {"maps": heat_maps(17, cells, (48, 64), sigma=2.0)})


@pytest.mark.parametrize("udp", [False, True])
def test_heat_maps_of_networks_trained_with_udp(tmp_path, udp):
    """0 px with the option that is right for the network, several with the other: up to 6.2 px."""
    image = np.zeros((700, 500, 3), np.uint8)
    model = udp_model(tmp_path / "m.onnx", udp)
    right, wrong = (MMPose(model, boxes="gt", udp=option) for option in (udp, not udp))
    error_px = np.abs(right.detect(image, UDP_BOX).keypoints_px[0, COCO_17] - UDP_TRUTH)
    assert error_px.max() < 0.05
    assert np.abs(wrong.detect(image, UDP_BOX).keypoints_px[0, COCO_17] - UDP_TRUTH).max() > 5


def test_udp_is_told_by_the_file_where_it_can_be_and_named_where_not(tmp_path):
    def transform(model, **options):
        (fact,) = (fact for fact in MMPose(model, **options).describe() if fact.what == "transform")
        return fact.value[:3], fact.why

    plain = udp_model(tmp_path / "plain.onnx", False)
    assert transform(plain) == ("cla", "ASSUMED, the file does not tell; -o udp true for networks named udp")
    assert transform(plain, udp=True) == ("UDP", "option udp")
    assert transform(told(udp_model(tmp_path / "a.onnx", True), udp="true")) == (
        "UDP",
        "from its metadata",
    )
    assert transform(tmp_path / "a.onnx", udp=False) == ("cla", "option udp")
    patches = patch_model(tmp_path / "vit.onnx")
    assert transform(patches)[0] == "UDP" and "patches of 16 pixels" in transform(patches)[1]
    simcc = colour_simcc_model(tmp_path / "simcc.onnx", SIZE, 17)
    assert transform(simcc) == ("cla", "from the outputs")
    for model, options in ((simcc, {"udp": True}), (plain, {"udp": True, "dark": False})):
        with pytest.raises(InputError, match="UDP is for heat maps decoded by DARK"):
            MMPose(model, **options)


def patch_model(path):
    """Begins as vision transformers do: one convolution over patches of 16 x 16 pixels."""
    nodes = [
        helper.make_node("Conv", ["image", "weights"], ["patches"], strides=[16, 16]),
        helper.make_node("Resize", ["patches", "", "fourfold"], ["maps"]),
    ]
    constants = {
        "weights": np.ones((17, 3, 16, 16), np.float32), "fourfold": np.array([1, 1, 4, 4], np.float32),
    }  # fmt: skip
    return save(path, nodes, {"image": [None, 3, 64, 48]}, {"maps": [None, 17, 16, 12]}, constants)


def test_the_flip_test_with_udp_does_not_shift(tmp_path):
    """Symmetric heat maps stay symmetric: the mirrored answer of UDP falls on the straight one."""
    cells = np.tile([23.5, 30.0], (17, 1))
    maps = heat_maps(17, cells, (48, 64))
    model = constant_model(tmp_path / "m.onnx", (None, 3, 256, 192), {"maps": maps}, open_batch=True)
    image = np.zeros((256, 192, 3), np.uint8)
    straight, flipped = (MMPose(model, udp=True, flip_test=on).detect(image) for on in (False, True))
    np.testing.assert_allclose(flipped.keypoints_px, straight.keypoints_px, atol=1e-3)


def test_rtmw3d_gives_x_and_y_and_the_lower_of_their_maxima(tmp_path):
    x, y = np.arange(133) % 96, np.arange(133) % 128
    plain = {
        "simcc_x": np.eye(96, dtype=np.float32)[x][None],
        "simcc_y": np.eye(128, dtype=np.float32)[y][None],
    }
    deep = plain | {"simcc_z": 0.1 * np.eye(96, dtype=np.float32)[x[::-1]][None]}
    found = [
        MMPose(constant_model(tmp_path / f"{len(outputs)}.onnx", (1, 3, 64, 48), outputs)).detect(
            np.zeros((64, 48, 3), np.uint8)
        )
        for outputs in (plain, deep)
    ]
    np.testing.assert_array_equal(found[0].keypoints_px, found[1].keypoints_px)
    np.testing.assert_array_equal(found[0].scores, found[1].scores)


def test_an_open_input_is_asked_for_or_told_by_metadata(tmp_path):
    model = colour_maps_model(tmp_path / "m.onnx", (None, None), 17)
    with pytest.raises(InputError, match="-o input_size_px"):
        MMPose(model)
    for wrong in ([], [96], [96, 0], ["96", 128], [96.0, 128.0]):
        with pytest.raises(InputError, match="expected width and height in pixels"):
            MMPose(model, input_size_px=wrong)
    image = dots([[50.0, 70.0], [75.0, 60.0], [66.0, 88.0]])
    fixed = MMPose(colour_maps_model(tmp_path / "fixed.onnx", (96, 128), 17)).detect(image)
    opened = MMPose(model, input_size_px=[96, 128])
    np.testing.assert_array_equal(opened.detect(image).keypoints_px, fixed.keypoints_px)
    assert opened.settings["input_size_px"] == (96, 128)
    proto = onnx.load(model)
    proto.graph.input[0].type.tensor_type.shape.dim[1].dim_param = "channels"
    onnx.save(proto, model)
    np.testing.assert_array_equal(
        MMPose(model, input_size_px=[96, 128]).detect(image).keypoints_px, fixed.keypoints_px
    )
    told(model, cigpose_meta='{"input_w": 96, "input_h": 128, "split_ratio": 2.0, "num_keypoints": 17}')
    np.testing.assert_array_equal(MMPose(model).detect(image).keypoints_px, fixed.keypoints_px)
    with pytest.raises(InputError, match=r"96 x 128 \(from its metadata\), not 192 x 256"):
        MMPose(model, input_size_px=[192, 256])
    with pytest.raises(InputError, match="not 192 x 256"):
        MMPose(tmp_path / "fixed.onnx", input_size_px=[192, 256])


def test_a_contract_that_the_network_does_not_keep_is_refused(tmp_path):
    model = colour_simcc_model(tmp_path / "m.onnx", SIZE, 133)
    assert MMPose(told(model, cigpose_meta='{"input_w": 48, "input_h": 64, "split_ratio": 2.0}'))
    told(model, cigpose_meta='{"input_w": 48, "input_h": 64, "split_ratio": 3.0}')
    with pytest.raises(InputError, match="3.0 bins per pixel"):
        MMPose(model)


@pytest.mark.parametrize(
    ("n_keypoints", "name"), [(106, "LaPa's face"), (16, "MPII's body"), (18, "18 keypoints")]
)
def test_sets_of_keypoints_without_a_place_are_refused_by_name(tmp_path, n_keypoints, name):
    model = colour_simcc_model(tmp_path / "m.onnx", SIZE, n_keypoints)
    with pytest.raises(InputError, match=name) as caught:
        MMPose(model)
    message = str(caught.value)
    assert f"simcc_x (1, {n_keypoints}, 96), simcc_y (1, {n_keypoints}, 128)" in message
    assert "Known are mmpose" in message and "one-stage" in message and "\n" not in message


@pytest.mark.parametrize("fill", [0.0, -1.0, -np.inf])
def test_a_box_without_a_keypoint_is_nobody(tmp_path, fill):
    maps = {"maps": np.full((1, 17, 16, 12), fill, np.float32)}
    detector = MMPose(constant_model(tmp_path / "m.onnx", (1, 3, 64, 48), maps))
    assert len(detector.detect(np.zeros((30, 20, 3), np.uint8))) == 0


@given(data=st.data())
@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_outputs_of_any_shape_are_used_or_refused_in_one_line(data, tmp_path):
    sizes = st.sampled_from([0, 1, 2, 17, 21, 32, 48, 64, 96, 128])
    shapes = data.draw(st.lists(st.lists(sizes, min_size=2, max_size=4), min_size=1, max_size=3))
    fill = data.draw(st.sampled_from([0.0, 1.0, -1.0, np.nan, np.inf]))
    outputs = {f"o{i}": np.full(shape, fill, np.float32) for i, shape in enumerate(shapes)}
    if sum(output.size for output in outputs.values()) > 20_000:
        return
    model = constant_model(tmp_path / "fuzz.onnx", (1, 3, 64, 48), outputs)
    try:
        found = MMPose(model, flip_test=data.draw(st.booleans())).detect(np.zeros((30, 20, 3), np.uint8))
    except InputError as error:
        assert str(model) in str(error) and "\n" not in str(error)
    else:
        given_points = np.isfinite(found.keypoints_px).all(axis=-1)
        np.testing.assert_array_equal(found.scores > 0, given_points)


@pytest.mark.parametrize("shape", [(1, 3, None, 48), (1, 1, 64, 48), (3, 64, 48), (1, 64, 48, 3)])
def test_inputs_that_are_not_crops_are_refused(tmp_path, shape):
    path = save(tmp_path / "m.onnx", [helper.make_node("Identity", ["image"], ["o"])], {"image": list(shape)},
                {"o": list(shape)}, {})  # fmt: skip
    with pytest.raises(InputError, match="crops of a fixed size"):
        MMPose(path)
