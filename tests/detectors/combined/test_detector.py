"""The combination, of two fakes: where it looks, whose hand is whose, and what it refuses."""

import numpy as np
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import LEFT_HAND, N_KEYPOINTS, RIGHT_HAND
from hicp_lib.detectors.combined.arbitration import ArbitrationRule
from hicp_lib.detectors.combined.detector import Combined
from hicp_lib.detectors.combined.hand_squares import Square
from hicp_lib.detectors.registry import make_detector

SIDES = (LEFT_HAND, RIGHT_HAND)
SHAPE = np.random.default_rng(0).uniform(-12, 12, (21, 2))
SHAPE[0] = 0


class FakeBody:
    """Bodies given once and for all; counts how often it is asked."""

    name, settings = "fake-body", {"kind": "body"}

    def __init__(self, found: Detections) -> None:
        self.found, self.calls = found, 0

    def detect(self, image):
        self.calls += 1
        return self.found


class FakeHands:
    """Sees a hand wherever a pixel is red: its root; green says the hand model calls it left."""

    name, settings = "fake-hands", {"kind": "hands"}

    def __init__(self, miss_whole: tuple[int, int] | None = None) -> None:
        self.miss_whole, self.shapes = miss_whole, []

    def detect(self, image):
        self.shapes.append(image.shape[:2])
        rows = [] if image.shape[:2] == self.miss_whole else np.argwhere(image[..., 0] == 255)
        keypoints, scores = np.full((len(rows), N_KEYPOINTS, 2), np.nan), np.zeros((len(rows), N_KEYPOINTS))
        for i, (v, u) in enumerate(rows):
            side = SIDES[0 if image[v, u, 1] else 1]
            keypoints[i, side], scores[i, side] = SHAPE + (u, v), 0.9
        return Detections(keypoints, scores, scores.max(axis=1, initial=0))


def body(*arms, score=0.9) -> Detections:
    """Bodies from (left shoulder, elbow, wrist, right shoulder, elbow, wrist) each; None where not given."""
    keypoints, scores = np.full((len(arms), N_KEYPOINTS, 2), np.nan), np.zeros((len(arms), N_KEYPOINTS))
    for row, joints in enumerate(arms):
        for k, point in zip((5, 7, 9, 6, 8, 10), joints, strict=True):
            if point is not None:
                keypoints[row, k], scores[row, k] = point, score
    return Detections(keypoints, scores, np.ones(len(arms)))


def image_with(*roots, shape=(400, 400), left=()) -> np.ndarray:
    """A black image with a red pixel per hand; those whose index is in `left` are called left."""
    image = np.zeros((*shape, 3), np.uint8)
    for i, (u, v) in enumerate(roots):
        image[v, u] = (255, 255 if i in left else 0, 0)
    return image


# Seen from the front: the person's left arm on the right side of the image.
ARMS = ((250, 100), (290, 160), (300, 220), (150, 100), (110, 160), (100, 220))
LEFT_ROOT, RIGHT_ROOT = (302, 224), (98, 224)


def roots(found: Detections, row: int = 0) -> list:
    """Positions of the left and the right hand root; None where not given."""
    points = found.keypoints_px[row, [94, 115]]
    return [tuple(point.tolist()) if np.isfinite(point).all() else None for point in points]


def combine(found, hands=None, **options):
    return Combined(FakeBody(found), hands or FakeHands(), min_side_px=2, **options)


def test_sides_are_the_bodys_whatever_the_hand_model_says():
    image = image_with(LEFT_ROOT, RIGHT_ROOT, left=[1])  # both labels are wrong
    found = combine(body(ARMS)).detect(image)
    assert len(found) == 1
    assert roots(found) == [LEFT_ROOT, RIGHT_ROOT]


def test_the_points_of_a_hand_are_back_in_the_image_to_a_millionth_of_a_pixel():
    found = combine(body(ARMS)).detect(image_with(LEFT_ROOT, RIGHT_ROOT))
    np.testing.assert_allclose(found.keypoints_px[0, LEFT_HAND], SHAPE + LEFT_ROOT, atol=1e-6)
    np.testing.assert_allclose(found.keypoints_px[0, RIGHT_HAND], SHAPE + RIGHT_ROOT, atol=1e-6)


@pytest.mark.parametrize("looks", ["wrists", "mirrored", "image", "wrists+image"])
def test_each_way_of_looking_finds_the_hands_of_a_good_body(looks):
    found = combine(body(ARMS), looks=looks).detect(image_with(LEFT_ROOT, RIGHT_ROOT))
    assert roots(found) == [LEFT_ROOT, RIGHT_ROOT]


