"""The budget of errors that were put in: each source comes out alone, and its gain."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.evaluation.space import error_budget as b
from hicp_lib.evaluation.space import error_sources as s
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.recordings.recording import read_truth
from tests.evaluation.space.wall import BEHIND_M, CAMERA, DEPTH_ERROR_M, NOTHING, WALL_M, N, wall_recording

PIXEL_ERROR_PX, OFFSET_RAD, SHARE = 6.0, 0.01, 0.02


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return wall_recording(tmp_path_factory.mktemp("lab") / "upper")


@pytest.fixture(scope="module")
def found(recording):
    rng = np.random.default_rng(1)
    return [
        replace(person, keypoints_px=person.keypoints_px + rng.normal(0, PIXEL_ERROR_PX, (1, 136, 2)))
        for person in s.true_detections(read_truth(recording), N)
    ]


@pytest.fixture(scope="module")
def errors(recording, found):
    amounts = replace(NOTHING, joint_offset_rad=OFFSET_RAD, focal_share=SHARE)
    return b.keypoint_errors(recording, found, None, amounts, seed=2)


def of_paper(errors, source):
    return errors.loc[errors["method"] == "paper", f"{source}, alone"]


def test_all_sets_are_judged_on_the_same_keypoints(errors):
    assert set(errors["part"]) == {"wrist", "elbow", "shoulder"}
    counts = errors.groupby(["method", "keypoint"]).size()
    assert counts.nunique() == 1 and counts.iloc[0] >= N - 4
    assert errors[list(b.STATES)].notna().all(axis=None)
    assert errors["hidden"].eq(errors["part"] == "elbow").all()


def test_errors_put_in_come_out_alone(errors):
    ray = errors["distance_m"] / -WALL_M  # a little more than 1, and depths are along the axis
    assert of_paper(errors, s.SKIN).median() == pytest.approx(BEHIND_M, rel=0.15)
    assert of_paper(errors, s.SENSOR).median() == pytest.approx(DEPTH_ERROR_M * ray.median(), rel=0.25)
    sigma_m = PIXEL_ERROR_PX / CAMERA.fx_px * (-WALL_M)
    rayleigh = np.sqrt(2 * np.log(2))  # its median
    assert of_paper(errors, s.PIXEL).median() == pytest.approx(rayleigh * sigma_m, rel=0.25)
    for absent in (s.MOUNT, s.MARKERS, s.REGISTRATION, s.CLOCK):
        assert of_paper(errors, absent).max() < 1e-9


def test_wrong_intrinsics_move_keypoints_off_the_middle_of_the_image(errors, recording):
    share = np.random.default_rng(2).normal(0, SHARE)
    truth = read_truth(recording).set_index(["frame", "keypoint"])
    rows = errors[errors["method"] == "paper"]
    at = truth.loc[list(zip(rows["frame"], rows["keypoint"], strict=True))]
    sine = np.linalg.norm(
        (at[["u_px", "v_px"]].to_numpy() - (CAMERA.cx_px, CAMERA.cy_px)) / (CAMERA.fx_px, CAMERA.fy_px),
        axis=1,
    )
    depth_m = rows["distance_m"].to_numpy() / np.sqrt(1 + sine**2)
    expected_m = abs(1 / (1 + share) - 1) * sine * depth_m
    np.testing.assert_allclose(rows[f"{s.INTRINSICS}, alone"], expected_m, rtol=1e-6)


def test_joint_offsets_move_as_the_camera_that_they_move(errors, recording):
    rng = np.random.default_rng(2)
    amounts = replace(NOTHING, joint_offset_rad=OFFSET_RAD, focal_share=SHARE)
    s.wrong_intrinsics(recording.intrinsics, amounts, rng)
    off = s.wrong_poses(recording, amounts, rng)[True, False] @ np.linalg.inv(recording.T_base_cam)
    row = errors[errors["method"] == "robust"].iloc[0]
    truth = read_truth(recording)
    at = truth[(truth["frame"] == row["frame"]) & (truth["keypoint"] == row["keypoint"])].iloc[0]
    true_m = at[["x_m", "y_m", "z_m"]].to_numpy(float)
    moved_m = off[row["frame"], :3, :3] @ true_m + off[row["frame"], :3, 3]
    assert row[f"{s.OFFSETS}, alone"] == pytest.approx(np.linalg.norm(moved_m - true_m), abs=1e-6)


def test_a_limb_along_the_line_of_sight_points_at_the_camera(errors, recording):
    truth = read_truth(recording).set_index(["frame", "keypoint"])
    rows = errors[errors["method"] == "paper"]
    for part, ends in (("wrist", ("elbow", "wrist")), ("shoulder", ("elbow", "shoulder"))):
        row = rows[rows["part"] == part].iloc[0]
        side = row["keypoint"].partition("_")[0]
        near, far, at = (
            truth.loc[(row["frame"], name), ["x_m", "y_m", "z_m"]].to_numpy(float)
            for name in (*(f"{side}_{joint}" for joint in ends), row["keypoint"])
        )
        limb, sight = far - near, at - recording.T_base_cam[row["frame"], :3, 3]
        cosine = limb @ sight / np.linalg.norm(limb) / np.linalg.norm(sight)
        assert row["towards_camera"] == pytest.approx(abs(cosine))
        assert row["distance_m"] == pytest.approx(np.linalg.norm(sight))


def test_motion_capture_moves_the_reference(recording, found, monkeypatch):
    def shifts_m(recording, true_m, T_base_mocap, amounts, rng):
        markers_m = np.full_like(true_m, 0.01)
        markers_m[3] = np.nan  # a marker that was not measured
        return {s.MARKERS: markers_m, s.CLOCK: np.full_like(true_m, (0.0, 0.0, 0.02))}

    monkeypatch.setattr(s, "reference_shifts", shifts_m)
    errors = b.keypoint_errors(recording, found, np.eye(4), NOTHING)
    assert 3 not in set(errors["frame"])
    np.testing.assert_allclose(errors[f"{s.MARKERS}, alone"], 0.01 * np.sqrt(3), atol=1e-6)
    np.testing.assert_allclose(errors[f"{s.CLOCK}, alone"], 0.02, atol=1e-6)
    # nothing else of motion capture is off: the robot's frame differs by both
    without = b.keypoint_errors(recording, found, None, NOTHING)
    both = errors.merge(without, on=["method", "keypoint", "frame"], suffixes=("", "_without"))
    np.testing.assert_allclose(both[b.IN_BASE], both[f"{b.ALL}_without"], atol=1e-6)
    np.testing.assert_allclose(both[b.AGAINST_MOCAP], both[b.ALL], atol=1e-6)
    assert (both[b.ALL] - both[b.IN_BASE]).abs().median() > 0.005


def test_every_so_many_frames_count_by_their_own_number(recording, found, errors):
    some = b.keypoint_errors(recording, found, None, NOTHING, every=5)
    assert set(some["frame"]) == set(range(0, N, 5))
    columns = ["keypoint", "frame", f"{s.SKIN}, alone"]
    both = some.loc[some["method"] == "paper", columns].merge(
        errors[errors["method"] == "paper"], on=columns[:2]
    )
    assert len(both) > 20
    np.testing.assert_allclose(both[f"{columns[2]}_x"], both[f"{columns[2]}_y"])


def test_what_is_not_found_or_not_sure_does_not_count(recording, found):
    unsure = [replace(person, scores=np.full((1, 136), 0.05)) for person in found]
    nobody = [Detections.none()] * N
    for detections in (unsure, nobody):
        assert b.keypoint_errors(recording, detections, None, NOTHING).empty


def made_up(n_people, noise=0.0):
    """Errors of people: skin depth alone 3 cm, everything 5 cm, 4 cm without it; one person 1 cm worse."""
    rng, rows = np.random.default_rng(0), []
    for subject in range(n_people):
        row = dict.fromkeys(b.STATES, 0.0) | {
            b.ALL: 0.05,
            f"{s.SKIN}, alone": 0.03,
            f"without {s.SKIN}": 0.04,
        }
        row |= {b.IN_BASE: 0.05, b.AGAINST_MOCAP: 0.045}
        row |= {f"{s.REGISTRATION}, alone": 0.01, f"without {s.REGISTRATION}": 0.05}
        worse = 0.01 * (subject == 0)
        row = {state: value + worse * (value > 0) for state, value in row.items()}
        labels = {"view": "upper", "subject": subject, "method": "paper", "part": "wrist"}
        for frame in range(5):
            x = {
                "distance_m": rng.uniform(0.5, 1.5),
                "towards_camera": rng.uniform(),
                "hidden": bool(frame % 2),
            }
            rows.append(labels | {"frame": frame} | x | row)
    return pd.DataFrame(rows)


def test_the_budget_is_the_mean_of_peoples_medians():
    table = b.error_budget(made_up(12), draws=Draws(200)).set_index(["source", "kind"])
    both = [(source, kind) for source in (s.SKIN, s.REGISTRATION) for kind in ("alone", "gain")]
    assert list(table.index) == [
        *((total, "total") for total in b.TOTALS),
        *both,
    ]  # what moves nothing is not
    assert table.loc[(s.SKIN, "alone"), "value_m"] == pytest.approx(0.03 + 0.01 / 12)
    assert table.loc[(s.SKIN, "gain"), "value_m"] == pytest.approx(0.01)
    assert table.loc[(b.AGAINST_MOCAP, "total"), "value_m"] == pytest.approx(0.045 + 0.01 / 12)
    low_m, value_m, high_m = table.loc[(s.SKIN, "alone"), ["low_m", "value_m", "high_m"]]
    assert low_m < value_m < high_m
    assert (table["n_people"] == 12).all() and (table["n"] == 60).all()


def test_without_motion_capture_there_is_one_total():
    errors = made_up(3).assign(**{f"{s.REGISTRATION}, alone": 0.0})
    assert list(b.error_budget(errors)["source"]) == [b.ALL, s.SKIN, s.SKIN]


def test_few_people_have_no_interval():
    table = b.error_budget(made_up(3), draws=Draws(200))
    assert table["low_m"].isna().all() and table["value_m"].notna().all()


def test_covariates_come_out_as_factors():
    errors = made_up(12)
    errors[b.IN_BASE] = 0.02 * 1.1 ** (errors["distance_m"] / 0.1) * 2.0 ** errors["hidden"]
    table = b.covariates(errors, draws=Draws(50)).set_index("covariate")
    assert table["factor"].to_dict() == pytest.approx(
        {"10 cm further away": 1.1, "limb at the camera, not across": 1.0, "hidden": 2.0}
    )
    assert (table["low"] <= table["factor"] + 1e-9).all() and (table["factor"] <= table["high"] + 1e-9).all()


def test_a_covariate_that_never_changes_has_no_factor():
    table = b.covariates(made_up(12).assign(hidden=False), draws=Draws(50))
    assert "hidden" not in set(table["covariate"]) and len(table) == 2
