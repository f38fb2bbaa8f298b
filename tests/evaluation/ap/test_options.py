"""Which definitions are given side by side."""

from dataclasses import replace

import numpy as np
import pytest

from hicp_lib.evaluation.ap.options import OBJECTS, choose, definitions


def test_visible_and_outside_keypoints_are_told_apart_only_where_some_are_known(scene):
    people, _ = scene(0)
    every, visible = {"labelled": "all"}, {"labelled": "visible"}
    assert definitions(people, "body") == [("body", every), ("body", visible)]
    unmarked = replace(people, visibility=np.where(people.visibility > 0, 2.0, 0.0))
    assert definitions(unmarked, "body") == [("body", every)]
    assert definitions(unmarked, "hand") == [("hand", every), ("each hand", every)]
    beyond = replace(people, visibility=np.where(people.visibility > 0, 2.0, -1.0))
    assert definitions(beyond, "body") == [("body", every), ("body", every | {"outside": "count"})]


@pytest.mark.parametrize("group", OBJECTS)
def test_what_is_asked_for_goes_before_a_groups_defaults(group):
    objects, options = choose(group, {"score": "person", "area": "box"})
    assert (options.score, options.area) == ("person", "box")
    assert objects.ndim == 2 and len(set(objects.ravel().tolist())) == objects.size
    assert choose(group, {})[1].sigmas == (
        "halpe" if group in ("body", "below the head", "hand") else "wholebody"
    )
