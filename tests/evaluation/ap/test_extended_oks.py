"""Extended OKS: the numbers of its authors' tool, and what it is made to tell apart."""

import json
from dataclasses import replace

import numpy as np
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.core.files import write_json
from hicp_lib.core.keypoints import COCO_17, SIGMAS
from hicp_lib.evaluation.ap.evaluate import evaluate
from hicp_lib.evaluation.ap.extended_oks import extended_oks, known_flags
from hicp_lib.evaluation.ap.options import definitions
from hicp_lib.formats.annotations import read_annotations
from hicp_lib.formats.cropcoco import OUTSIDE
from hicp_lib.formats.detections import read_detections
from tests.evaluation.ap.cropped_people import NUMBERS, SEEDS, cropped_people
from tests.evaluation.made_people import make_annotations, make_detections


def files(folder, seed):
    truth, results = cropped_people(seed)
    write_json(folder / "truth.json", truth)
    write_json(folder / "results.json", results)
    people = read_annotations(folder / "truth.json")
    return people, read_detections(folder / "results.json", people)


def pairwise(people, found, cut=0.5):
    truth_px, flags = people.keypoints_px[:, None, COCO_17], known_flags(people)[:, None, COCO_17]
    points_px, scores = found.keypoints_px[None, :, COCO_17], found.scores[None, :, COCO_17]
    person = people.boxes_px[:, None], people.areas_px2[:, None]
    return extended_oks(truth_px, flags, *person, points_px, scores >= cut, SIGMAS["halpe"][COCO_17])


@pytest.mark.parametrize("seed", SEEDS)
def test_is_what_the_authors_tool_gives(tmp_path, seed):
    people, found = files(tmp_path, seed)
    expected = json.loads(NUMBERS.read_text())[str(seed)]
    for image_id, similarity in expected["similarity"].items():
        here, of_image = people.take(people.image_ids == int(image_id)), found[int(image_id)]
        surest_first = np.argsort(-of_image.person_scores, kind="stable")
        ours = pairwise(here, of_image)[:, surest_first].T
        assert ours == pytest.approx(np.reshape(similarity, ours.shape), abs=1e-12)
    ours = evaluate(people, found, outside="count")
    assert ours.metrics() == pytest.approx(expected["metrics"], abs=1e-12)
    assert 0.05 < ours.AP < 0.95  # a case that says something


# ---- a person of 60 x 60 px, whose window reaches from (92.5, 80) to (167.5, 180)
BOX = [[100.0, 100.0, 60.0, 60.0]]
NOSE = 0


def judged(detection, *, nose_outside, cut=0.5):
    """Extended OKS of a person of whom only the nose, at (120, 110), is known."""
    flags = np.zeros((1, 136))
    flags[0, NOSE] = OUTSIDE if nose_outside else 2
    people = make_annotations(np.full((1, 136, 2), [120.0, 110.0]), [1], visibility=flags, boxes_px=BOX)
    return float(pairwise(people, detection, cut)[0, 0])


def nose_at(x, y, score=0.9):
    points = np.full((1, 136, 2), np.nan)
    points[0, NOSE] = x, y
    scores = np.zeros((1, 136))
    scores[0, NOSE] = score
    return Detections(points, scores, np.ones(1))


def test_a_point_outside_is_right_when_declared_absent_and_wrong_when_given_inside():
    assert judged(nose_at(130, 130, score=0.4), nose_outside=True) == 1
    assert judged(make_detections(np.full((1, 136, 2), np.nan)), nose_outside=True) == 1
    assert judged(nose_at(130, 130), nose_outside=True) < 0.001
    assert judged(nose_at(92.5, 80), nose_outside=True) == 1  # in the corner: forgiven


def test_a_point_inside_is_placed_when_declared_present_and_lost_when_declared_absent():
    assert judged(nose_at(120, 110), nose_outside=False) == 1
    assert judged(nose_at(120, 110, score=0.4), nose_outside=False) < 0.001
    assert judged(nose_at(120, 110, score=0.4), nose_outside=False, cut=0.4) == 1


def test_the_distance_to_the_window_is_to_its_nearest_upright_and_level_edge():
    # (27.5, 30) from the upper left corner
    expected = np.exp(-(27.5**2 + 30**2) / (2 * 0.026) ** 2 / 20_000 / 2)
    assert judged(nose_at(120, 110, score=0), nose_outside=False) == pytest.approx(expected)


def test_where_nothing_is_outside_and_all_is_given_it_is_plain_oks(scene):
    people, found = scene(3)
    people = people.take((people.visibility[:, COCO_17] > 0).any(axis=1))  # the others' windows forgive less
    found = {i: replace(of, scores=np.ones_like(of.scores)) for i, of in found.items()}
    assert evaluate(people, found, outside="count").metrics() == evaluate(people, found).metrics()


def test_points_outside_are_left_out_of_plain_oks_and_of_the_visible_ones(tmp_path):
    people, found = files(tmp_path, 0)
    without = replace(people, visibility=np.maximum(people.visibility, 0))
    for labelled in ("all", "visible"):
        ours, expected = (evaluate(of, found, labelled=labelled) for of in (people, without))
        assert ours.metrics() == expected.metrics()
    assert evaluate(people, found, labelled="visible", outside="count").AP not in (0, ours.AP)


def test_extended_oks_stands_beside_oks_only_where_points_outside_are_known(scene, tmp_path):
    assert all("outside" not in way for _, way in definitions(scene(3)[0], "body"))
    assert ("body", {"labelled": "all", "outside": "count"}) in definitions(files(tmp_path, 0)[0], "body")
