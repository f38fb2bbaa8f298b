"""Peaks and assembly on synthetic maps drawn for people whose parts are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hicp_lib.detectors.openpose import paf
from hicp_lib.detectors.openpose.networks import COCO_18, scaled

STRIDE = 8
OPTIONS = paf.PafOptions()
N_FIELDS = 38

# Someone standing, in input pixels: nose, neck, right arm, left arm, right leg, left leg, eyes, ears.
STANDING = np.array(
    [
        (200, 60), (200, 100), (170, 100), (160, 150), (155, 195), (230, 100), (240, 150), (245, 195),
        (180, 200), (178, 260), (176, 320), (220, 200), (222, 260), (224, 320),
        (192, 52), (208, 52), (182, 58), (218, 58),
    ],
    float,
)  # fmt: skip


def cells_px(shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Centres of the cells in input pixels, x and y."""
    row, column = np.indices(shape)
    return (column + 0.5) * STRIDE - 0.5, (row + 0.5) * STRIDE - 0.5


def draw(people: list[np.ndarray], shape=(46, 54), model=COCO_18, n_fields=N_FIELDS):
    """Heat maps and fields as the network is taught them; a NaN part is not drawn."""
    x, y = cells_px(shape)
    heat_maps = np.zeros((model.n_parts, *shape))
    fields = np.zeros((n_fields, *shape))
    for person in people:
        for part, (u, v) in enumerate(person):
            if np.isfinite(u):
                gaussian = np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * STRIDE**2))
                heat_maps[part] = np.maximum(heat_maps[part], gaussian)
        for (a, b), channels in zip(model.pairs, model.fields, strict=True):
            start, end = person[a], person[b]
            if not np.isfinite([start, end]).all():
                continue
            length = np.linalg.norm(end - start)
            direction = (end - start) / length
            along = (x - start[0]) * direction[0] + (y - start[1]) * direction[1]
            across = (x - start[0]) * direction[1] - (y - start[1]) * direction[0]
            on = (np.abs(across) < 12) & (along > -12) & (along < length + 12)
            fields[channels] = np.where(on, direction[:, None, None], fields[channels])
    return heat_maps, fields


def assemble(people, **changes):
    return paf.assemble(*draw(people), COCO_18, STRIDE, paf.PafOptions(**changes))


def without(person, *parts):
    person = person.copy()
    person[list(parts)] = np.nan
    return person


@given(st.floats(20, 380), st.floats(20, 300), st.floats(0.1, 1.0), st.floats(6, 14))
def test_a_gaussian_peak_is_found_to_a_hundredth_of_a_pixel(u, v, height, sigma_px):
    x, y = cells_px((41, 50))
    heat_map = height * np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * sigma_px**2))
    (peaks,) = paf.find_peaks(heat_map[None], STRIDE, 0.05)
    assert len(peaks) == 1
    assert np.abs(peaks[0, :2] - (u, v)).max() < 0.01
    # The value is the cell's own: at most half a cell from the true peak.
    assert height * np.exp(-(32 / sigma_px**2)) <= peaks[0, 2] <= height


@pytest.mark.parametrize("u, v", [(3.5, 100), (427.5, 100), (100, 3.5), (100, 363.5), (3.5, 3.5)])
def test_peaks_at_the_border_are_found(u, v):
    heat_maps, _ = draw([np.where(np.arange(18)[:, None] == 0, (u, v), np.nan)])
    peaks = paf.find_peaks(heat_maps, STRIDE, 0.05)
    assert np.abs(peaks[0][0, :2] - (u, v)).max() < 0.01
    assert [len(found) for found in peaks] == [1] + [0] * 17


def test_a_plateau_is_one_peak_and_low_maxima_are_none():
    heat_maps = np.zeros((2, 20, 20))
    heat_maps[0, 5:7, 5:7] = 0.8
    heat_maps[1, 5, 5] = 0.05
    assert [len(found) for found in paf.find_peaks(heat_maps, STRIDE, 0.05)] == [1, 0]


def test_only_the_highest_peaks_are_kept_in_order():
    heat_maps = np.zeros((1, 40, 40))
    heights = np.linspace(0.1, 0.9, 100)
    heat_maps[0, 2::4, 2::4] = heights.reshape(10, 10)
    (peaks,) = paf.find_peaks(heat_maps, STRIDE, 0.05)
    assert np.array_equal(peaks[:, 2], heights[::-1][: paf.MAX_PEAKS])


def test_one_person_is_assembled_with_every_part_in_place():
    parts, scores = assemble([STANDING])
    assert parts.shape == (1, 18, 3)
    assert np.abs(parts[0, :, :2] - STANDING).max() < 0.5
    assert (parts[0, :, 2] > 0.7).all()
    assert 0.8 < scores[0] <= 1


