"""The detector for close range, with stand-ins for its two networks, and its files."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.core.images import read_image
from hicp_lib.core.keypoints import INDEX, LEFT_HAND, N_KEYPOINTS, RIGHT_HAND
from hicp_lib.detectors.closerange import detector
from hicp_lib.detectors.onnx.session import Port, open_committed
from hicp_lib.detectors.registry import make_detector

SIDE_PX, ROUGH_PX = 192, 7
CENTRES_PX = {"left": (290, 120), "right": (110, 250)}
HANDS = {"left": LEFT_HAND, "right": RIGHT_HAND}


class Network:
    size_px, settings = (SIDE_PX, SIDE_PX), {}

    def __init__(self, answer, n_points):
        self.answer, self.seen = answer, []
        self.outputs = [Port("keypoints", (1, n_points, 5), "tensor(float)")]

    def run(self, blob):
        assert blob.shape == (1, 3, SIDE_PX, SIDE_PX) and blob.dtype == np.float32
        self.seen.append(blob[0].transpose(1, 2, 0))
        return [self.answer(self.seen[-1])[None]]


def person(present=0.9):
    """All of a picture of 400 x 400, with both hands `ROUGH_PX` off."""
    found = np.full((N_KEYPOINTS, 5), present)
    found[:, :2] = np.random.default_rng(0).uniform(20, 380, (N_KEYPOINTS, 2))
    for side, points in HANDS.items():
        around = np.random.default_rng(1).uniform(-25, 25, (21, 2))
        found[points, :2] = np.array(CENTRES_PX[side]) + ROUGH_PX + around - around.mean(axis=0)
    found[:, :2] *= SIDE_PX / 400
    found[:, 2] = 0.8
    return found.astype(np.float32)


def brightest(square):
    """Every point of a hand in the middle of what is bright."""
    weight = square.mean(axis=2) > 128
    middle = np.argwhere(weight).mean(axis=0)[::-1]
    return np.array([[*middle, 0.7, 0.6, 0.5]] * 21, np.float32)


@pytest.fixture
def image():
    picture = np.full((400, 400, 3), 20, np.uint8)
    for centre in CENTRES_PX.values():
        cv2.circle(picture, centre, 8, (255, 255, 255), -1)
    return picture


def made(monkeypatch, whole, hand=brightest, **options):
    networks = {"people.onnx": Network(whole, N_KEYPOINTS), "hands.onnx": Network(hand, 21)}
    monkeypatch.setattr(detector, "open_model", lambda file, **_: networks[file])
    found = detector.CloseRange(model="people.onnx", hand_model="hands.onnx", **options)
    return found, networks["hands.onnx"]


def test_hands_are_looked_at_again_each_as_a_right_one(monkeypatch, image):
    image[72:82, 250:280] = 255  # left above the left hand, not in the middle of its square
    closerange, hands = made(monkeypatch, lambda _: person(), lambda s: brightest(s * inner(s)))
    found = closerange.detect(image)
    for side, points in HANDS.items():
        off_px = np.linalg.norm(found.keypoints_px[0, points] - CENTRES_PX[side], axis=-1)
        assert off_px.max() < 1, side
    right, left = sorted(hands.seen, key=lambda square: square[:40].sum())
    assert (left[:40, 96:] > 128).any() and not (left[:40, :96] > 128).any(), "mirrored"
    assert not (right[:40] > 128).any()


def inner(square):
    mask = np.zeros_like(square)
    mask[40:-40, 40:-40] = 1
    return mask


def test_a_single_look_leaves_hands_as_they_are(monkeypatch, image):
    closerange, hands = made(monkeypatch, lambda _: person(), look_again=False)
    found = closerange.detect(image)
    assert not hands.seen
    expected = person()[:, :2] * 400 / SIDE_PX
    np.testing.assert_allclose(found.keypoints_px[0], expected, atol=1e-3)


def test_absent_hands_are_not_looked_at_and_the_person_stays(monkeypatch, image):
    closerange, hands = made(monkeypatch, lambda _: person(present=0.2))
    found = closerange.detect(image)
    assert not hands.seen and len(found) == 1
    np.testing.assert_allclose(found.scores, 0.2, atol=1e-6)
    assert 0 < found.person_scores[0] <= 1


def test_what_is_in_the_picture_counts_from_a_half(monkeypatch, image):
    def mixed(_):
        whole = person()
        whole[:, 2], whole[:, 3] = 0.1, np.where(np.arange(N_KEYPOINTS) % 2, 0.6, 0.4)
        return whole

    scores = made(monkeypatch, mixed, look_again=False)[0].detect(image).scores[0]
    assert (scores[1::2] >= 0.5).all() and (scores[::2] < 0.5).all()


def test_without_presence_a_point_scores_by_how_sure_its_place_is(monkeypatch, image):
    closerange, _ = made(monkeypatch, lambda _: person(present=0.2), look_again=False, presence=False)
    np.testing.assert_allclose(closerange.detect(image).scores, 0.9, atol=1e-6)


def test_each_box_is_a_person(monkeypatch, image):
    closerange, _ = made(monkeypatch, lambda _: person(), look_again=False, boxes="gt")
    boxes = np.array([[0, 0, 200, 200], [200.0, 100, 200, 200]])
    found = closerange.detect(image, boxes)
    expected = person()[:, :2] * 200 / SIDE_PX
    np.testing.assert_allclose(found.keypoints_px, [expected, expected + [200, 100]], atol=1e-3)


@pytest.mark.parametrize("name, of", [("closerange", "people"), ("closerange-hands", "hands")])
def test_the_files_give_what_was_trained(name, of):
    """PyTorch's answers for the photograph, as the export wrote them."""
    expected = np.array(read_json(Path(__file__).with_name(f"expected_{of}.json")))
    image = read_image(DATA_DIR / "photograph.jpg")
    square = cv2.resize(image, (SIDE_PX, SIDE_PX), interpolation=cv2.INTER_AREA)
    (found,) = open_committed(f"{name}.onnx").run(cv2.dnn.blobFromImage(square))
    off_px = np.linalg.norm(found[0, :, :2] - expected[:, :2], axis=1)
    assert np.median(off_px) < 0.1 and np.quantile(off_px, 0.9) < 0.5
    np.testing.assert_allclose(found[0, :, 2:], expected[:, 2:], atol=0.02)


