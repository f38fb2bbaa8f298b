"""Dose curves: what is counted at which level."""

import numpy as np
import pytest

from hicp_lib.core.images import write_png
from hicp_lib.evaluation.failures.dose_curves import OBSERVED, dose_curves, observed_curves, observed_doses
from hicp_lib.evaluation.failures.error_kinds import all_errors
from hicp_lib.evaluation.statistics.resampling import Draws
from tests.evaluation.made_people import make_annotations, make_detections

POINTS = np.random.default_rng(5).uniform(50, 400, (136, 2))


def test_every_level_is_judged_by_itself_and_hidden_keypoints_apart():
    flags = np.full((4, 136), 2.0)
    flags[:, 10:17] = 1
    extras = [{"dose": "dark", "level": float(i // 2), "source_image_id": i % 2} for i in range(4)]
    people = make_annotations(np.stack([POINTS] * 4), range(4), visibility=flags, extras=extras)
    # At level 1 nobody is found, and at level 0 the hidden keypoints are wrong.
    points = POINTS.copy()
    points[10:17] += 1_000
    run = {i: make_detections(points[None] if i < 2 else np.zeros((0, 136, 2))) for i in range(4)}
    table = dose_curves(people, {"mediapipe-pose": run}, draws=Draws(10))
    value = table.set_index(["level", "measure"])["value"]
    assert value[0, "visible keypoints hit"] == 1 and value[0, "hidden keypoints hit"] == 0
    assert value[1, "visible keypoints hit"] == value[1, "AP"] == 0
    assert 0 < value[0, "AP"] < 1 and set(table["dose"]) == {"dark"}


def test_doses_are_read_off_the_crops_and_their_source(tmp_path):
    image = np.full((480, 640, 3), 77, np.uint8)
    write_png(tmp_path / "images" / "0.png", image)
    flags = np.zeros((1, 136))
    flags[0, :10], flags[0, :4] = 2, 1
    people = make_annotations(POINTS[None], [0], visibility=flags, extras=[{"source_id": 3}])
    source = make_annotations(POINTS[None], [0], first_id=3, extras=[{"distance_m": 1.25}])
    table = observed_doses({"basic": people}, {"basic": tmp_path}, source)
    assert table["keypoint"].tolist() == list(range(10))
    row = table.iloc[0]
    assert row["share of keypoints in the picture"] == pytest.approx(10 / 17)
    assert row["share of keypoints hidden"] == pytest.approx(0.4)
    assert row["distance"] == 1.25 and row["brightness"] == 77
    assert row["picture"] == pytest.approx(np.sqrt(640 * 480))
    u, v = POINTS[0] + 0.5
    assert row["distance to the border"] == pytest.approx(min(u, v, 640 - u, 480 - v) / 480)


def test_bins_of_a_dose_hold_equally_many_keypoints():
    n = 60
    people = make_annotations(np.stack([POINTS] * n), range(n))
    run = {i: make_detections(POINTS[None]) for i in range(n // 2)}
    errors = all_errors({"basic": people}, {("basic", "mediapipe-pose"): run})
    observed = errors[["subset", "image_id", "keypoint"]].assign(**dict.fromkeys(OBSERVED, np.nan))
    observed["distance"] = observed["image_id"].astype(float)
    table = observed_curves(errors, observed, draws=Draws(5))
    assert table["dose"].unique().tolist() == ["distance"]
    assert table["n"].tolist() == [12 * 17] * 5 and table["level"].is_monotonic_increasing
    assert table["value"].tolist() == [1, 1, 0.5, 0, 0]