@pytest.mark.parametrize("shifts", [[0, 110], [-110, 0, 130]])
def test_people_side_by_side_are_kept_apart(shifts):
    people = [STANDING + (shift, 0) for shift in shifts]
    parts, _ = assemble(people)
    assert len(parts) == len(people)
    found = sorted(parts, key=lambda person: person[1, 0])
    for person, truth in zip(found, people, strict=True):
        assert np.abs(person[:, :2] - truth).max() < 0.5


def test_the_field_decides_between_near_candidates():
    """Forearms whose wrists are nearer to the other person's elbow."""
    first, second = without(STANDING, *range(8, 14)), without(STANDING + (100, 0), *range(8, 14))
    first[7], second[4] = (300, 190), (215, 190)
    parts, _ = assemble([first, second])
    found = sorted(parts, key=lambda person: person[1, 0])
    assert np.abs(found[0][7, :2] - first[7]).max() < 0.5
    assert np.abs(found[1][4, :2] - second[4]).max() < 0.5


@pytest.mark.parametrize("missing", [(0, 14, 15, 16, 17), (8, 9, 10, 11, 12, 13), (4, 7), (3,), (16,)])
def test_missing_parts_stay_missing(missing):
    parts, _ = assemble([without(STANDING, *missing)])
    assert len(parts) == 1
    found = np.isfinite(parts[0, :, 0])
    # A wrist hangs on its elbow alone.
    lost = set(missing) | ({4} if missing == (3,) else set())
    assert set(np.flatnonzero(~found)) == lost
    assert (parts[0, ~found, 2] == 0).all()


def test_a_person_over_the_border_keeps_what_is_inside():
    shape = (46, 54)
    shifted = STANDING + (0, 120)
    shifted[shifted[:, 1] > 360] = np.nan
    parts, _ = paf.assemble(*draw([shifted], shape), COCO_18, STRIDE, OPTIONS)
    assert len(parts) == 1
    assert np.array_equal(np.isfinite(parts[0, :, 0]), np.isfinite(shifted[:, 0]))


def test_ear_and_shoulder_complete_a_person_but_start_none():
    shoulder_and_ear = without(STANDING, *set(range(18)) - {2, 16})
    assert len(assemble([shoulder_and_ear], min_parts=1, min_score=0)[0]) == 0
    shoulder_and_neck = without(STANDING, *set(range(18)) - {1, 2})
    assert len(assemble([shoulder_and_neck], min_parts=1, min_score=0)[0]) == 1
    with_ear = without(STANDING, *set(range(18)) - {1, 2, 16})
    (person,), _ = assemble([with_ear])
    assert set(np.flatnonzero(np.isfinite(person[:, 0]))) == {1, 2, 16}


def test_too_few_parts_or_too_low_a_score_is_nobody():
    arm = without(STANDING, *set(range(18)) - {3, 4})
    assert len(assemble([arm])[0]) == 0
    assert len(assemble([arm], min_parts=2)[0]) == 1
    heat_maps, fields = draw([STANDING])
    for factor, expected in ((0.15, 0), (0.3, 1)):
        # Parts and limbs at `factor`: (18 f + 17 f) / 18 against 0.4.
        found, _ = paf.assemble(factor * heat_maps, factor * fields, COCO_18, STRIDE, OPTIONS)
        assert len(found) == expected


def test_person_score_is_the_mean_over_parts_and_limbs():
    heat_maps, fields = draw([without(STANDING, *set(range(18)) - {2, 3, 4})])
    parts, scores = paf.assemble(heat_maps, 0.5 * fields, COCO_18, STRIDE, OPTIONS)
    assert scores[0] == pytest.approx((parts[0, :, 2].sum() + 2 * 0.5) / 5, abs=1e-6)


def test_a_field_across_the_limb_gives_no_limb():
    heat_maps, fields = draw([STANDING])
    turned = fields.reshape(-1, 2, *fields.shape[1:])[:, ::-1] * np.array([-1, 1])[:, None, None]
    parts, _ = paf.assemble(heat_maps, turned.reshape(fields.shape), COCO_18, STRIDE, OPTIONS)
    assert len(parts) == 0


def test_limb_score_is_the_mean_projection_of_a_constant_field():
    field = np.zeros((2, 30, 30))
    field[0], field[1] = 0.6, 0.3
    starts, ends = np.array([[20.0, 20, 1], [100, 50, 1]]), np.array([[180.0, 20, 1]])
    scores = paf.limb_scores(field, starts, ends, STRIDE, OPTIONS)
    vector = ends[0, :2] - starts[1, :2]
    expected = vector @ (0.6, 0.3) / np.linalg.norm(vector)
    assert scores[:, 0] == pytest.approx([0.6, expected])


