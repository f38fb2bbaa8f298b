"""Where the hands are held when nobody is near."""

import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.robot import home
from hicp_lib.robot.home import HOME_M, home_posture

BENT_DEG = [0, 0, 0, -25, 20, 0, 50, 0, 0, 0]


@pytest.mark.parametrize(("side", "other", "y_m"), [("left", "right", -0.2), ("right", "left", 0.2)])
def test_the_palm_is_at_its_post_and_the_other_arm_bent(icub, side, other, y_m):
    assert HOME_M[side] == (-0.3, y_m, 0.05)
    posture = home_posture(icub, side)
    palm_m = icub.chains[side].T_root_link("hand", posture.angles(side))[:3, 3]
    np.testing.assert_allclose(palm_m, HOME_M[side], atol=1e-3)
    np.testing.assert_allclose(np.rad2deg(posture.angles(other)), BENT_DEG, atol=1e-9)
    assert not posture.angles("head").any()


def test_joints_stay_a_twentieth_of_their_range_from_their_limits(icub):
    low, high = icub.chains["left"].limits_rad[3:].T
    q = home_posture(icub, "left", np.array([-0.2, -0.1, 0.0])).angles("left")[3:]
    assert (np.minimum(q - low, high - q) / (high - low)).min() == pytest.approx(0.05, abs=1e-6)


def test_of_all_postures_one_like_the_bent_elbow_is_chosen(icub):
    """Straight wrists, though turning them would not move the palm away."""
    wrists_deg = np.rad2deg(home_posture(icub).angles("left"))[7:]
    assert abs(wrists_deg).max() < 2


def test_a_post_out_of_reach_is_refused(icub):
    with pytest.raises(InputError, match=r"the left palm cannot be held at \[-1.0, 0.0, 0.0\] m"):
        home_posture(icub, "left", np.array([-1.0, 0.0, 0.0]))


@pytest.mark.parametrize(("beyond_m", "is_held"), [(0.9e-3, True), (1.1e-3, False)])
def test_the_palm_is_held_to_a_millimetre(icub, monkeypatch, beyond_m, is_held):
    far_m = np.array([-0.6, -0.2, 0.1])
    with monkeypatch.context() as patched:
        patched.setattr(home, "_REACHED_M", np.inf)
        q = home_posture(icub, "left", far_m).angles("left")
    nearest_m = icub.chains["left"].T_root_link("hand", q)[:3, 3]
    post_m = nearest_m + beyond_m * (far_m - nearest_m) / np.linalg.norm(far_m - nearest_m)
    if is_held:
        home_posture(icub, "left", post_m)
    else:
        with pytest.raises(InputError, match="cannot be held"):
            home_posture(icub, "left", post_m)
