"""The conventions against their own published orders, written out by name."""

import numpy as np
import pytest

from hicp_lib.core.keypoints import (
    BODY,
    COCO_17,
    FACE,
    GROUPS,
    HAND_NAMES,
    HANDS,
    HEAD,
    INDEX,
    LEFT_HAND,
    LIMBS,
    N_KEYPOINTS,
    NAMES,
    RIGHT_HAND,
    SIGMAS,
    TO_HALPE,
    mirror,
    to_halpe,
)

ABBREVIATED = {"l": "left", "r": "right"}


def written_out(text: str) -> list[str | None]:
    """'l_eye' -> 'left_eye'; '-' for a point Halpe does not have."""
    return [None if word == "-" else _full(word) for word in text.split()]


def _full(word: str) -> str:
    side, _, rest = word.partition("_")
    return f"{ABBREVIATED[side]}_{rest}" if side in ABBREVIATED else word


# Each set in its own order.
PUBLISHED = {
    "coco17": "nose l_eye r_eye l_ear r_ear l_shoulder r_shoulder l_elbow r_elbow l_wrist r_wrist "
    "l_hip r_hip l_knee r_knee l_ankle r_ankle",
    "halpe26": "nose l_eye r_eye l_ear r_ear l_shoulder r_shoulder l_elbow r_elbow l_wrist r_wrist "
    "l_hip r_hip l_knee r_knee l_ankle r_ankle head_top neck mid_hip "
    "l_big_toe r_big_toe l_small_toe r_small_toe l_heel r_heel",
    "openpose_coco18": "nose neck r_shoulder r_elbow r_wrist l_shoulder l_elbow l_wrist r_hip r_knee r_ankle "
    "l_hip l_knee l_ankle r_eye l_eye r_ear l_ear",
    "openpose_body25": "nose neck r_shoulder r_elbow r_wrist l_shoulder l_elbow l_wrist mid_hip r_hip r_knee "
    "r_ankle l_hip l_knee l_ankle r_eye l_eye r_ear l_ear l_big_toe l_small_toe l_heel "
    "r_big_toe r_small_toe r_heel",
    "mediapipe_pose33": "nose - l_eye - - r_eye - l_ear r_ear - - l_shoulder r_shoulder l_elbow r_elbow "
    "l_wrist r_wrist - - - - - - l_hip r_hip l_knee r_knee l_ankle r_ankle l_heel r_heel l_big_toe r_big_toe",
}


@pytest.mark.parametrize("convention", PUBLISHED)
def test_bodies_map_by_name(convention):
    names = [NAMES[i] if i >= 0 else None for i in TO_HALPE[convention]]
    assert names == written_out(PUBLISHED[convention])


def test_wholebody_133_maps_by_name():
    feet = "l_big_toe l_small_toe l_heel r_big_toe r_small_toe r_heel"
    expected = written_out(PUBLISHED["coco17"] + " " + feet) + [f"face_{i}" for i in range(68)]
    expected += [f"{side}_{name}" for side in ("left", "right") for name in HAND_NAMES]
    assert [NAMES[i] for i in TO_HALPE["wholebody133"]] == expected


def test_openpose_face_drops_the_pupils_and_hands_keep_their_order():
    assert TO_HALPE["openpose_face70"].tolist() == [*range(26, 94), -1, -1]
    assert TO_HALPE["left_hand21"].tolist() == list(range(94, 115))
    assert TO_HALPE["right_hand21"].tolist() == list(range(115, 136))
    assert HAND_NAMES[0] == "hand_root" and HAND_NAMES[8] == "index_4" and HAND_NAMES[20] == "little_4"


def test_no_two_points_of_a_set_share_a_halpe_point():
    for indices in TO_HALPE.values():
        used = indices[indices >= 0]
        assert len(np.unique(used)) == len(used)
        assert used.max() < N_KEYPOINTS


def test_groups_divide_the_136_points():
    assert sorted(np.concatenate([BODY, FACE, HANDS])) == list(range(136)) == [INDEX[name] for name in NAMES]
    assert sorted(np.concatenate([LEFT_HAND, RIGHT_HAND])) == HANDS.tolist()
    assert {name: len(points) for name, points in GROUPS.items()} == {"body": 17, "hand": 42}


def test_the_head_is_what_is_above_the_neck():
    assert {NAMES[i] for i in HEAD if i in BODY} == {
        "nose", "left_eye", "right_eye", "left_ear", "right_ear", "head_top",
    }  # fmt: skip
    assert set(FACE) <= set(HEAD) and INDEX["neck"] not in HEAD


def test_limbs_stay_on_one_side_or_cross_at_the_trunk():
    crossing = {
        tuple(sorted((NAMES[a], NAMES[b])))
        for a, b in LIMBS
        if _side(a) != _side(b) and _side(a) and _side(b)
    }
    assert crossing == {("left_hip", "right_hip"), ("left_shoulder", "right_shoulder")}


