"""Annotated images, and people found in them."""

import pytest

from tests.formats.importers.native_people import NAMES, annotated, make_person


@pytest.fixture
def images():
    return annotated(NAMES)


@pytest.fixture
def found():
    """Two people, nobody, one person."""
    return {NAMES[785]: [make_person(1), make_person(2)], NAMES[1296]: [], NAMES[2006]: [make_person(3)]}
