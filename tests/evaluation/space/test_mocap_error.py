"""Errors against motion capture: marker means, medians and fractions on errors that are known."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.camera import transform
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import NAMES
from hicp_lib.evaluation.cases import over_people
from hicp_lib.evaluation.space import mocap_error as me
from hicp_lib.evaluation.statistics.proportions import smallest_difference
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.recordings.qualisys import MotionCapture

N = 60
STAMPS_S = 1 + np.arange(N) / 30
T_BASE_MOCAP = np.array([[0.0, -1, 0, 0.3], [1, 0, 0, -0.2], [0, 0, 1, 0.6], [0, 0, 0, 1]])


def joint_path(times_s: np.ndarray) -> np.ndarray:
    """Joints (n, 6, 3) in the motion capture's frame, each on its own line."""
    return np.arange(6)[:, None] * [0.1, 0.2, 0.0] + times_s[:, None, None] * [0.05, 0.0, 0.02]


@pytest.fixture
def mocap() -> MotionCapture:
    times_s = np.arange(0, 5, 0.01)
    offsets = np.array([[0, 0, 0.03], [0, 0, -0.03]])
    points = (joint_path(times_s)[:, :, None] + offsets).reshape(len(times_s), 12, 3)
    names = tuple(name for joint in me.JOINTS for name in me.MARKERS[joint])
    camera = np.zeros((len(times_s), 1, 3))
    return MotionCapture(times_s, (*names, "camera"), np.concatenate([points, camera], axis=1), 100.0)


def lifted(reference: pd.DataFrame, error_m: float = 0.0, score: float = 0.8, **columns) -> pd.DataFrame:
    """Every joint found, off by `error_m` along z."""
    table = reference.assign(z_m=reference["z_m"] + error_m, score=score, person=0)
    return table.assign(**({"detector": "made-up", "method": "paper"} | columns))


@pytest.fixture
def reference(mocap) -> pd.DataFrame:
    return me.marker_means(mocap, STAMPS_S, T_BASE_MOCAP)


def test_markers_are_named_after_their_joints():
    assert me.MARKERS["left_elbow"] == ("elbow_left_1", "elbow_left_2")
    assert set(me.JOINTS) <= set(NAMES) and len(me.MARKERS) == 6


def test_the_reference_is_the_mean_of_two_markers_in_the_base_frame(reference):
    expected = transform(T_BASE_MOCAP, joint_path(STAMPS_S))
    for k, joint in enumerate(me.JOINTS):
        rows = reference[reference["keypoint"] == joint]
        assert rows["frame"].tolist() == list(range(N))
        assert rows[me.POSITION].to_numpy() == pytest.approx(expected[:, k])


def test_one_marker_alone_is_no_reference(mocap):
    mocap.points_m[:, mocap.names.index("wrist_right_2")] = np.nan
    table = me.marker_means(mocap, STAMPS_S, T_BASE_MOCAP).groupby("keypoint")["x_m"].count()
    assert table["right_wrist"] == 0 and table.drop("right_wrist").eq(N).all()


def test_a_missing_marker_is_named(mocap):
    names = tuple("left elbow" if name == "elbow_left_1" else name for name in mocap.names)
    with pytest.raises(InputError, match="no marker 'elbow_left_1'"):
        me.marker_means(MotionCapture(mocap.times_s, names, mocap.points_m, 100.0), STAMPS_S, T_BASE_MOCAP)


def test_errors_are_distances_to_markers_and_to_centres(reference):
    truth = reference.assign(z_m=reference["z_m"] - 0.03)
    errors = me.mocap_errors(lifted(reference, 0.04), reference, truth)
    assert len(errors) == 6 * N
    assert errors["error_m"].to_numpy() == pytest.approx(0.04)
    assert errors["centre_error_m"].to_numpy() == pytest.approx(0.07)


