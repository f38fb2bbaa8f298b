"""Pose suppression and merging against plain loops of the published rules."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hicp_lib.detectors.onnx.pose_nms import (
    BODY_RULES,
    INTEGRAL_RULES,
    WHOLE_BODY_RULES,
    merge_poses,
    oks_nms,
)


def poses(rng, n_people, k, copies=3, jitter_px=1.0):
    people = rng.uniform(0, 300, (n_people, k, 2))
    positions = np.repeat(people, copies, axis=0)
    positions = positions + rng.normal(0, jitter_px, positions.shape)
    scores = rng.uniform(0.02, 1, positions.shape[:2])
    boxes = np.tile([0.0, 0, 120, 200], (len(positions), 1))
    return positions, scores, boxes


def plain_merge(positions, scores, boxes, rules):
    """The rules in loops: distance, number of matches, merge; indices are of the whole list."""
    k = positions.shape[1]
    part = ["body"] * (k - 110) + ["face"] * 68 + ["hand"] * 42 if rules.is_whole_body else ["body"] * k
    factor = {"body": 1.0, "face": 1.9, "hand": 0.55}
    # As released, coinciding points are counted by the groups of 136 points in whole bodies of 133, too.
    group = ["body"] * 26 + ["face"] * 68 + ["hand"] * (k - 94) if rules.is_whole_body else part
    left, result = list(range(len(scores))), []
    while left:
        best = max(left, key=lambda i: scores[i].mean())
        reach = rules.reach * max(boxes[best, 2:])
        n_sure = sum(scores[best] > rules.min_score / 2)
        same = []
        for i in left:
            terms = {"body": [], "face": [], "hand": []}
            near = {"body": [], "face": [], "hand": []}
            matches = 0.0
            for j in range(k):
                d = np.hypot(*(positions[i, j] - positions[best, j]))
                product = np.tanh(scores[best, j] / rules.delta1) * np.tanh(scores[i, j] / rules.delta1)
                if rules.is_whole_body:
                    weak = scores[i, j] < rules.min_score
                    terms[part[j]].append(product if d <= 1 and weak else 0.0)
                    near[part[j]].append(0.0 if weak else np.exp(-d / (rules.delta2 * factor[part[j]])))
                else:
                    terms[part[j]].append(product if d <= 1 else 0.0)
                    near[part[j]].append(np.exp(-d / rules.delta2))
                matches += d / min(reach, 7) <= factor[group[j]]
            if rules.is_whole_body:
                score_weight = {"body": 1, "face": 1, "hand": 0.1}
                near_weight = {"body": 1, "face": 1, "hand": 1.5}
                similarity = sum(score_weight[p] * np.mean(terms[p]) for p in terms)
                similarity += rules.mu * sum(near_weight[p] * np.mean(near[p]) for p in near)
                matches = matches / (2 * len(left) * n_sure) / 2 * k if n_sure else 0
            else:
                similarity = sum(terms["body"]) + rules.mu * sum(near["body"])
            if similarity > rules.gamma or matches >= rules.min_matches:
                same.append(i)
        same = same or [best]
        left = [i for i in left if i not in same]
        pose, score = np.zeros((k, 2)), np.zeros(k)
        for j in range(k):
            close = [i for i in same if np.hypot(*(positions[i, j] - positions[best, j])) <= min(reach, 15)]
            total = sum(scores[i, j] for i in close)
            for i in close:
                pose[j] += positions[i, j] * scores[i, j] / total
                score[j] += scores[i, j] ** 2 / total
        if scores[best].max() >= rules.min_score and score.max() >= rules.min_score:
            result.append((best, pose, score))
    return result


@pytest.mark.parametrize(
    ("rules", "k"),
    [
        (BODY_RULES, 17),
        (BODY_RULES, 26),
        (WHOLE_BODY_RULES, 136),
        (INTEGRAL_RULES, 136),
        (INTEGRAL_RULES, 133),
        (WHOLE_BODY_RULES, 133),
    ],
)
@given(seed=st.integers(0, 1000))
@settings(max_examples=6, deadline=None)
def test_merging_follows_the_rules(rules, k, seed):
    rng = np.random.default_rng(seed)
    positions, scores, boxes = poses(rng, 2, k, copies=int(rng.integers(1, 4)), jitter_px=rng.uniform(0, 6))
    rows, merged, merged_scores = merge_poses(positions, scores, boxes, rules)
    expected = plain_merge(positions, scores, boxes, rules)
    assert rows.tolist() == [row for row, _, _ in expected]
    for got, got_score, (_, pose, score) in zip(merged, merged_scores, expected, strict=True):
        np.testing.assert_allclose(got, pose, atol=1e-9)
        np.testing.assert_allclose(got_score, score, atol=1e-9)


def test_the_first_points_of_a_face_of_133_count_as_body():
    """Points 23 to 25 begin the face of 133 and end the body of 136, 91 to 93 are a hand's and a face's.

    5 px are in reach for a face (1.9 x 7 px) and a body (7 px), not for a hand (0.55 x 7 px); 10 px for a
    face alone. Of two poses the coinciding points count k / (8 x sure points) each.
    """

    def n_people(apart_px):
        positions = np.stack([np.arange(133.0) * 50, np.zeros(133)], axis=1)[None].repeat(2, axis=0)
        positions[1, :, 1] = apart_px
        rules = dataclasses.replace(WHOLE_BODY_RULES, min_matches=133 / (8 * 133) * 3)
        scores, boxes = np.full((2, 133), 0.9), np.tile([0.0, 0, 7000, 200], (2, 1))
        return len(merge_poses(positions, scores - [[0], [0.1]], boxes, rules)[0])

    away = np.full(133, 100.0)
    for points, distance_px, expected in (
        (range(91, 94), 5.0, 1), (range(94, 97), 5.0, 2), (range(23, 26), 10.0, 2), (range(26, 29), 10.0, 1),
    ):  # fmt: skip
        apart_px = away.copy()
        apart_px[list(points)] = distance_px
        assert n_people(apart_px) == expected


def test_copies_of_two_people_become_two():
    positions, scores, boxes = poses(np.random.default_rng(0), 2, 17, copies=4, jitter_px=0.5)
    rows, merged, _ = merge_poses(positions, scores, boxes, BODY_RULES)
    assert len(rows) == 2 and {int(row) // 4 for row in rows} == {0, 1}
    assert np.abs(merged[0] - positions[rows[0]]).max() < 3


def test_points_that_are_not_given_stay_so():
    positions, scores, boxes = poses(np.random.default_rng(1), 1, 17, copies=2)
    positions[:, 3], scores[:, 3] = np.nan, 0
    positions[0, 5], scores[0, 5] = np.nan, 0
    _, merged, _ = merge_poses(positions, scores, boxes, BODY_RULES)
    assert np.isnan(merged[0, 3]).all() and np.isfinite(np.delete(merged[0], [3, 5], axis=0)).all()


def test_nobody_and_nobody_sure():
    none = np.zeros((0, 17, 2)), np.zeros((0, 17)), np.zeros((0, 4))
    assert len(merge_poses(*none, BODY_RULES)[0]) == 0
    positions, scores, boxes = poses(np.random.default_rng(1), 2, 17)
    assert len(merge_poses(positions, scores * 0.1, boxes, BODY_RULES)[0]) == 0
    assert (
        len(merge_poses(positions, scores * 0.1, boxes, dataclasses.replace(BODY_RULES, min_score=0.01))[0])
        > 0
    )


def test_oks_nms_keeps_the_better_of_two_equal_poses_and_far_ones():
    positions, _, _ = poses(np.random.default_rng(2), 2, 17, copies=2, jitter_px=0.1)
    keep = oks_nms(positions, np.array([0.2, 0.9, 0.5, 0.4]), np.full(4, 1e4), np.full(17, 0.05))
    assert keep.tolist() == [1, 2]
    shifted = positions + np.array([0, 0, 0, 60])[:, None, None]
    assert oks_nms(shifted, np.array([0.2, 0.9, 0.5, 0.4]), np.full(4, 1e4), np.full(17, 0.05)).tolist() == [
        1,
        2,
        3,
    ]


@pytest.mark.parametrize(("distance_px", "n"), [(7.0, 1), (7.01, 2)])
def test_points_within_seven_pixels_coincide(distance_px, n):
    """The box is large: a tenth of its side would allow more."""
    positions = np.stack([np.arange(17.0), np.zeros(17)], axis=1)[None].repeat(2, axis=0) * 100
    positions[1, :, 1] = distance_px
    scores = np.array([[0.9] * 17, [0.8] * 17])
    boxes = np.tile([0.0, 0, 1600, 200], (2, 1))
    assert len(merge_poses(positions, scores, boxes, BODY_RULES)[0]) == n


def test_oks_at_the_limit_is_another_person():
    positions, _, _ = poses(np.random.default_rng(2), 1, 17, copies=2, jitter_px=0.0)
    arguments = positions, np.array([0.5, 0.9]), np.full(2, 1e4), np.full(17, 0.05)
    assert oks_nms(*arguments, max_oks=1.0).tolist() == [1, 0]
    assert oks_nms(*arguments, max_oks=np.nextafter(1.0, 0)).tolist() == [1]


def test_the_published_constants():
    """Of AlphaPose's released program: bodies, whole bodies, and whole bodies by integral regression."""
    assert dataclasses.astuple(BODY_RULES) == (1.0, 1.7, 2.65, 22.48, 0.3, 5, 0.1, False)
    assert dataclasses.astuple(WHOLE_BODY_RULES) == (1.0, 1.7, 2.65, 22.48, 0.3, 5, 0.1, True)
    assert dataclasses.astuple(INTEGRAL_RULES) == (1.0, 1.65, 8.0, 3.6, 0.01, 3, 0.15, True)
