"""ISO/TS 15066's separation against a worked example."""

import pytest

from hicp_lib.robot.separation import Separation, separation_table


def test_a_worked_example_of_a_course():
    example = Separation(
        human_m_s=1.6, robot_m_s=1.0, reaction_s=0.10, stopping_s=0.30, intrusion_m=0.20,
        human_uncertainty_m=0.10, robot_uncertainty_m=0.05,
    )  # fmt: skip
    assert list(example.terms_m().values()) == pytest.approx([0.64, 0.10, 0.15, 0.20, 0.10, 0.05])
    assert example.distance_m == pytest.approx(1.24)
    table = separation_table({"a": example})
    assert table.loc[table["term"] == "sum", "value"].item() == pytest.approx(1.24)
    assert separation_table({}).columns.tolist() == table.columns.tolist()


def test_left_out_terms_are_nothing_and_a_person_walks():
    """ISO's 1.6 m/s: 0.64 m in 0.4 s; the robot 0.1 and 0.15 m; and 0.1 m of uncertainty."""
    separation = Separation(1.0, reaction_s=0.1, stopping_s=0.3, human_uncertainty_m=0.1)
    assert list(separation.terms_m().values()) == pytest.approx([0.64, 0.1, 0.15, 0, 0.1, 0])