def test_what_was_not_found_keeps_its_row_and_others_people_do_not_count(reference):
    points = lifted(reference, 0.04)
    points.loc[points["keypoint"] == "left_wrist", "person"] = 1
    points.loc[points["keypoint"] == "left_elbow", me.POSITION] = np.nan
    errors = me.mocap_errors(points, reference).set_index("keypoint")
    assert (errors.loc["left_wrist", "score"] == 0).all() and errors.loc["left_wrist", "error_m"].isna().all()
    assert (errors.loc["left_elbow", "score"] == 0.8).all() and errors.loc[
        "left_elbow", "error_m"
    ].isna().all()
    assert errors["centre_error_m"].isna().all()


def test_medians_count_what_is_above_the_score(reference):
    rng = np.random.default_rng(0)
    points = lifted(reference, rng.uniform(0, 0.1, len(reference)), rng.uniform(0, 1, len(reference)))
    errors = me.mocap_errors(points, reference)
    medians = me.median_errors(errors, draws=Draws(100))
    for row in medians.to_dict("records"):
        part = errors[(errors["keypoint"] == row["keypoint"]) & (errors["score"] > row["min_score"])]
        assert row["count"] == len(part) and row["n_frames"] == N
        assert row["median_m"] == pytest.approx(part["error_m"].median())
        assert row["low_m"] <= row["median_m"] <= row["high_m"]


def test_a_joint_never_found_counts_zero_and_has_no_median(reference):
    medians = me.median_errors(me.mocap_errors(lifted(reference, score=0.05), reference), draws=Draws(10))
    assert (medians["count"] == 0).all() and medians[["median_m", "low_m", "high_m"]].isna().all().all()


def test_fractions_are_of_the_frames_with_motion_capture(reference):
    reference.loc[reference["frame"] >= 40, me.POSITION] = np.nan
    points = lifted(reference, 0.03)
    points.loc[points["frame"] < 10, "score"] = 0.0
    errors = me.mocap_errors(points, reference)
    fractions = me.distance_shares(errors, draws=Draws(50))
    shares = fractions.groupby("threshold_m")["value"].unique()
    assert shares[0.025] == [0]
    assert shares[0.05] == pytest.approx([0.75]) and shares[0.1] == pytest.approx([0.75])
    beyond = me.distance_shares(errors, beyond=True, draws=Draws(50))
    assert beyond.groupby("threshold_m")["value"].unique().to_dict() == {0.025: [1], 0.05: [0], 0.1: [0]}


def test_shares_beyond_are_of_the_frames_in_which_the_joint_was_found(reference):
    points = lifted(reference, np.where(reference["frame"] % 4 == 0, 0.2, 0.01))
    points.loc[points["frame"] % 2 == 1, "score"] = 0.2
    points.loc[points["keypoint"] == "left_wrist", "score"] = 0.0
    beyond = me.distance_shares(me.mocap_errors(points, reference), beyond=True, draws=Draws(50))
    beyond = beyond[beyond["threshold_m"] == 0.1].set_index(["min_score", "keypoint"])
    assert beyond.loc[(0.3, "left_elbow"), "value"] == pytest.approx(1 / 2)
    assert beyond.loc[(0.1, "left_elbow"), "value"] == pytest.approx(1 / 4)
    assert beyond.loc[(0.1, "left_elbow"), "low"] < 1 / 4 < beyond.loc[(0.1, "left_elbow"), "high"]
    assert beyond.loc[(0.1, "left_wrist"), ["value", "low", "high"]].isna().all()


def test_medians_of_two_detectors_are_compared_on_the_same_draws(reference):
    """Errors that vary by 10 cm over time, and one detector always 1 cm worse."""
    error_m = 0.05 + 0.05 * np.sin(reference["frame"] * 2.0)
    tables = [
        lifted(reference, error_m, detector="one"), lifted(reference, error_m + 0.01, detector="other"),
    ]  # fmt: skip
    errors = me.mocap_errors(pd.concat(tables), reference)
    table = me.median_differences(errors, draws=Draws(50)).set_index(["detector", "other"])
    worse = table.loc[("other", "one")]
    assert len(worse) == 2 * len(me.JOINTS)
    assert worse[["value_m", "low_m", "high_m"]].to_numpy() == pytest.approx(0.01)
    assert table.loc[("one", "other"), "value_m"].to_numpy() == pytest.approx(-0.01)
    medians = me.median_errors(errors, draws=Draws(50))
    assert (medians["high_m"] - medians["low_m"] > 0.01).all()


