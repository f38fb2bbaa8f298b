"""OpenPose's own way of reading maps, against its rules written as plain loops."""

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from hicp_lib.detectors.openpose import paf
from hicp_lib.detectors.openpose import released as paf_released
from hicp_lib.detectors.openpose.mobilenet import COCO_18
from tests.detectors.openpose.test_paf import STANDING, draw

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
