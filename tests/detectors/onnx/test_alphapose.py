"""AlphaPose on networks with known answers."""

import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import COCO_17, TO_HALPE
from hicp_lib.detectors.onnx.alphapose import AlphaPose
from tests.detectors.onnx.onnx_models import (
    ALPHAPOSE_PIXELS,
    colour_maps_model,
    colour_simcc_model,
    constant_model,
)
from tests.detectors.onnx.test_mmpose import back_to_image, dots, heat_maps

BLACK = np.zeros((160, 200, 3), np.uint8)
BOX = (20.0, 30.0, 60.0, 80.0)


def logits(n_keypoints, cells, size=(48, 64)):
    """Logits as integral regression learns them: high at the point, far below 0 elsewhere."""
    maps = heat_maps(n_keypoints, cells, size)
    return np.log(np.maximum(maps * 0.9, 1e-6) / (1 - maps * 0.9)).astype(np.float32)


def cells(n, seed=0):
    return np.random.default_rng(seed).integers((12, 12), (36, 52), (n, 2)) * 1.0


@pytest.mark.parametrize("decoding", ["heatmap", "integral", "combined"])
def test_the_decoding_is_told_and_its_peaks_return_to_the_image(tmp_path, decoding):
    at = cells(136)
    maps = {"heatmap": heat_maps(136, at, (48, 64)), "integral": logits(136, at)}
    maps["combined"] = np.concatenate([maps["heatmap"][:, :26], maps["integral"][:, 26:]], axis=1)
    model = constant_model(tmp_path / "m.onnx", (1, 3, 256, 192), {"maps": maps[decoding]})
    detector = AlphaPose(model, boxes="gt")
    assert detector.decoding == decoding
    found = detector.detect(BLACK, [BOX])
    np.testing.assert_allclose(found.keypoints_px[0], back_to_image(at / (48, 64), BOX, (48, 64)), atol=2e-2)
    peak = {"heatmap": np.ones(136), "integral": np.full(136, 0.9)}
    peak["combined"] = np.concatenate([np.ones(26), np.full(110, 0.9)])
    np.testing.assert_allclose(found.scores[0], peak[decoding], atol=1e-4)
    mean, best = peak[decoding].mean(), peak[decoding].max()
    np.testing.assert_allclose(found.person_scores, mean + 1 + 1.25 * best, rtol=1e-4)


def test_heat_map_peaks_return_within_a_thousandth_of_a_pixel(tmp_path):
    at = cells(26)
    model = constant_model(tmp_path / "m.onnx", (1, 3, 256, 192), {"maps": heat_maps(26, at, (48, 64))})
    for box in [BOX, (10.5, 7.25, 200.0, 33.0), (-20, -10, 70.5, 90)]:
        found = AlphaPose(model, boxes="gt").detect(BLACK, [box])
        truth = back_to_image(at / (48, 64), box, (48, 64))
        np.testing.assert_allclose(found.keypoints_px[0, :26], truth, atol=1e-3)


@pytest.mark.parametrize("flip_test", [False, True])
def test_dots_are_found_and_their_colours_are_the_scores(tmp_path, flip_test):
    positions = np.array([[60.0, 70.0], [75.5, 60.25], [66.0, 88.0]])
    model = colour_maps_model(tmp_path / "m.onnx", (96, 128), 26, pixels=ALPHAPOSE_PIXELS)
    found = AlphaPose(model, boxes="gt", flip_test=flip_test).detect(dots(positions), [(30, 30, 80, 100)] * 2)
    assert len(found) == 1
    # Nose and neck have no other side: the flip test leaves them where they are.
    for point in (0, 18):
        assert np.abs(found.keypoints_px[0, point] - positions[point % 3]).max() < 2
        np.testing.assert_allclose(found.scores[0, point], 0.9, atol=0.06)


def test_two_boxes_of_two_people_stay_two(tmp_path):
    model = constant_model(
        tmp_path / "m.onnx", (1, 3, 256, 192), {"maps": heat_maps(17, cells(17), (48, 64))}
    )
    found = AlphaPose(model, boxes="gt").detect(BLACK, [BOX, (120, 20, 70, 130)])
    assert len(found) == 2 and np.isfinite(found.keypoints_px[:, COCO_17]).all()


def test_wrong_options_and_models_are_one_line(tmp_path):
    body = constant_model(tmp_path / "m.onnx", (1, 3, 256, 192), {"maps": heat_maps(17, cells(17), (48, 64))})
    for options, match in [({"decoding": "dark"}, "expected one of"), ({"decoding": "combined"}, "no face")]:
        with pytest.raises(InputError, match=match):
            AlphaPose(body, **options)
    with pytest.raises(InputError, match="mmpose"):
        AlphaPose(colour_simcc_model(tmp_path / "simcc.onnx", (48, 64), 17))


def test_hands_without_a_face_are_combined_too(tmp_path):
    """Of Halpe's 68 points without the face, the last 42 are for integral regression."""
    at = cells(68)
    maps = np.concatenate([heat_maps(68, at, (48, 64))[:, :26], logits(68, at)[:, 26:]], axis=1)
    model = constant_model(tmp_path / "m.onnx", (1, 3, 256, 192), {"maps": maps})
    detector = AlphaPose(model, boxes="gt")
    assert detector.decoding == "combined"
    found = detector.detect(BLACK, [BOX])
    points = found.keypoints_px[0, TO_HALPE["halpe68_noface"]]
    np.testing.assert_allclose(points, back_to_image(at / (48, 64), BOX, (48, 64)), atol=2e-2)
    np.testing.assert_allclose(found.scores[0, 94:], 0.9, atol=1e-4)
    assert np.isnan(found.keypoints_px[0, 26:94]).all()


def test_everything_assumed_is_told(tmp_path):
    model = constant_model(tmp_path / "m.onnx", (1, 3, 256, 192), {"maps": logits(136, cells(136))})
    facts = {fact.what: fact.value for fact in AlphaPose(model).describe()}
    assert facts["decoding"] == "integral" and facts["keypoints"] == "halpe136" and facts["batch"] == "1"
    assert facts["output"] == "48x64 cells" and facts["boxes"] == "image"


@pytest.mark.parametrize(
    ("body", "rest", "decoding"),
    [(-0.9, -0.9, "heatmap"), (-1.1, -1.1, "integral"), (-0.9, -1.1, "combined"), (-1.1, -0.9, "heatmap")],
)
def test_maps_are_logits_where_they_lie_below_minus_one(tmp_path, body, rest, decoding):
    maps = np.full((1, 136, 64, 48), body, np.float32)
    maps[:, 26:] = rest
    model = constant_model(tmp_path / "m.onnx", (1, 3, 256, 192), {"maps": maps})
    assert AlphaPose(model).decoding == decoding


@pytest.mark.parametrize(("n_logits", "decoding"), [(55, "heatmap"), (56, "combined")])
def test_face_and_hands_are_logits_where_most_of_them_are(tmp_path, n_logits, decoding):
    maps = np.zeros((1, 136, 64, 48), np.float32)
    maps[:, 26 : 26 + n_logits] = -2
    model = constant_model(tmp_path / "m.onnx", (1, 3, 256, 192), {"maps": maps})
    assert AlphaPose(model).decoding == decoding