def test_what_a_higher_threshold_changes_has_an_interval(reference):
    points = lifted(reference, np.where(reference["frame"] % 3 == 0, 0.01, 0.05))
    points["score"] = np.where(reference["frame"] % 3 == 0, 0.9, 0.2)
    errors = me.mocap_errors(points, reference)
    table = me.median_differences(errors, "min_score", draws=Draws(50)).set_index(["min_score", "other"])
    assert table.loc[(0.3, 0.1), "value_m"].to_numpy() == pytest.approx(-0.04)
    assert table.loc[(0.1, 0.3), "value_m"].to_numpy() == pytest.approx(0.04)
    found = me.median_errors(errors, draws=Draws(50)).set_index("min_score")[
        ["found_low", "found", "found_high"]
    ]
    assert found.loc[0.3, "found"].to_numpy() == pytest.approx(1 / 3)
    assert found.loc[0.1].to_numpy() == pytest.approx(np.tile([0.025 ** (1 / 60), 1, 1], (6, 1)))
    assert (found.loc[0.3, "found_low"] < 1 / 3).all() and (found.loc[0.3, "found_high"] > 1 / 3).all()


def test_scores_must_be_above_and_distances_at_most_the_limit(reference):
    errors = me.mocap_errors(lifted(reference, score=0.3), reference).assign(error_m=0.05)
    medians = me.median_errors(errors, draws=Draws(5)).set_index("min_score")["count"]
    assert set(medians[0.3]) == {0} and set(medians[0.1]) == {N}
    within = me.distance_shares(errors, (0.1,), (np.nextafter(0.05, 0), 0.05), draws=Draws(5))
    assert within.groupby("threshold_m")["value"].max().tolist() == [0, 1]
    assert me.distance_shares(errors, (0.3,), (0.05,), draws=Draws(5))["value"].eq(0).all()


def test_people_are_drawn_and_a_comparison_says_what_it_could_detect(reference):
    """Twelve people; in each one detector is worse than another, by .5 to 1.5 cm."""
    worse_m = np.linspace(0.005, 0.015, 12)
    rng = np.random.default_rng(0)
    people = []
    for more_m in worse_m:
        noise_m = rng.uniform(0.02, 0.03, len(reference))
        both = [
            lifted(reference, noise_m, detector="one"), lifted(reference, noise_m + more_m, detector="other"),
        ]  # fmt: skip
        people.append(me.mocap_errors(pd.concat(both), reference))
    errors = over_people(people, [N] * 12)
    medians = me.median_errors(errors, draws=Draws(200))
    assert (medians["n_people"] == 12).all() and (medians["n_frames"] == 12 * N).all()
    pairs = (
        me.median_differences(errors, draws=Draws(200)).set_index(["detector", "other"]).loc[("other", "one")]
    )
    assert (pairs["n_people"] == 12).all()
    assert pairs["value_m"].to_numpy() == pytest.approx(0.01, abs=0.002)
    least_m = smallest_difference(worse_m)
    assert pairs["detectable_m"].to_numpy() == pytest.approx(least_m, rel=1e-6)
    assert (pairs["low_m"] > 0.005).all() and (pairs["high_m"] - pairs["low_m"] > least_m / 2).all()
    shares = me.distance_shares(errors, draws=Draws(20))
    assert (shares["n_people"] == 12).all()
    few = me.median_errors(errors[errors["subject"] < 5], draws=Draws(20))
    assert few["low_m"].isna().all() and (few["n_people"] == 5).all()
