"""`hicp evaluate`: detections are evaluated as they are read, and of each only a few numbers are kept."""

import tracemalloc

import numpy as np
import pytest

from hicp_lib.core.keypoints import GROUPS, N_KEYPOINTS
from hicp_lib.evaluation.ap.evaluate import in_parts
from hicp_lib.evaluation.ap.judgement import judge
from hicp_lib.formats import number_lists
from hicp_lib.formats.detections import detections_in_parts, write_detections
from tests.evaluation.made_people import make_annotations, make_detections

N_FOUND = 3
RNG = np.random.default_rng(0)
POINTS = RNG.uniform(100, 300, (200, N_KEYPOINTS, 2))


@pytest.fixture
def people_and_file(tmp_path):
    """Annotated people, one in an image, and a file of detections."""

    def made(n: int):
        spread = RNG.normal(0, 5, (N_FOUND, n, N_KEYPOINTS, 2))
        found = {i: make_detections(POINTS[i] + spread[:, i], [0.9, 0.5, 0.4]) for i in range(n)}
        write_detections(tmp_path / "d.json", found)
        return make_annotations(POINTS[:n], range(n)), found, tmp_path / "d.json"

    return made


def test_a_file_read_in_parts_is_judged_as_detections_in_memory(people_and_file, monkeypatch):
    people, found, path = people_and_file(40)
    whole = judge(people, in_parts(found, people), GROUPS, True)
    assert 0 < whole["AP"] < 1 and len(whole["by_image"]) == 3 * 40
    for n_bytes in (2**22, 10_000):
        monkeypatch.setattr(number_lists, "_BLOCK_BYTES", n_bytes)
        assert judge(people, detections_in_parts(path, people), GROUPS, True) == whole


def test_a_detection_takes_less_memory_than_its_keypoints(people_and_file, monkeypatch):
    monkeypatch.setattr(number_lists, "_BLOCK_BYTES", 2**16)
    peaks = []
    for n in (60, 200):
        people, _, path = people_and_file(n)
        tracemalloc.start()
        judge(people, detections_in_parts(path, people), GROUPS, True)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    of_keypoints = 3 * 8 * N_KEYPOINTS
    assert (peaks[1] - peaks[0]) / (140 * N_FOUND) < of_keypoints / 2
