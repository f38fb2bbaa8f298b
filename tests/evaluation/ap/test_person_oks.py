"""How well each person is found: by the best detection of the image, whoever counts."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.keypoints import COCO_17, SIGMAS
from hicp_lib.evaluation.ap.evaluate import in_parts
from hicp_lib.evaluation.ap.person_oks import PersonOks, person_oks

POINTS = np.random.default_rng(0).uniform(50, 400, (3, 136, 2))
AREA_PX2 = 20_000.0


def moved(oks: float) -> np.ndarray:
    """The first person with every body keypoint off by as much as the similarity says."""
    points = POINTS[0].copy()
    points[COCO_17, 0] += 2 * SIGMAS["halpe"][COCO_17] * np.sqrt(-2 * AREA_PX2 * np.log(oks))
    return points


def test_the_best_of_an_image_counts_for_who_counts(annotated, detected):
    flags = np.full((3, 136), 2.0)
    flags[1, COCO_17], flags[0, COCO_17[3]] = 0, 0
    people = annotated(POINTS, [0, 0, 1], visibility=flags, crowd=[2], areas_px2=AREA_PX2)
    table = person_oks(people, {0: detected(np.stack([moved(0.4), moved(0.6)]))})
    assert table["oks"].tolist() == [pytest.approx(0.6)] and table["n_labelled"].tolist() == [16]
    assert person_oks(people, {})["oks"].tolist() == [0.0]


@pytest.mark.parametrize("group", ["body", "hand", "each hand"])
def test_detections_of_an_image_may_come_in_any_parts(scene, group):
    annotations, detections = scene(3)
    best = PersonOks(annotations, group)
    for image_ids, found in in_parts(detections, annotations):
        for start in range(0, len(found), 2):
            part = slice(start, start + 2)
            best.add(image_ids[part], found.take(part))
    whole = person_oks(annotations, detections, group)
    assert len(whole) and whole["oks"].max() > 0.5
    pd.testing.assert_frame_equal(best.table(), whole, rtol=1e-14)
