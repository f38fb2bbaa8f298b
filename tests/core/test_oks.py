"""OKS against pycocotools and against values worked out by hand."""

import contextlib
import io

import numpy as np
import pytest
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

from hicp_lib.core.keypoints import GROUPS, INDEX, SIGMAS
from hicp_lib.core.oks import oks, oks_terms


def by_pycocotools(truth, labelled, boxes, areas, found, sigmas) -> np.ndarray:
    """OKS of n_images x n_found x n_people, by COCOeval.computeOks."""
    coco, results = COCO(), COCO()
    n_images, n_people, n_found = len(truth), truth.shape[1], found.shape[1]
    gts = [
        {"id": 1 + i * n_people + j, "image_id": i, "category_id": 1, "iscrowd": 0, "area": areas[i, j],
         "bbox": boxes[i, j].tolist(), "num_keypoints": int(labelled[i, j].sum()),
         "keypoints": np.concatenate([truth[i, j], labelled[i, j][:, None]], axis=1).ravel().tolist()}
        for i in range(n_images) for j in range(n_people)
    ]  # fmt: skip
    dts = [
        {"id": 1 + i * n_found + j, "image_id": i, "category_id": 1, "area": 1.0, "score": 1.0,
         "keypoints": np.concatenate([found[i, j], np.ones((len(sigmas), 1))], axis=1).ravel().tolist()}
        for i in range(n_images) for j in range(n_found)
    ]  # fmt: skip
    with contextlib.redirect_stdout(io.StringIO()):
        for index, rows in ((coco, gts), (results, dts)):
            index.dataset = {"images": [{"id": i} for i in range(n_images)], "categories": [{"id": 1}]}
            index.dataset["annotations"] = rows
            index.createIndex()
        evaluation = COCOeval(coco, results, "keypoints")
    evaluation.params.kpt_oks_sigmas = sigmas
    evaluation._prepare()
    return np.array([evaluation.computeOks(i, 1) for i in range(n_images)])


@pytest.mark.parametrize(("group", "sigmas"), [("body", "halpe"), ("hand", "halpe"), ("hand", "wholebody")])
def test_agrees_with_pycocotools_on_ten_thousand_sets(group, sigmas):
    rng = np.random.default_rng(4)
    n_images, n_people, n_found, k = 170, 5, 12, len(GROUPS[group])
    sigmas = SIGMAS[sigmas][GROUPS[group]]
    truth = rng.uniform(0, 600, (n_images, n_people, k, 2))
    labelled = rng.random((n_images, n_people, k)) < rng.choice([0, 0.1, 0.6, 1], (n_images, n_people, 1))
    boxes = np.concatenate([truth.min(axis=2), np.ptp(truth, axis=2) * rng.choice([0, 0.2, 1])], axis=-1)
    areas = 10 ** rng.uniform(-1, 6, (n_images, n_people))
    nearest = truth[:, rng.integers(n_people, size=n_found)]
    found = nearest + rng.normal(0, 1, nearest.shape) * 10 ** rng.uniform(-2, 2.5, (n_images, n_found, 1, 1))
    expected = by_pycocotools(truth, labelled, boxes, areas, found, sigmas)
    ours = oks(truth[:, None], labelled[:, None], boxes[:, None], areas[:, None], found[:, :, None], sigmas)
    assert expected.size > 10_000
    unlabelled = ~labelled.any(axis=-1)
    assert 500 < unlabelled.sum() * n_found < expected.size / 2  # that branch is well covered
    assert np.abs(ours - expected).max() < 1e-12
    assert ((expected > 0.05) & (expected < 0.95)).mean() > 0.1  # not only zeros and ones


def one_term(distance_px: float, area_px2: float, sigma: float) -> float:
    found = np.array([[100 + distance_px, 50.0]])
    return float(oks_terms(found - np.array([[100.0, 50.0]]), area_px2, np.array([sigma]))[0])


def test_values_worked_out_by_hand():
    # A term is 1/2 at d = k sqrt(2 A ln 2): for A = 20,000 px, 5.0 px at k = .03, 20.6 px at a wrist's .124.
    hand, wrist = SIGMAS["halpe"][INDEX["left_index_4"]], SIGMAS["halpe"][INDEX["left_wrist"]]
    half_px = np.sqrt(2 * 20_000 * np.log(2))
    assert round(0.03 * half_px, 1) == 5.0 and round(0.124 * half_px, 1) == 20.6
    assert one_term(0.03 * half_px, 20_000, hand) == pytest.approx(0.5, abs=1e-12)
    assert one_term(0.124 * half_px, 20_000, wrist) == pytest.approx(0.5, abs=1e-12)
    # d = s k gives exp(-1/2).
    assert one_term(0.124 * 100, 10_000, wrist) == pytest.approx(np.exp(-0.5), abs=1e-12)
    assert one_term(0, 20_000, hand) == 1
    # The same error at the hand's root is .50 by Halpe's sigma and .83 by COCO-WholeBody's.
    root = SIGMAS["wholebody"][INDEX["left_hand_root"]]
    assert round(one_term(0.03 * half_px, 20_000, root), 2) == 0.83


def test_a_missing_keypoint_counts_zero_and_an_unlabelled_one_not_at_all():
    truth = np.zeros((4, 2))
    found = np.array([[0, 0], [np.nan, np.nan], [0, 0], [1e6, 1e6]])
    labelled = np.array([True, True, False, False])
    sigmas, box = np.full(4, 0.05), np.array([0, 0, 10, 10.0])
    assert oks_terms(found - truth, 1000.0, sigmas).tolist() == [1, 0, 1, 0]
    assert oks(truth, labelled, box, 1000.0, found, sigmas) == 0.5


def test_a_person_without_labelled_keypoints_is_the_grown_box():
    truth, labelled = np.full((2, 2), np.nan), np.zeros(2, dtype=bool)
    box, sigmas = np.array([100, 100, 20, 40.0]), np.full(2, 0.05)
    on_the_border = np.array([[80, 60], [140, 180.0]])  # [x - w, x + 2w] x [y - h, y + 2h]
    assert oks(truth, labelled, box, 2000.0, on_the_border, sigmas) == 1
    outside = on_the_border + [[-3, 0], [0, 4]]
    expected = (np.exp(-9 / 0.01 / 2000 / 2) + np.exp(-16 / 0.01 / 2000 / 2)) / 2
    assert oks(truth, labelled, box, 2000.0, outside, sigmas) == pytest.approx(expected, abs=1e-12)
