"""Two splits that share nothing, and subjects who are who they are in every process."""

import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.simulation.body.identities import (
    KINDS,
    SPLITS,
    Subject,
    is_woman,
    split_members,
    stream,
    traits,
)
from hicp_lib.simulation.body.model import load_body

MEMBERS = [split_members(split) for split in SPLITS]


def test_nothing_belongs_to_both_splits_and_every_body_to_one():
    bodies, shapes = [members["bodies"] for members in MEMBERS], load_body().shape_names
    assert sorted(bodies[0] + bodies[1]) == sorted(shapes) and len(set(shapes)) == len(shapes)
    for kind in KINDS:
        ranges = sorted(members[kind] for members in MEMBERS)
        assert ranges[0][0] <= ranges[0][1] < ranges[1][0] <= ranges[1][1]


def test_both_splits_span_ages_and_heights_of_both_sexes():
    for woman in (True, False):
        people = [[traits(name) for name in m["bodies"] if is_woman(name) == woman] for m in MEMBERS]
        assert [len(some) for some in people] == [12, 20]
        for name, wide, apart in (("age_years", 45, 5), ("height_m", 0.2, 0.02)):
            values = [[person[name] for person in some] for some in people]
            assert all(np.ptp(some) > wide for some in values)
            assert abs(np.mean(values[0]) - np.mean(values[1])) < apart


@pytest.mark.parametrize("split", SPLITS)
def test_subjects_of_a_seed_are_different_people_women_and_men_in_turn(split):
    bodies = split_members(split)["bodies"]
    order = []
    for seed in (0, 3):
        people = [Subject(seed, number, split).identity for number in range(len(bodies))]
        order.append([person.body for person in people])
        assert sorted(order[-1]) == sorted(bodies)
        women = [is_woman(name) for name in order[-1]]
        assert all(a != b for a, b in zip(women, women[1:], strict=False))
        for kind in KINDS:
            assert len({getattr(person, kind) for person in people}) == len(bodies)
    assert order[0] != order[1]
    with pytest.raises(InputError, match=f"expected a whole number from 0 to {len(bodies) - 1}"):
        Subject(0, len(bodies), split)


def test_streams_are_of_their_own():
    subjects = [Subject(seed, number, split) for split in SPLITS for seed in (0, 1) for number in (0, 1)]
    numbers = [(), (0,), (0, 0), ("mocap",), ("mocap", 0)]
    drawn = [subject.stream(*more).random() for subject in subjects for more in numbers]
    identity = subjects[0].identity
    drawn += [identity.draw(kind).random() for kind in KINDS]
    assert len(set(drawn)) == len(drawn)
    assert identity.draw("room").random() == identity.draw("room").random()
    assert stream("a", 0).random() != stream("a").random() != stream("a", 0, 0).random()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [((-1,), "seed is -1"), ((0, 1.5), "number is 1.5"), ((0, 0, "held-out"), "no people 'held-out'")],
)
def test_who_is_nobody_is_refused(arguments, expected):
    with pytest.raises(InputError, match=expected):
        Subject(*arguments)