def _side(index: int) -> str | None:
    return next((side for side in ("left", "right") if NAMES[index].startswith(side)), None)


@pytest.mark.parametrize("name", SIGMAS)
def test_sigmas_are_one_per_point_and_equal_left_and_right(name):
    sigmas = SIGMAS[name]
    assert sigmas.shape == (136,) and (sigmas > 0).all()
    mirrored = {i: INDEX[n.replace("left_", "right_")] for i, n in enumerate(NAMES) if n.startswith("left_")}
    # COCO-WholeBody's feet are the exception: the published values differ from side to side.
    pairs = [(a, b) for a, b in mirrored.items() if name == "halpe" or a not in range(20, 26)]
    assert all(sigmas[a] == sigmas[b] for a, b in pairs)


def test_sigmas_of_the_body_are_cocos():
    coco = [26, 25, 25, 35, 35, 79, 79, 72, 72, 62, 62, 107, 107, 87, 87, 89, 89]
    for sigmas in SIGMAS.values():
        assert np.allclose(sigmas[COCO_17], np.array(coco) / 1000, atol=0, rtol=1e-12)


def test_sigmas_of_hands_and_feet():
    assert (SIGMAS["halpe"][HANDS] == 0.015).all() and (SIGMAS["halpe"][FACE] == 0.015).all()
    wholebody = SIGMAS["wholebody"]
    assert wholebody[INDEX["left_hand_root"]] == 0.029 and wholebody[INDEX["right_thumb_4"]] == 0.047
    feet = {"left_big_toe": 0.068, "left_small_toe": 0.066, "left_heel": 0.066,
            "right_big_toe": 0.092, "right_small_toe": 0.094, "right_heel": 0.094}  # fmt: skip
    assert {name: wholebody[INDEX[name]] for name in feet} == feet


def test_to_halpe_moves_values_and_fills_the_rest():
    source = np.arange(2 * 17 * 2, dtype=float).reshape(2, 17, 2)
    moved = to_halpe(source, "coco17", axis=-2)
    assert moved.shape == (2, 136, 2)
    assert np.array_equal(moved[:, :17], source) and np.isnan(moved[:, 17:]).all()
    scores = to_halpe(np.full((3, 70), 0.5), "openpose_face70", axis=-1, fill=0.0)
    assert scores.shape == (3, 136) and scores.sum() == 3 * 68 * 0.5 and (scores[:, FACE] == 0.5).all()
    with pytest.raises(ValueError, match="coco17 has 17"):
        to_halpe(np.zeros((2, 18)), "coco17", axis=-1)


@pytest.mark.parametrize("convention", ["halpe136", "wholebody133", "halpe26", "coco17", "halpe68_noface"])
def test_mirror_swaps_the_sides_and_is_its_own_inverse(convention):
    mirrored = mirror(convention)
    np.testing.assert_array_equal(mirrored[mirrored], np.arange(len(mirrored)))
    for source, other in enumerate(mirrored):
        name, partner = (NAMES[TO_HALPE[convention][i]] for i in (source, other))
        if not name.startswith("face"):
            side, bar, rest = name.partition("_")
            assert partner == {"left": "right", "right": "left"}.get(side, side) + bar + rest


def test_mirror_of_the_face_matches_a_symmetric_drawing():
    """300-W points of a face drawn symmetric about x = 0: every point mirrors onto its partner."""
    contour = [(-np.cos(a), -np.sin(a)) for a in np.linspace(0, np.pi, 17)]
    brow = [(-0.8, 0.5), (-0.65, 0.6), (-0.5, 0.62), (-0.35, 0.6), (-0.2, 0.52)]
    bridge = [(0, 0.4), (0, 0.3), (0, 0.2), (0, 0.1)]
    base = [(-0.2, 0), (-0.1, -0.02), (0, -0.04), (0.1, -0.02), (0.2, 0)]
    right_eye = [(-0.6, 0.4), (-0.5, 0.44), (-0.4, 0.44), (-0.3, 0.4), (-0.4, 0.36), (-0.5, 0.36)]
    left_eye = [(0.3, 0.4), (0.4, 0.44), (0.5, 0.44), (0.6, 0.4), (0.5, 0.36), (0.4, 0.36)]
    outer = [(np.cos(a) * 0.4, np.sin(a) * 0.15 - 0.4) for a in np.pi - np.arange(12) * np.pi / 6]
    inner = [(np.cos(a) * 0.3, np.sin(a) * 0.05 - 0.4) for a in np.pi - np.arange(8) * np.pi / 4]
    face = contour + brow + [(-x, y) for x, y in brow[::-1]] + bridge + base + right_eye + left_eye
    face = np.array(face + outer + inner)
    partner = mirror("halpe136")[FACE] - FACE[0]
    np.testing.assert_allclose(face[partner], face * (-1, 1), atol=1e-9)


def test_mirrored_hands_on_their_own_stay_themselves():
    np.testing.assert_array_equal(mirror("left_hand21"), np.arange(21))