def test_a_mirrored_look_has_the_points_where_they_are_and_the_other_side():
    detector, square = combine(body(ARMS)), Square(280, 200, 50)
    plain, mirrored = (
        detector._look(image_with(LEFT_ROOT, left=[0]), square, way) for way in (False, True)
    )  # the fake calls the hand left, whichever way it is shown
    np.testing.assert_allclose(mirrored.keypoints_px[0, 0], plain.keypoints_px[0, 0])
    np.testing.assert_allclose(mirrored.keypoints_px[0, 0], LEFT_ROOT)
    assert (plain.sides.tolist(), mirrored.sides.tolist()) == ([0], [1])


def test_the_body_detector_runs_once():
    detector = combine(body(ARMS))
    detector.detect(image_with(LEFT_ROOT))
    assert detector.parts["body"].calls == 1


def test_hands_missed_in_the_whole_image_are_found_at_the_wrists():
    hands = FakeHands(miss_whole=(400, 400))
    assert roots(combine(body(ARMS), hands).detect(image_with(LEFT_ROOT, RIGHT_ROOT))) == [
        LEFT_ROOT,
        RIGHT_ROOT,
    ]
    assert (400, 400) in hands.shapes


def test_a_hand_elsewhere_is_refused_and_without_arbitration_is_not():
    far = (200, 120)  # on the chest
    image = image_with(far)
    assert roots(combine(body(ARMS)).detect(image)) == [None, None]
    assert far in roots(combine(body(ARMS), arbitrate=False).detect(image))


def test_a_hand_out_of_everybodys_reach_is_an_instance_of_its_own():
    found = combine(body(ARMS)).detect(image_with(LEFT_ROOT, (200, 250), shape=(400, 700), left=[1]))
    assert len(found) == 1  # within reach of the left shoulder: refused
    found = combine(body(ARMS)).detect(image_with(LEFT_ROOT, (650, 30), shape=(400, 700), left=[1]))
    assert len(found) == 2
    assert roots(found, 1) == [(650, 30), None]


def test_one_hand_seen_from_two_squares_goes_to_one_arm_only():
    near = ((250, 100), (230, 160), (205, 220), (150, 100), (170, 160), (195, 220))  # wrists 10 px apart
    found = combine(body(near)).detect(image_with((206, 222)))
    assert roots(found) == [(206, 222), None]
    both = combine(body(near), looks="wrists", arbitrate=False).detect(image_with((206, 222)))
    assert roots(both) == [(206, 222), (206, 222)]


def test_crossed_arms_keep_their_own_hands():
    crossed = ((250, 100), (230, 160), (150, 220), (150, 100), (170, 160), (250, 220))
    found = combine(body(crossed)).detect(image_with((148, 222), (252, 222)))
    assert roots(found) == [(148, 222), (252, 222)]


def test_two_people_get_their_own_hands():
    second = tuple((u + 350, v) for u, v in ARMS)
    image = image_with((652, 224), RIGHT_ROOT, LEFT_ROOT, (448, 224), shape=(400, 800))
    found = combine(body(ARMS, second)).detect(image)
    assert len(found) == 2
    assert roots(found, 0) == [LEFT_ROOT, RIGHT_ROOT]
    assert roots(found, 1) == [(652, 224), (448, 224)]


def test_without_wrists_the_whole_image_gives_hands_within_reach():
    no_wrists = (*ARMS[:2], None, *ARMS[3:5], None)
    image = image_with(LEFT_ROOT, RIGHT_ROOT)
    assert roots(combine(body(no_wrists)).detect(image)) == [LEFT_ROOT, RIGHT_ROOT]
    assert roots(combine(body(no_wrists), looks="wrists").detect(image)) == [None, None]


@pytest.mark.parametrize("options", [{}, {"looks": "image"}, {"arbitrate": False}])
def test_side_by_side_finds_the_same(options):
    image = image_with(LEFT_ROOT, RIGHT_ROOT, (350, 350), shape=(400, 700))
    one, other = (combine(body(ARMS), side_by_side=both, **options) for both in (False, True))
    found, same = one.detect(image), other.detect(image)
    assert len(found) and np.array_equal(found.keypoints_px, same.keypoints_px, equal_nan=True)
    assert one.settings == other.settings  # the answer is the same, so a kept one may be


