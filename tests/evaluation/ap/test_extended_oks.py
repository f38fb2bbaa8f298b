"""Extended OKS: the numbers of its authors' tool, and what it is made to tell apart."""

import json

import numpy as np
import pytest

from hicp_lib.core.files import write_json
from hicp_lib.evaluation.ap.extended_oks import evaluate_extended, extended_oks
from hicp_lib.formats.annotations import read_annotations, read_detections
from tests.evaluation.ap.cropped_people import NUMBERS, SEEDS, cropped_people


def files(folder, seed):
    truth, results = cropped_people(seed)
    write_json(folder / "truth.json", truth)
    write_json(folder / "results.json", results)
    people = read_annotations(folder / "truth.json")
    return people, read_detections(folder / "results.json", people)


@pytest.mark.parametrize("seed", SEEDS)
def test_is_what_the_authors_tool_gives(tmp_path, seed):
    people, found = files(tmp_path, seed)
    expected = json.loads(NUMBERS.read_text())[str(seed)]
    for image_id, similarity in expected["similarity"].items():
        here, of_image = people.take(people.image_ids == int(image_id)), found[int(image_id)]
        surest_first = np.argsort(-of_image.person_scores, kind="stable")
        ours = extended_oks(here, of_image)[:, surest_first].T
        assert ours == pytest.approx(np.reshape(similarity, ours.shape), abs=1e-12)
    ours = evaluate_extended(people, found)
    assert ours.metrics() == pytest.approx(expected["metrics"], abs=1e-12)
    assert 0.05 < ours.AP < 0.95  # a case that says something