def test_a_portrait_has_a_head_and_no_legs():
    image = read_image(DATA_DIR / "photograph.jpg")
    found, lightning = (make_detector(name).detect(image) for name in ("closerange", "movenet-lightning"))
    legs = [INDEX[f"{side}_{joint}"] for side in ("left", "right") for joint in ("knee", "ankle")]
    assert (found.scores[0, :5] > 0.5).all() and (found.scores[0, legs] < 0.5).all()
    off_px = np.linalg.norm(found.keypoints_px[0, :5] - lightning.keypoints_px[0, :5], axis=1)
    assert off_px.max() < 0.05 * image.shape[0]


@pytest.mark.parametrize("file", ["closerange-hands", "movenet-lightning", "openpose-mobilenet", "nanodet"])
def test_other_networks_are_refused_in_place_of_that_of_people(file):
    with pytest.raises(
        InputError, match=r"expected what tools/closerange/export.py writes: keypoints \(1, 136, 5"
    ):
        make_detector("closerange", model=DATA_DIR / "weights" / f"{file}.onnx")


@pytest.mark.parametrize("file", ["closerange", "movenet-thunder", "posenet"])
def test_other_networks_are_refused_in_place_of_that_of_hands(file):
    with pytest.raises(InputError, match=r"keypoints \(1, 21, 5"):
        make_detector("closerange", hand_model=DATA_DIR / "weights" / f"{file}.onnx")