def test_unsure_wrists_count_as_not_given():
    hands = FakeHands()
    combine(body(ARMS, score=0.01), hands, looks="wrists").detect(image_with(LEFT_ROOT))
    assert hands.shapes == []


def test_with_nobody_found_the_hand_models_sides_stand_but_nobody_has_two_left_hands():
    found = combine(Detections.none()).detect(image_with((100, 100), (300, 300), left=[0, 1]))
    assert len(found) == 1
    assert sorted(roots(found)) == [(100, 100), (300, 300)]
    assert found.person_scores[0] == pytest.approx(0.9 * (1 - ArbitrationRule().alone))  # each seen once
    plain = combine(Detections.none(), agreement=False).detect(image_with((100, 100), (300, 300)))
    assert plain.person_scores[0] == pytest.approx(0.9)


def test_no_body_and_no_hand_is_nobody():
    assert len(combine(Detections.none()).detect(np.zeros((50, 40, 3), np.uint8))) == 0
    assert len(combine(Detections.none(), arbitrate=False).detect(np.zeros((50, 40, 3), np.uint8))) == 0


def test_a_hand_of_the_body_detectors_own_stays_where_none_is_found():
    own = body(ARMS)
    own.keypoints_px[0, LEFT_HAND], own.scores[0, LEFT_HAND] = SHAPE + (301, 222), 0.4
    found = combine(own).detect(image_with(RIGHT_ROOT))
    assert roots(found) == [(301, 222), RIGHT_ROOT]
    assert found.scores[0, 94] == 0.4


def test_bodies_are_left_as_they_were():
    before = body(ARMS)
    copy = before.keypoints_px.copy()
    combine(before).detect(image_with(LEFT_ROOT))
    np.testing.assert_array_equal(before.keypoints_px, copy)


def test_annotated_boxes_reach_a_body_detector_that_takes_them():
    class Boxed(FakeBody):
        takes_boxes = True

        def detect(self, image, boxes_px):
            self.boxes_px = boxes_px
            return self.found

    detector = Combined(Boxed(body(ARMS)), FakeHands(), min_side_px=2)
    assert detector.takes_boxes
    detector.detect(image_with(LEFT_ROOT), np.array([[1.0, 2, 3, 4]]))
    assert detector.parts["body"].boxes_px.tolist() == [[1, 2, 3, 4]]


def test_settings_tell_everything_the_result_depends_on():
    one, other = combine(body(ARMS)), combine(body(ARMS), arbitrate=False)
    assert one.name == "combined:fake-body+fake-hands"
    assert one.settings["body"]["kind"] == "body" and one.settings["hands"]["kind"] == "hands"
    assert one.settings != other.settings
    assert one.settings["rule"]["wrist_reach"] > 0 and one.settings["squares"]["beyond_wrist"] > 0


@pytest.mark.parametrize(
    "name, said",
    [
        ("combined:mediapipe-pose", "BODY.HANDS"),
        ("combined:nobody+mediapipe-hands", "BODY.HANDS"),
        ("combined:mediapipe-hands+mediapipe-hands", "finds no body"),
        ("combined:mediapipe-pose+openpose-mobilenet", "finds no hand"),
        ("combined:mmpose+mediapipe-hands", "--model"),
    ],
)
def test_a_combination_that_is_none_is_refused_in_one_line(name, said):
    with pytest.raises(InputError, match=said) as error:
        make_detector(name)
    assert "\n" not in str(error.value)


def test_unknown_ways_of_looking_are_refused():
    with pytest.raises(InputError, match="wrists"):
        combine(body(ARMS), looks="everywhere")


def test_options_go_to_the_part_they_name(weights):
    detector = make_detector("combined:mediapipe-pose+mediapipe-hands", min_score=0.4, hands_min_score=0.3)
    assert detector.settings["body"]["min_score"] == 0.4
    assert detector.settings["hands"]["min_score"] == 0.3
    with pytest.raises(InputError, match="colour"):
        make_detector("combined:mediapipe-pose+mediapipe-hands", colour="blue")


def test_hands_are_not_followed_from_one_part_of_an_image_to_the_next(weights):
    name = "combined:mediapipe-pose+mediapipe-hands"
    with pytest.raises(InputError, match="leave out hands_tracking_hz") as error:
        make_detector(name, hands_tracking_hz=30.0)
    assert "\n" not in str(error.value)
    assert make_detector(name, tracking_hz=30.0).settings["body"]["tracking_hz"] == 30.0
    whole = make_detector(name, looks="image", hands_tracking_hz=30.0)
    assert whole.settings["hands"]["tracking_hz"] == 30.0
