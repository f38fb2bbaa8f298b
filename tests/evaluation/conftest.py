"""Fixtures of the evaluation's tests: the makers of `made_people`, by the names tests ask for."""

import pytest

from tests.evaluation.made_people import make_annotations, make_detections, make_scene, make_world


@pytest.fixture
def annotated():
    return make_annotations


@pytest.fixture
def detected():
    return make_detections


@pytest.fixture
def scene():
    return make_scene


@pytest.fixture
def world():
    return make_world()
