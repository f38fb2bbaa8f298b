"""AP and AR: worked-out cases for every option, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import HANDS, SIGMAS
from hicp_lib.evaluation.ap.evaluate import Evaluator, evaluate, in_parts
from hicp_lib.evaluation.ap.person_oks import person_oks
from hicp_lib.formats.detections import read_detections, write_detections

RNG = np.random.default_rng(1)
PERSON = RNG.uniform(100, 300, (136, 2))
AWAY = PERSON + 5000
ONE = pytest.approx(1)  # pycocotools divides by the count plus 2e-16


@pytest.mark.parametrize("group", ["body", "hand"])
def test_everybody_and_everything_found_is_counted(scene, group):
    annotations, detections = scene(0)
    ours = evaluate(annotations, detections, group)
    assert ours.n_people + ours.n_ignored == len(annotations)
    assert ours.n_detections == sum(len(found) for found in detections.values())


@pytest.mark.parametrize("group", ["body", "hand"])
def test_the_truth_itself_scores_one(scene, group):
    annotations, _ = scene(5)
    detections = {
        i: Detections(points, np.isfinite(points[..., 0]).astype(float), np.linspace(1, 0.5, len(points)))
        for i in annotations.images
        for points in [annotations.keypoints_px[annotations.image_ids == i]]
    }
    figures = evaluate(annotations, detections, group).metrics()
    assert figures == dict.fromkeys(figures, 1.0)
    fits = person_oks(annotations, detections, group)
    assert (fits["oks"] == 1).all() and len(fits) == evaluate(annotations, detections, group).n_people


def test_missing_keypoints_cost_their_share(annotated, detected):
    found = PERSON.copy()
    found[13:17] = np.nan  # 13 of 17 exact: OKS .765, over six of the ten thresholds
    one = evaluate(annotated([PERSON], [3]), {3: detected([found])})
    assert one.metrics() == pytest.approx({"AP": 0.6, "AP50": 1, "AP75": 1, "AR": 0.6, "AR50": 1, "AR75": 1})
    assert person_oks(annotated([PERSON], [3]), {3: detected([found])})["oks"].tolist() == [
        pytest.approx(13 / 17)
    ]


def test_nobody_found_is_zero_and_nobody_there_is_not_a_number(annotated, detected):
    figures = evaluate(annotated([PERSON], [3]), {}).metrics()
    assert figures == dict.fromkeys(figures, 0.0)
    nobody = annotated(np.zeros((0, 136, 2)), [], n_images=2)
    for detections in ({}, {1: detected([PERSON])}):
        assert np.isnan(list(evaluate(nobody, detections).metrics().values())).all()


def test_ids_may_be_zero_negative_or_huge(annotated, detected):
    annotations = annotated([PERSON, PERSON], [0, -(2**62)], first_id=0)
    detections = {i: detected([PERSON]) for i in annotations.images}
    assert evaluate(annotations, detections).AP == ONE


def test_only_the_twenty_best_of_an_image_take_part(annotated, detected):
    found = [*[AWAY] * 20, PERSON]
    annotations = annotated([PERSON], [3])
    assert evaluate(annotations, {3: detected(found, np.linspace(1, 0.5, 21))}).AR == 0
    assert evaluate(annotations, {3: detected(found[1:], np.linspace(1, 0.5, 20))}).AR == 1


def test_says_nothing(scene, capsys):
    evaluate(*scene(0))
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("options", [{}, {"absent": "count"}, {"outside": "count"}, {"score": "group"}])
@pytest.mark.parametrize("group", ["body", "hand", "each hand"])
def test_detections_may_come_in_any_parts(scene, group, options):
    annotations, detections = scene(3)
    evaluator = Evaluator(annotations, group, **options)
    for image_ids, found in in_parts(detections, annotations):
        for of in (slice(start, start + 3) for start in range(0, len(found), 3)):
            evaluator.add(image_ids[of], found.take(of))
    whole = evaluate(annotations, detections, group, **options)
    assert evaluator.evaluation().row() == whole.row() and whole.n_people and whole.AP > 0


# ---- options, one case each


def person_and_unlabelled(annotated):
    """Image 1 with a labelled person; image 2 with one whose keypoints are not labelled."""
    visibility = np.array([np.full(136, 2.0), np.zeros(136)])
    box = [[*PERSON.min(axis=0), *np.ptp(PERSON, axis=0)]] * 2
    return annotated([PERSON, PERSON], [1, 2], visibility=visibility, boxes_px=box)


def test_unlabelled_people_forgive_detections_nearby_unless_dropped(annotated, detected):
    annotations = person_and_unlabelled(annotated)
    near = {1: detected([PERSON], [0.5]), 2: detected([PERSON], [0.9])}
    far = near | {2: detected([AWAY], [0.9])}
    assert evaluate(annotations, near).AP == ONE
    assert evaluate(annotations, near, unlabelled="drop").AP == pytest.approx(0.5)
    assert evaluate(annotations, far).AP == pytest.approx(0.5)
    assert (
        evaluate(annotations, near).n_ignored,
        evaluate(annotations, near, unlabelled="drop").n_ignored,
    ) == (1, 0)


def test_detections_without_the_group_are_dropped_unless_counted(annotated, detected):
    body_only = PERSON.copy()
    body_only[HANDS] = np.nan
    detections = {1: detected([PERSON], [0.5]), 2: detected([body_only], [0.9])}
    annotations = annotated([PERSON, PERSON], [1, 2])
    assert evaluate(annotations, detections, "hand").AP == pytest.approx(51 / 101)  # recall 1/2, all right
    counted = evaluate(annotations, detections, "hand", absent="count", score="person")
    assert counted.AP == pytest.approx(51 / 101 / 2) and counted.n_detections == 2  # behind a false positive
    assert evaluate(annotations, detections, "hand").n_detections == 1
    assert evaluate(annotations, detections, "body").AP == ONE


def test_absent_keypoints_match_nobody_not_even_the_unlabelled(annotated, detected):
    nothing = np.full((1, 136, 2), np.nan)
    detections = {1: detected([PERSON], [0.5]), 2: detected(nothing, [0.9])}
    annotations = person_and_unlabelled(annotated)
    assert evaluate(annotations, detections).AP == ONE
    assert evaluate(annotations, detections, absent="count").AP == pytest.approx(0.5)


def test_area_is_the_scale(annotated, detected):
    # All points off by d: OKS is exp(-d^2 / (2 A k^2)) averaged over the sigmas' k.
    annotations = annotated([PERSON], [1], areas_px2=9_000.0, boxes_px=[[100, 100, 200, 150.0]],
                            extras=[{"source_area": 12_000.0}])  # fmt: skip
    detections = {1: detected([PERSON + [6, 0]])}
    k = 2 * SIGMAS["halpe"][:17]
    for area, value in {"segment": 9_000, "box": 30_000, "box53": 15_900, "source": 12_000}.items():
        expected = np.exp(-36 / (2 * value * k**2)).mean()
        assert person_oks(annotations, detections, area=area)["oks"].item() == pytest.approx(
            expected, abs=1e-12
        )
        above = np.sum(np.linspace(0.5, 0.95, 10) <= expected) / 10
        assert evaluate(annotations, detections, area=area).AP == pytest.approx(above)
    with pytest.raises(InputError, match="annotation 1: has no 'source_area'"):
        evaluate(annotated([PERSON], [1]), detections, area="source")


def test_others_in_a_crop_forgive_unless_counted(annotated, detected):
    annotations = annotated([PERSON, AWAY], [1, 1], crowd=[1], extras=[{}, {"other": True}])
    detections = {1: detected([AWAY, PERSON], [0.9, 0.5])}
    assert evaluate(annotations, detections).AP == ONE
    assert evaluate(annotations, detections, others="count").AP == pytest.approx(0.5)


def test_visible_only_leaves_out_what_is_occluded(annotated, detected):
    """Half of the body occluded and misplaced: right where seen; who is not seen does not count."""
    found, visibility = PERSON.copy(), np.full((2, 136), 2.0)
    visibility[0, 8:17], visibility[1] = 1.0, 1.0
    found[8:17] += 5000
    annotations = annotated([PERSON, PERSON], [1, 2], visibility=visibility)
    detections = {1: detected([found]), 2: detected([PERSON])}
    both, seen = (evaluate(annotations, detections, labelled=which) for which in ("all", "visible"))
    assert (both.AR50, both.n_people) == (0.5, 2)  # 8 of 17 keypoints are less than one half
    assert (seen.AR, seen.n_people, seen.n_ignored) == (1, 1, 1)
    fits = person_oks(annotations, detections, labelled="visible")
    assert fits[["oks", "n_labelled"]].to_numpy().tolist() == [[1, 8]]


def test_each_hand_is_an_object_of_its_own(annotated, detected):
    """One of two hands is missing: one half of the pair, and nothing is lost of the other hand."""
    found = PERSON.copy()
    found[HANDS[21:]] = np.nan
    annotations, detections = annotated([PERSON], [1]), {1: detected([found])}
    pair, each = (evaluate(annotations, detections, group) for group in ("hand", "each hand"))
    assert (pair.AR, pair.AR50, pair.n_people) == (pytest.approx(0.1), 1, 1)
    assert (each.AR, each.n_people, each.n_detections) == (0.5, 2, 1)
    left, right = (evaluate(annotations, detections, f"{side} hand").AR for side in ("left", "right"))
    assert (left, right) == (1, 0)
    assert each.options.sigmas == "wholebody" and pair.options.sigmas == "halpe"


def test_a_hand_on_the_other_side_is_not_found(annotated, detected):
    swapped = PERSON.copy()
    swapped[HANDS] = np.concatenate([PERSON[HANDS[21:]], PERSON[HANDS[:21]]])
    assert evaluate(annotated([PERSON], [1]), {1: detected([swapped])}, "each hand").AR == 0


def test_each_hand_is_ranked_by_its_own_score(annotated, detected):
    """The left hand is sure and right, the right one unsure and wrong, in either of two images."""
    found = PERSON.copy()
    found[HANDS[21:]] += 5000
    scores = np.full((1, 136), 0.9)
    scores[0, HANDS[21:]] = 0.1
    detections = {i: replace(detected([found]), scores=scores) for i in (1, 2)}
    annotations = annotated([PERSON, PERSON], [1, 2])
    assert evaluate(annotations, detections, "each hand").AP == pytest.approx(
        51 / 101
    )  # recall 1/2, all right
    in_turn = evaluate(annotations, detections, "each hand", score="person").AP  # right, wrong, right, wrong
    assert in_turn == pytest.approx((26 + 25 * 2 / 3) / 101)


def test_ranking_by_the_groups_own_scores(annotated, detected):
    found = detected([PERSON, AWAY], [0.5, 0.9])
    scores = found.scores.copy()
    scores[0, HANDS], scores[1, HANDS] = 0.8, 0.1
    detections = {1: replace(found, scores=scores)}
    annotations = annotated([PERSON], [1])
    assert evaluate(annotations, detections, "hand", score="person").AP == pytest.approx(0.5)
    assert evaluate(annotations, detections, "hand").AP == ONE
    assert evaluate(annotations, detections, "body").AP == pytest.approx(0.5)


# ---- what pycocotools swallows (the seven malformed inputs)


def refused_or_ap(annotations, detections, path) -> str | float:
    """Through a file, as a user's results come: the error's text, or AP."""
    write_detections(path, detections)
    try:
        return evaluate(annotations, read_detections(path, annotations)).AP
    except InputError as error:
        return str(error)


def test_empty_unknown_duplicate_and_negative(annotated, detected, tmp_path):
    annotations, path = annotated([PERSON], [1]), tmp_path / "d.json"
    assert refused_or_ap(annotations, {}, path) == 0  # nobody found is a result, not a mistake
    assert "image_id 2 is not among" in refused_or_ap(annotations, {2: detected([PERSON])}, path)
    assert refused_or_ap(annotations, {1: detected([PERSON, PERSON])}, path) == ONE
    assert refused_or_ap(annotations, {1: detected([PERSON], [-0.3])}, path) == ONE


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_no_number_is_refused_in_memory_too(annotated, detected, value):
    annotations, good = annotated([PERSON], [1]), detected([PERSON])
    points = good.keypoints_px.copy()
    points[0, 7, 0] = value
    with pytest.raises(InputError, match="image 1: left_elbow of person 0 is .*; expected finite"):
        evaluate(annotations, {1: replace(good, keypoints_px=points)})
    with pytest.raises(InputError, match="image 1: score of person 0 is (nan|inf); expected"):
        evaluate(annotations, {1: replace(good, person_scores=np.array([value]))})
    with pytest.raises(InputError, match="image 1: nose of person 0"):
        evaluate(annotations, {1: replace(good, scores=np.where(np.arange(136) == 0, value, good.scores))})


def test_other_shapes_unknown_images_groups_and_options_are_refused(annotated, detected):
    annotations, good = annotated([PERSON], [1]), detected([PERSON])
    with pytest.raises(InputError, match=r"shapes .*; expected \(n, 136, 2\)"):
        evaluate(annotations, {1: replace(good, keypoints_px=good.keypoints_px[:, :5])})
    with pytest.raises(InputError, match="detections of image 2: not among the annotated images"):
        evaluate(annotations, {2: good})
    with pytest.raises(InputError, match="group 'foot': expected one of body, below the head, hand"):
        evaluate(annotations, {1: good}, "foot")
    with pytest.raises(InputError, match="option area='bbox': expected one of segment, box"):
        evaluate(annotations, {1: good}, area="bbox")


@pytest.mark.parametrize(("of_one", "expected"), [(0.3, ONE), (0.5, 0.5)])
def test_the_groups_score_is_the_mean_over_all_its_keypoints_those_not_given_too(
    annotated, detected, of_one, expected
):
    points = np.array([PERSON, AWAY])
    points[1, HANDS[1:]] = np.nan
    found = detected(points)
    scores = found.scores.copy()
    scores[0, HANDS], scores[1, HANDS] = 0.01, 0.0
    scores[1, HANDS[0]] = of_one  # over the 42 of the hands less or more than .01
    annotations = annotated([PERSON], [1])
    found = replace(found, scores=scores)
    assert evaluate(annotations, {1: found}, "hand", score="group").AP == pytest.approx(expected)


def test_the_smallest_person_counts(annotated, detected):
    annotations = annotated([PERSON], [1], areas_px2=0.5)
    assert evaluate(annotations, {1: detected([PERSON])}).AP == ONE
    assert evaluate(annotations, {1: detected([PERSON])}).n_people == 1
