"""Dose curves: what is counted at which level."""

import numpy as np

from hicp_lib.evaluation.failures.dose_curves import dose_curves
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
