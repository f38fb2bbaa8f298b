"""Points on the robot itself are left out, others stay."""

import numpy as np
import pytest

from hicp_lib.robot import segments
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.segments import MARGIN_M, Segment, body_segments, filter_self, self_distance_m


def test_points_on_the_arm_go_and_others_stay(icub, home):
    parts = body_segments(icub, home)
    forearm = next(segment for segment in parts if segment.part == "left_forearm")
    middle = (forearm.start_m + forearm.end_m) / 2
    across = np.cross(forearm.end_m - forearm.start_m, [0, 0, 1.0])
    across /= np.linalg.norm(across)
    gaps = np.array([-0.01, 0.5 * MARGIN_M, 0.06])
    points = middle + (forearm.radius_m + gaps)[:, None] * across
    np.testing.assert_allclose(self_distance_m(icub, home, points), gaps, atol=1e-9)
    kept = filter_self(icub, home, np.vstack([points, np.full(3, np.nan)]))
    assert np.isfinite(kept).all(axis=1).tolist() == [False, False, True, False]


def test_the_margin_is_two_centimetres_and_belongs_to_others(icub, home):
    forearm = next(s for s in body_segments(icub, home) if s.part == "left_forearm")
    along = forearm.end_m - forearm.start_m
    across = np.cross(along, [0, 0, 1.0])
    across /= np.linalg.norm(across)
    middle = (forearm.start_m + forearm.end_m) / 2
    near, far = (middle + (forearm.radius_m + gap) * across for gap in (0.0199, 0.0201))
    assert np.isnan(filter_self(icub, home, near)).all() and np.array_equal(filter_self(icub, home, far), far)
    gap_m = self_distance_m(icub, home, far)
    assert np.isfinite(filter_self(icub, home, far, margin_m=gap_m)).all()
    assert np.isnan(filter_self(icub, home, far, margin_m=np.nextafter(gap_m, 1))).all()


def test_beyond_its_end_a_limb_is_round(icub, home):
    fingers = next(s for s in body_segments(icub, home) if s.part == "left_fingers")
    assert np.linalg.norm(fingers.end_m - fingers.start_m) == pytest.approx(0.075)
    along = (fingers.end_m - fingers.start_m) / 0.075
    tip = fingers.end_m + np.array([[0.1], [0.2]]) * along
    np.testing.assert_allclose(self_distance_m(icub, home, tip), [0.1 - 0.036, 0.2 - 0.036], atol=1e-9)


def test_limbs_run_between_the_origins_of_links(icub, home):
    """Ends worked out for arms that hang down: the shoulder 17.5 cm, the wrist 11.4 cm below the root."""
    radii_m = {s.part: s.radius_m for s in body_segments(icub, home)}
    assert radii_m == {
        "torso": 0.07, "shoulders": 0.05, "neck": 0.03, "head": 0.06,
        "left_upper_arm": 0.035, "left_forearm": 0.03, "left_hand": 0.025, "left_fingers": 0.036,
        "right_upper_arm": 0.035, "right_forearm": 0.03, "right_hand": 0.025, "right_fingers": 0.036,
    }  # fmt: skip
    hanging = {s.part: s for s in body_segments(icub, Posture())}
    np.testing.assert_allclose(hanging["shoulders"].start_m, (-0.010817, -0.110116, 0.1753), atol=1e-6)
    np.testing.assert_allclose(hanging["shoulders"].end_m, (-0.010817, 0.110116, 0.1753), atol=1e-6)
    np.testing.assert_allclose(hanging["left_forearm"].end_m, (-0.010817, -0.110116, -0.11428), atol=1e-6)
    np.testing.assert_allclose(hanging["right_hand"].end_m, (-0.010817, 0.094116, -0.17678), atol=1e-6)
    assert not hanging["torso"].start_m.any()


def test_a_limb_without_length_is_a_ball(icub, home, monkeypatch):
    ball = Segment("head", np.zeros(3), np.zeros(3), 0.06)
    monkeypatch.setattr(segments, "body_segments", lambda icub, posture: [ball])
    gaps_m = self_distance_m(icub, home, np.array([[0.1, 0, 0], [0, -0.03, 0]]))
    np.testing.assert_allclose(gaps_m, [0.04, -0.03])
