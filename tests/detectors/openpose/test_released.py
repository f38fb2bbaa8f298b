"""OpenPose's own way of reading maps, against its rules written as plain loops."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hicp_lib.detectors.openpose import paf
from hicp_lib.detectors.openpose import released as paf_released
from hicp_lib.detectors.openpose.networks import BODY_25, COCO_18
from hicp_lib.detectors.openpose.released import join_as_released
from tests.detectors.openpose.test_paf import STANDING, draw, without

OPTIONS = paf.PafOptions()


def plain_peaks(heat, threshold):
    """Rows x, y, value: local maxima, then the centroid of positive values within three pixels."""
    height, width = heat.shape
    found = []
    for y in range(height):
        for x in range(width):
            if heat[y, x] <= threshold:
                continue
            others = [
                heat[y + dy, x + dx] if 0 <= y + dy < height and 0 <= x + dx < width else threshold
                for dy in (-1, 0, 1)
                for dx in (-1, 0, 1)
                if dx or dy
            ]
            if 1 < x < width - 2 and 1 < y < height - 2:
                is_peak = all(heat[y, x] > other for other in others)
            elif x in (1, width - 2) or y in (1, height - 2):
                is_peak = all(heat[y, x] >= other for other in others)
            else:
                is_peak = False
            if is_peak:
                near = [
                    (i, j, heat[j, i])
                    for j in range(max(0, y - 3), min(height, y + 4))
                    for i in range(max(0, x - 3), min(width, x + 4))
                    if heat[j, i] > 0
                ]
                total = sum(value for _, _, value in near)
                found.append(
                    (
                        sum(i * v for i, _, v in near) / total,
                        sum(j * v for _, j, v in near) / total,
                        heat[y, x],
                    )
                )
    return np.array(found[:127]).reshape(-1, 3)


@given(st.integers(0, 10_000))
@settings(max_examples=15, deadline=None)
def test_peaks_on_random_maps(seed):
    rng = np.random.default_rng(seed)
    small = rng.normal(0.1, 0.3, (5, 6)).astype(np.float32)
    (large,) = paf_released.enlarge(small[None], 8)
    np.testing.assert_allclose(large, cv2.resize(small, (48, 40), interpolation=cv2.INTER_CUBIC))
    for heat in (large, rng.normal(0, 1, (9, 12)).astype(np.float32), np.round(large, 1)):
        got = paf_released.centroid_peaks(heat, 0.05)
        np.testing.assert_allclose(got, plain_peaks(heat.astype(float), 0.05), atol=1e-4)


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_limb_scores_on_random_fields(seed):
    """Five to 25 samples at the nearest pixels, the mean of those above the threshold."""
    rng = np.random.default_rng(seed)
    field = rng.normal(0.4, 0.4, (2, 40, 60)).astype(np.float32)
    starts, ends = rng.uniform((-2, -2), (62, 42), (2, 4, 2))
    options = paf.PafOptions(min_agreement=0.5)
    got = paf.limb_scores(field, starts, ends, 1, options, paf_released._nearest)
    for i, start in enumerate(starts):
        for j, end in enumerate(ends):
            vector = end - start
            n = max(5, min(25, int(np.sqrt(5 * np.abs(vector).max()) + 0.5)))
            length = np.hypot(*vector)
            samples = []
            for k in range(n):
                x = min(59, max(0, int(np.floor(start[0] + k * vector[0] / n + 0.5))))
                y = min(39, max(0, int(np.floor(start[1] + k * vector[1] / n + 0.5))))
                samples.append((vector[0] * field[0, y, x] + vector[1] * field[1, y, x]) / length)
            above = [value for value in samples if value > options.min_sample]
            short = 0.05 + 1e-6 if length < np.sqrt(40 * 60) / 150 else 0.0
            truth = np.mean(above) if len(above) / n > 0.5 else short
            np.testing.assert_allclose(got[i, j], truth, atol=1e-6)


def test_people_are_the_same_as_in_the_small_maps_to_a_pixel():
    second = STANDING + (110, 10)
    maps = draw([STANDING, second], shape=(46, 60))
    released, scores = paf_released.assemble_released(*maps, COCO_18, 8, OPTIONS)
    plain, plain_scores = paf.assemble(*maps, COCO_18, 8, OPTIONS)
    assert len(released) == len(plain) == 2
    order = np.argsort(released[:, 0, 0])
    for truth, person in zip((STANDING, second), released[order], strict=True):
        assert np.abs(person[:, :2] - truth).max() < 1.5
    np.testing.assert_allclose(np.sort(scores), np.sort(plain_scores), atol=0.1)


def test_maps_without_a_peak_are_nobody():
    parts, scores = paf_released.assemble_released(
        np.zeros((18, 8, 8)), np.zeros((38, 8, 8)), COCO_18, 8, OPTIONS
    )
    assert parts.shape == (0, 18, 3) and scores.shape == (0,)


NOBODY_LEFT_OUT = paf.PafOptions(min_parts=1, min_score=0.0)
CHAIN = paf.PartModel("x", 4, np.array([(0, 1), (1, 2), (2, 3)]), np.zeros((3, 2), int))


def peaks_of(counts, value=0.5):
    """So many peaks of each part; peak k of part p lies at (10 p, 10 k)."""
    return [np.array([(10 * part, 10 * k, value) for k in range(n)]).reshape(-1, 3)
            for part, n in enumerate(counts)]  # fmt: skip


def joined(model, counts, limbs, options=NOBODY_LEFT_OUT):
    """Who has which peaks, {part: peak} each, and the person scores."""
    rows = [limbs.get(index, []) for index in range(len(model.pairs))]
    parts, scores = join_as_released(peaks_of(counts), rows, model, options)
    people = [{part: int(y) // 10 for part, (_, y, s) in enumerate(person) if s > 0} for person in parts]
    return people, scores.tolist()


def test_people_are_not_merged_the_second_end_is_overwritten_and_counted_twice():
    # Both 0-1 and 2-3 ... the limb 1-2 gives its second end to who has the first; 2-3 then goes on with it.
    star = paf.PartModel("x", 4, np.array([(0, 1), (2, 3), (1, 2)]), np.zeros((3, 2), int))
    people, scores = joined(star, (1, 1, 1, 1), {0: [(0, 0, 0.9)], 1: [(0, 0, 0.8)], 2: [(0, 0, 0.7)]})
    assert people == [{0: 0, 1: 0, 2: 0}, {2: 0, 3: 0}]
    # Over all 4 parts and 3 limbs, found or not; the part 2 counts for both.
    assert scores == pytest.approx([(3 * 0.5 + 0.9 + 0.7) / 7, (2 * 0.5 + 0.8) / 7])

    ring = paf.PartModel("x", 3, np.array([(0, 1), (2, 1), (0, 2), (2, 1)]), np.zeros((4, 2), int))
    people, scores = joined(ring, (1, 2, 1), {0: [(0, 0, 0.9)], 2: [(0, 0, 0.6)], 3: [(0, 1, 0.4)]})
    assert people == [{0: 0, 1: 1, 2: 0}]
    assert scores == pytest.approx([(4 * 0.5 + 0.9 + 0.6 + 0.4) / 7])
    # Four were counted for three parts: 3.9 / 4 is the mean that has to reach the least score.
    for least, n_people in ((0.97, 1), (0.98, 0)):
        options = paf.PafOptions(min_parts=4, min_score=least)
        limbs = {0: [(0, 0, 0.9)], 2: [(0, 0, 0.6)], 3: [(0, 1, 0.4)]}
        assert len(joined(ring, (1, 2, 1), limbs, options)[0]) == n_people


def test_a_limb_does_not_go_to_who_has_only_its_second_end():
    split = paf.PartModel("x", 3, np.array([(0, 1), (2, 1)]), np.zeros((2, 2), int))
    people, _ = joined(split, (1, 1, 1), {0: [(0, 0, 0.9)], 1: [(0, 0, 0.8)]})
    assert people == [{0: 0, 1: 0}, {1: 0, 2: 0}]


def test_a_part_without_partners_is_somebody_whom_a_later_limb_completes():
    # No part 0 at all: both parts 1 stand alone; 1-2 takes up the first of them.
    people, scores = joined(CHAIN, (0, 2, 1, 1), {1: [(0, 0, 0.9)], 2: [(0, 0, 0.8)]})
    assert people == [{1: 0, 2: 0, 3: 0}, {1: 1}]
    assert scores == pytest.approx([(3 * 0.5 + 1.7) / 7, 0.5 / 7])
    # Parts that have possible partners, but no limb, are nobody.
    assert joined(CHAIN, (1, 1, 0, 0), {})[0] == [{1: 0}]
    assert joined(CHAIN, (1, 1, 1, 1), {})[0] == []


def test_ears_from_shoulders_complete_all_who_fit_and_count_for_nothing():
    # Limb 17 of COCO-18 joins the right shoulder (2) to the right ear (16).
    counts = [0] * 18
    for part in (1, 2, 3, 16):
        counts[part] = 1
    limbs = {0: [(0, 0, 0.9)], 2: [(0, 0, 0.8)], 17: [(0, 0, 0.7)]}
    people, scores = joined(COCO_18, counts, limbs, paf.PafOptions())
    assert people == [{1: 0, 2: 0, 3: 0, 16: 0}]
    assert scores == pytest.approx([(3 * 0.5 + 1.7) / 37])
    # Neck, shoulder and ear are two parts to the count: too few.
    counts[3] = 0
    assert joined(COCO_18, counts, {0: [(0, 0, 0.9)], 17: [(0, 0, 0.7)]}, paf.PafOptions())[0] == []


def legs(n_toes):
    """Neck, mid hip, right leg, and toes; every part is on one limb, so as many are counted as there are."""
    parts = [1, 8, 9, 10, 11, *((22, 23, 24)[:n_toes])]
    counts = [int(part in parts) for part in range(25)]
    pairs = [(int(a), int(b)) for a, b in BODY_25.pairs]
    limbs = {i: [(0, 0, 0.9)] for i, (a, b) in enumerate(pairs) if a in parts and b in parts}
    return counts, limbs


def test_feet_do_not_count_and_need_more_than_four_other_parts():
    counts, limbs = legs(3)
    assert len(joined(BODY_25, counts, limbs, paf.PafOptions(min_parts=5))[0]) == 1
    assert len(joined(BODY_25, counts, limbs, paf.PafOptions(min_parts=9))[0]) == 0
    # Without the neck four others are left. Alone, they pass on the second try, on which feet count, ...
    counts[1] = 0
    limbs.pop(0)
    alone = joined(BODY_25, counts, limbs, paf.PafOptions())[0]
    assert [set(person) for person in alone] == [{8, 9, 10, 11, 22, 23, 24}]
    # ... beside somebody who passes on the first they do not.
    counts = [n + (part in (1, 5, 6, 7)) for part, n in enumerate(counts)]
    arm = {2: [(0, 0, 0.9)], 5: [(0, 0, 0.9)], 6: [(0, 0, 0.9)]}
    beside = joined(BODY_25, counts, limbs | arm, paf.PafOptions())[0]
    assert [set(person) for person in beside] == [{1, 5, 6, 7}]


def test_of_limbs_of_equal_score_the_last_is_taken_and_points_in_one_place_are_no_limb():
    assert paf.connect(np.full((2, 3), 0.5)) == [(1, 2, 0.5), (0, 1, 0.5)]
    assert paf.connect(np.full((1, 1), 1e-6)) == []
    point, fields = np.array([[50.0, 50.0]]), np.ones((2, 20, 20))
    assert paf.limb_scores(fields, point, point, 8, paf.PafOptions()) == 0


def test_somebody_standing_is_found_whole_with_the_programs_score():
    parts, scores = paf_released.assemble_released(*draw([STANDING]), COCO_18, 8, paf.PafOptions())
    assert np.isfinite(parts[0]).all() and len(parts) == 1
    whole = scores[0]
    # Less of a person: fewer terms over the same number, where a mean would stay.
    half = without(STANDING, *range(8, 14))
    _, scores = paf_released.assemble_released(*draw([half]), COCO_18, 8, paf.PafOptions())
    assert scores[0] / whole == pytest.approx(23 / 35, abs=0.02)


def test_fields_are_read_half_an_image_pixel_on():
    fields = np.zeros((2, 30, 30), np.float32)
    fields[0, 11] = 1.0
    start, end = np.array([[5.0, 10.3]]), np.array([[25.0, 10.3]])
    for offset_px, score in ((0.0, 0.0), (0.25, 1.0), (1.1, 1.0), (1.25, 0.0)):
        found = paf.limb_scores(
            fields, start, end, 1, paf.PafOptions(),
            lambda *given, offset_px=offset_px: paf_released._nearest(*given, offset_px),
        )  # fmt: skip
        assert found == score
