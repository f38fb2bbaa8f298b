"""The bootstrap: the same AP as of the images drawn, and intervals that are right."""

from dataclasses import replace

import numpy as np
import pytest

from hicp_lib.evaluation.ap import bootstrap, cocoeval
from hicp_lib.evaluation.ap.bootstrap import bootstrap_intervals, difference, resample
from hicp_lib.evaluation.ap.evaluate import evaluate
from hicp_lib.evaluation.statistics.resampling import Draws


@pytest.mark.parametrize("seed", range(4))
def test_a_draw_is_an_evaluation_of_the_images_drawn(scene, seed):
    annotations, detections = scene(seed, n_images=15)
    weights = np.random.default_rng(seed).integers(0, 4, 15)
    drawn = np.repeat(np.arange(15), weights)
    people, copies, images = [], [], {}
    for new_id, image_id in enumerate(drawn.tolist()):
        rows = np.flatnonzero(annotations.image_ids == image_id)
        people.append(rows)
        copies.append(np.full(len(rows), new_id))
        images[new_id] = replace(annotations.images[image_id], id=new_id)
    rows = np.concatenate(people)
    doubled = replace(
        annotations.take(rows), images=images, ids=np.arange(len(rows)) + 1, image_ids=np.concatenate(copies)
    )
    expected = evaluate(doubled, {new: detections[old] for new, old in enumerate(drawn.tolist())})
    ours = cocoeval.metrics(*cocoeval.precision_recall(evaluate(annotations, detections).matches, weights))
    assert ours == pytest.approx(expected.metrics(), abs=1e-12)


def test_draws_together_are_the_draws_one_by_one(scene, monkeypatch):
    evaluation = evaluate(*scene(1))
    (together,) = resample([evaluation], Draws(25, 4))
    monkeypatch.setattr(bootstrap, "_BLOCK", 1)
    (alone,) = resample([evaluation], Draws(25, 4))
    assert all(np.array_equal(together[metric], alone[metric]) for metric in together)
    assert len(set(together["AP"])) > 20


def found_or_not(annotated, detected, found: np.ndarray):
    """One person per image, found exactly or not at all: AR is the share found."""
    person = np.random.default_rng(0).uniform(100, 300, (136, 2))
    annotations = annotated([person] * len(found), range(len(found)))
    return evaluate(annotations, {i: detected([person]) for i in np.flatnonzero(found).tolist()})


def test_the_interval_of_a_share_is_the_binomials(annotated, detected):
    found = np.arange(400) % 10 < 7
    figures = bootstrap_intervals(found_or_not(annotated, detected, found), Draws(seed=3))
    half_width = 1.96 * np.sqrt(0.7 * 0.3 / 400)
    assert figures["AR"] == pytest.approx((0.7, 0.7 - half_width, 0.7 + half_width), abs=0.01)
    assert figures["AR"][0] == 0.7
    assert list(figures) == ["AP", "AP50", "AP75", "AR", "AR50", "AR75"]


def test_images_of_a_cluster_are_drawn_together(annotated, detected):
    found = np.repeat(np.arange(40) % 10 < 7, 10)
    evaluation = found_or_not(annotated, detected, found)
    alone, together = (
        bootstrap_intervals(evaluation, Draws(seed=3), clusters)["AR"]
        for clusters in (None, {i: i // 10 for i in range(400)})
    )
    # Ten equal images say no more than one: the interval is that of 40, wider by sqrt(10).
    ratio = (together[2] - together[1]) / (alone[2] - alone[1])
    assert ratio == pytest.approx(np.sqrt(10), rel=0.15)


def test_a_detector_does_not_differ_from_itself(scene):
    evaluation = evaluate(*scene(0))
    figures = difference(evaluation, evaluation, *resample([evaluation] * 2, Draws(50)))
    assert set(figures.values()) == {(0, 0, 0)}


def test_pairing_takes_the_images_share_out_of_a_difference(annotated, detected):
    found = np.arange(300) % 2 == 0
    all_but_ten = found & (np.arange(300) >= 20)
    a, b = (found_or_not(annotated, detected, f) for f in (found, all_but_ten))
    value, low, high = difference(a, b, *resample([a, b], Draws(seed=1)))["AR"]
    assert value == pytest.approx(10 / 300)
    # A share of 10 in 300, not the difference of two independent halves (half width .08).
    assert low > 0.01 and high < 0.06


def test_subsets_are_paired_by_image_id(annotated, detected, monkeypatch):
    monkeypatch.setattr(bootstrap, "MIN_DRAWN", 2)
    # Images 0-9, all found, are drawn together, and so are 10-29, none found; b has only the latter.
    a = found_or_not(annotated, detected, np.arange(30) < 10)
    later = {name: getattr(a.matches, name)[10:] for name in ("image_ids", "n_people")}
    none = {name: getattr(a.matches, name)[..., :0] for name in ("image_rows", "is_true", "is_false")}
    b = replace(a, matches=replace(a.matches, **later, **none))
    of_a, of_b = resample([a, b], Draws(40), clusters={i: i < 10 for i in range(30)})
    assert set(of_a["AR"].round(3)) == {0, 0.333, 1}
    nobody = np.isnan(of_b["AR"])
    assert np.array_equal(nobody, of_a["AR"].round(3) == 1) and (of_b["AR"][~nobody] == 0).all()


def test_a_handful_of_images_has_figures_and_no_interval(annotated, detected):
    for n, has_interval in ((9, False), (10, True)):
        figures = bootstrap_intervals(found_or_not(annotated, detected, np.arange(n) % 2 == 0), Draws(20))
        finite = np.isfinite(np.array(list(figures.values())))
        assert finite.tolist() == [[True, has_interval, has_interval]] * 6


def test_the_seed_decides(scene):
    evaluation = evaluate(*scene(2))
    first, again, other = (bootstrap_intervals(evaluation, Draws(100, seed)) for seed in (7, 7, 8))
    assert first == again and first != other


def test_nobody_there_gives_no_interval(annotated):
    nobody = evaluate(annotated(np.zeros((0, 136, 2)), [], n_images=3), {})
    assert np.isnan(list(bootstrap_intervals(nobody, Draws(10)).values())).all()
    no_images = replace(
        nobody, matches=replace(nobody.matches, image_ids=np.zeros(0, int), n_people=np.zeros(0, int))
    )
    assert np.isnan(list(bootstrap_intervals(no_images, Draws(10)).values())).all()


def test_that_nobody_is_found_is_not_certain_of_others(annotated, detected):
    nobody = found_or_not(annotated, detected, np.zeros(40, dtype=bool))
    assert bootstrap_intervals(nobody, Draws(50))["AP"] == pytest.approx((0, 0, 1 - 0.025 ** (1 / 40)))
    everybody = found_or_not(annotated, detected, np.ones(40, dtype=bool))
    assert bootstrap_intervals(everybody, Draws(50))["AR"] == pytest.approx((1, 0.025 ** (1 / 40), 1))
