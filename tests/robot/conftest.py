"""A robot with its hand at its post, shared by the tests of what it senses and does."""

import pytest

from hicp_lib.robot.home import home_posture
from hicp_lib.robot.kinematics import load_icub


@pytest.fixture(scope="session")
def icub():
    return load_icub()


@pytest.fixture(scope="session")
def home(icub):
    return home_posture(icub)
