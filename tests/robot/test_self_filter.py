"""Points on the robot itself are left out, others stay."""

import numpy as np

from hicp_lib.robot.segments import body_segments
from hicp_lib.robot.self_filter import MARGIN_M, filter_self, self_distance_m


def test_points_on_the_arm_go_and_others_stay(icub, home):
    segments = body_segments(icub, home)
    forearm = next(segment for segment in segments if segment.part == "left_forearm")
    middle = (forearm.start_m + forearm.end_m) / 2
    across = np.cross(forearm.end_m - forearm.start_m, [0, 0, 1.0])
    across /= np.linalg.norm(across)
    gaps = np.array([-0.01, 0.5 * MARGIN_M, 0.06])
    points = middle + (forearm.radius_m + gaps)[:, None] * across
    np.testing.assert_allclose(self_distance_m(icub, home, points), gaps, atol=1e-9)
    kept = filter_self(icub, home, np.vstack([points, np.full(3, np.nan)]))
    assert np.isfinite(kept).all(axis=1).tolist() == [False, False, True, False]