@pytest.mark.parametrize("fraction, passes", [(0.9, False), (0.99, True)])
def test_nearly_the_whole_line_has_to_agree(fraction, passes):
    field = np.zeros((2, 30, 50))
    field[0, :, : int(fraction * 50)] = 1
    scores = paf.limb_scores(
        field, np.array([[3.5, 100, 1]]), np.array([[50 * STRIDE - 4.5, 100, 1]]), STRIDE, OPTIONS
    )
    assert (scores[0, 0] > 0) == passes


def test_people_with_a_part_each_are_not_merged():
    """Two necks, one head: whichever the nose is given to, nobody gets two necks."""
    people = []
    paf._join(people, (0, 0), (1, 0), 1.0, False)
    paf._join(people, (2, 0), (1, 1), 1.0, False)
    paf._join(people, (0, 0), (2, 0), 1.0, False)
    assert [person.peaks for person in people] == [{0: 0, 1: 0}, {2: 0, 1: 1}]
    paf._join(people, (1, 0), (3, 0), 0.5, False)
    assert people[0].peaks == {0: 0, 1: 0, 3: 0} and people[0].score == 1.5


def test_points_on_top_of_each_other_just_pass_without_a_field():
    point = np.array([[50.0, 50, 1]])
    field = np.zeros((2, 46, 54))
    assert paf.limb_scores(field, point, point + (1, 0, 0), STRIDE, OPTIONS) == pytest.approx(0.05, abs=1e-5)
    assert paf.limb_scores(field, point, point + (9, 0, 0), STRIDE, OPTIONS) == 0


def test_greedy_connection_takes_the_best_first_and_each_end_once():
    scores = np.array([[0.9, 0.8], [0.85, 0.1], [0.0, -1.0]])
    assert paf.connect(scores) == [(0, 0, 0.9), (1, 1, 0.1)]


def test_uncounted_parts_do_not_make_a_person():
    model = paf.PartModel(
        "x", 3, np.array([(0, 1), (1, 2)]), np.array([(0, 1), (2, 3)]), uncounted=frozenset({2})
    )
    person = np.array([(50.0, 50), (100, 50), (150, 50)])
    maps = draw([person], (20, 30), model, 4)
    assert len(paf.assemble(*maps, model, STRIDE, OPTIONS)[0]) == 0
    assert len(paf.assemble(*maps, model, STRIDE, paf.PafOptions(min_parts=2))[0]) == 1


def test_maps_of_noise_end_in_arrays_of_the_right_shape():
    rng = np.random.default_rng(0)
    parts, scores = paf.assemble(
        rng.random((18, 46, 54)), rng.normal(0, 1, (38, 46, 54)), COCO_18, STRIDE, OPTIONS
    )
    assert parts.shape[1:] == (18, 3) and scores.shape == (len(parts),)


@given(st.integers(20, 900), st.integers(20, 900))
def test_positions_survive_the_way_into_the_network_and_back(width_px, height_px):
    """A corner of the image is a corner of the scaled part, whatever the rounding."""
    net_input = scaled(np.zeros((height_px, width_px, 3), np.uint8), 368)
    rows, columns = net_input.pixels.shape[:2]
    assert rows == 368 and columns % 16 == 0
    used = round(net_input.scale[0] * width_px)
    assert 0 <= columns - used < 16
    corners = net_input.to_image_px(np.array([(-0.5, -0.5), (used - 0.5, rows - 0.5)]))
    assert corners == pytest.approx(np.array([(-0.5, -0.5), (width_px - 0.5, height_px - 0.5)]))


@pytest.mark.parametrize("width_px, height_px", [(301, 411), (799, 533), (97, 203)])
def test_a_bright_spot_is_where_it_was(width_px, height_px):
    """Centroid of a blurred spot, drawn in an image of odd size and found in the network's input."""
    u, v = 0.37 * width_px, 0.61 * height_px
    y, x = np.indices((height_px, width_px))
    sigma = 0.03 * height_px
    spot = 250 * np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * sigma**2))
    net_input = scaled(np.repeat(spot[..., None], 3, axis=2).round().astype(np.uint8), 368)
    weight = net_input.pixels[..., 0].astype(float)
    rows, columns = np.indices(weight.shape)
    centroid = np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum()
    assert net_input.to_image_px(centroid) == pytest.approx([u, v], abs=0.05)
