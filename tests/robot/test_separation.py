"""The standard's separation against a worked example; how an arm stops against one stepped through time."""

import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.robot.separation import Brakes, Separation, separation_table


def test_a_worked_example_of_a_course():
    example = Separation(
        human_m_s=1.6, robot_m_s=1.0, reaction_s=0.10, stopping_s=0.30, intrusion_m=0.20,
        human_uncertainty_m=0.10, robot_uncertainty_m=0.05,
    )  # fmt: skip
    assert list(example.terms_m().values()) == pytest.approx([0.64, 0.10, 0.15, 0.20, 0.10, 0.05])
    assert example.distance_m == pytest.approx(1.24)
    table = separation_table({"a": example}).set_index("term")["a"]
    assert table["sum"] == pytest.approx(1.24) == table.drop("sum").sum()
    assert separation_table({}).empty


def test_left_out_terms_are_nothing_and_a_person_walks():
    """ISO's 1.6 m/s: 0.64 m in 0.4 s; the robot 0.1 and 0.15 m; and 0.1 m of uncertainty."""
    separation = Separation(1.0, reaction_s=0.1, stopping_s=0.3, human_uncertainty_m=0.1)
    assert list(separation.terms_m().values()) == pytest.approx([0.64, 0.1, 0.15, 0, 0.1, 0])


def test_an_arm_stops_as_one_does_that_is_stepped_through_time():
    brakes = Brakes(delay_s=0.05, deceleration_rad_s2=2.0)
    joint_rad_s, lever_m = 0.6, 0.5
    step_s, time_s, travelled_m, speed = 1e-5, 0.0, 0.0, joint_rad_s
    while speed > 0:
        time_s += step_s
        speed -= 2.0 * step_s if time_s > 0.05 else 0.0
        travelled_m += lever_m * max(speed, 0.0) * step_s
    stopping_s = brakes.stopping_s(joint_rad_s)
    assert stopping_s == pytest.approx(time_s, abs=1e-4) == 0.35
    separation = Separation(lever_m * joint_rad_s, 0.1, stopping_s, 0.0, brake_delay_s=brakes.delay_s)
    assert separation.terms_m()["S_s: robot, while it stops"] == pytest.approx(travelled_m, abs=1e-4)


@pytest.mark.parametrize("wrong", [{"delay_s": -0.1}, {"deceleration_rad_s2": 0.0}, {"delay_s": np.nan}])
def test_brakes_that_never_stop_are_told(wrong):
    with pytest.raises(InputError, match="never stop an arm"):
        Brakes(**wrong)


def test_a_still_arm_only_waits_for_its_brakes():
    assert Brakes().stopping_s(0.0) == 0.02 and Brakes().stopping_s(np.deg2rad(30)) == pytest.approx(0.32)
