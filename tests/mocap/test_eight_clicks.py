"""The paper's registration: which eight clicks, and what its two ways of turning make of them."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.camera import transform
from hicp_lib.core.errors import InputError
from hicp_lib.mocap.eight_clicks import (
    camera_places,
    register_by_camera_marker,
    register_selected,
    select_markers,
)
from hicp_lib.mocap.registration import (
    SEEN,
    lift_clicks,
)
from tests.mocap.discs import (
    CAMERA_MARKER_CAM,
    NAMES,
    T_BASE_MOCAP,
    errors_of,
)


def test_arun_alone_finds_what_the_markers_say(laboratory, clicks):
    matched = select_markers(lift_clicks(laboratory[0], clicks, laboratory[1]))
    assert len(matched) == 8 and matched["frame"].nunique() <= 2
    registration = register_selected(matched)
    angle, displacement = errors_of(registration)
    assert angle < 0.005 and displacement < 0.005
    assert registration.n_points == 8 and registration.rms_m < 0.004
    assert registration.rms_m < registration.leave_one_out_m * 2


def test_the_papers_translation_is_off_by_where_the_camera_marker_sits(laboratory, clicks):
    recording, mocap = laboratory
    matched = select_markers(lift_clicks(recording, clicks, mocap))
    registration = register_by_camera_marker(matched, *camera_places(recording, mocap))
    assert np.allclose(registration.T_base_mocap[:3, :3], register_selected(matched).T_base_mocap[:3, :3])
    _, displacement = errors_of(registration)
    assert displacement == pytest.approx(np.linalg.norm(CAMERA_MARKER_CAM), abs=0.01)


def test_turned_about_the_camera_errors_along_the_line_of_sight_turn_nothing(laboratory, clicks):
    """Markers that are lifted too near by up to 5 cm, each along its own line of sight."""
    recording, mocap = laboratory
    matched = select_markers(lift_clicks(recording, clicks, mocap))
    marker_m, centre_m = camera_places(recording, mocap)
    centred_m = transform(np.linalg.inv(T_BASE_MOCAP), centre_m)
    sight_m = matched[SEEN].to_numpy() - centre_m[matched["frame"]]
    nearer = np.linspace(0, 0.05, len(matched))[:, None] / np.linalg.norm(sight_m, axis=1, keepdims=True)
    wrong = matched.assign(**dict(zip(SEEN, (matched[SEEN].to_numpy() - nearer * sight_m).T, strict=True)))
    (turned, moved), (turned_less, moved_less) = (
        errors_of(register_by_camera_marker(wrong, centred_m, centre_m, about)) for about in (False, True)
    )
    assert turned > 0.01 and turned_less < 0.005 and moved > 2 * moved_less
    _, moved = errors_of(register_by_camera_marker(matched, marker_m, centre_m, about_camera=True))
    assert moved < np.linalg.norm(CAMERA_MARKER_CAM)


def test_clicks_on_the_wall_behind_are_not_among_the_eight(laboratory, clicks):
    matched = lift_clicks(laboratory[0], clicks, laboratory[1])
    matched.loc[::4, ["x_m", "y_m", "z_m"]] += [-0.4, 0.9, 1.2]
    eight = select_markers(matched)
    assert len(eight) == 8 and register_selected(eight).rms_m < 0.005


def test_a_missing_camera_marker_is_refused(laboratory):
    recording, mocap = laboratory
    without = replace(mocap, names=NAMES[:9], points_m=mocap.points_m[:, :9])
    with pytest.raises(InputError, match="no marker 'camera'"):
        camera_places(recording, without)
    mocap = replace(mocap, points_m=np.full_like(mocap.points_m, np.nan))
    with pytest.raises(InputError, match="measured in no frame"):
        camera_places(recording, mocap)


def test_the_eight_are_of_the_two_images_with_most_markers_and_far_apart(laboratory, clicks):
    matched = lift_clicks(laboratory[0], clicks, laboratory[1])
    matched = matched[~((matched["frame"] == 1) & (matched["marker"] == "m0"))]
    matched = matched[~((matched["frame"] == 3) & matched["marker"].isin(["m1", "m2"]))]
    eight = select_markers(matched)
    assert eight["frame"].isin([0, 2]).all() and len(eight) == 8
    points_m = eight[["mocap_x_m", "mocap_y_m", "mocap_z_m"]].to_numpy()
    apart_m = np.linalg.norm(points_m[:, None] - points_m, axis=2)[np.triu_indices(8, 1)]
    assert apart_m.min() > 0.2  # none of them twice, as a marker that stands still is in two images
    assert (np.diff(eight["frame"]) >= 0).all()


@pytest.mark.parametrize(("off_m", "is_chosen"), [(0.09, True), (0.11, False)])
def test_points_that_keep_their_distances_to_a_decimetre_are_chosen(off_m, is_chosen):
    places_m = np.zeros((8, 3))
    places_m[:, 0] = np.arange(8)
    matched = pd.DataFrame({"frame": 0, "marker": [f"m{k}" for k in range(8)]})
    matched[["mocap_x_m", "mocap_y_m", "mocap_z_m"]] = places_m
    places_m[0, 0] -= off_m
    matched[["x_m", "y_m", "z_m"]] = places_m
    assert ("m0" in set(select_markers(matched)["marker"])) == is_chosen
