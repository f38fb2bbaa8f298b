"""Decoders against plain loops written from the published formulas, on random outputs, to 1e-4 of a cell."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hicp_lib.detectors.onnx import decode

TOLERANCE = 1e-4
SEEDS = st.integers(0, 10_000)


def gaussians(rng, n=2, k=5, height=24, width=18, noise=0.0):
    """Heat maps as networks give them: a Gaussian of sigma 2 to 3 anywhere, borders included."""
    y, x = np.mgrid[:height, :width]
    centres = rng.uniform((-0.5, -0.5), (width - 0.5, height - 0.5), (n, k, 2))
    sigmas = rng.uniform(2, 3, (n, k))[..., None, None]
    squared = (x - centres[..., 0, None, None]) ** 2 + (y - centres[..., 1, None, None]) ** 2
    maps = rng.uniform(0.2, 1, (n, k, 1, 1)) * np.exp(-squared / (2 * sigmas**2))
    return (maps + noise * rng.standard_normal(maps.shape)).astype(np.float32), centres


def plain_quarter(heat, needs_both):
    height, width = heat.shape
    best = max(((y, x) for y in range(height) for x in range(width)), key=lambda c: heat[c])
    y, x = best
    dx = heat[y, x + 1] - heat[y, x - 1] if 1 < x < width - 1 else 0.0
    dy = heat[y + 1, x] - heat[y - 1, x] if 1 < y < height - 1 else 0.0
    if needs_both and not (1 < x < width - 1 and 1 < y < height - 1):
        dx = dy = 0.0
    if not needs_both:
        dx = dx if 0 < y < height else 0.0
        dy = dy if 0 < x < width else 0.0
    return x + 0.25 * np.sign(dx), y + 0.25 * np.sign(dy), heat[y, x]


def plain_dark(heat, kernel):
    height, width = heat.shape
    y, x = np.unravel_index(np.argmax(heat), heat.shape)
    half = kernel // 2
    sigma = 0.3 * ((kernel - 1) * 0.5 - 1) + 0.8
    taps = np.exp(-((np.arange(kernel) - half) ** 2) / (2 * sigma**2))
    taps /= taps.sum()
    padded = np.pad(heat.astype(float), half)
    rows = sum(taps[i] * padded[i : i + height] for i in range(kernel))
    blurred = sum(taps[i] * rows[:, i : i + width] for i in range(kernel))
    log = np.log(np.maximum(blurred * heat.max() / blurred.max(), 1e-10))
    if not (1 < x < width - 2 and 1 < y < height - 2):
        return x, y, heat[y, x]
    gradient = np.array([log[y, x + 1] - log[y, x - 1], log[y + 1, x] - log[y - 1, x]]) / 2
    dxx = (log[y, x + 2] - 2 * log[y, x] + log[y, x - 2]) / 4
    dyy = (log[y + 2, x] - 2 * log[y, x] + log[y - 2, x]) / 4
    dxy = (log[y + 1, x + 1] - log[y - 1, x + 1] - log[y + 1, x - 1] + log[y - 1, x - 1]) / 4
    hessian = np.array([[dxx, dxy], [dxy, dyy]])
    step = -np.linalg.solve(hessian, gradient) if np.linalg.det(hessian) else np.zeros(2)
    return x + step[0], y + step[1], heat[y, x]


def plain_dark_udp(heat, kernel):
    height, width = heat.shape
    y, x = np.unravel_index(np.argmax(heat), heat.shape)
    half = kernel // 2
    blurred = cv2.GaussianBlur(np.pad(heat, half), (kernel, kernel), 0)[half:-half, half:-half]
    log = np.pad(np.log(np.clip(blurred * heat.max() / blurred.max(), 1e-3, 50.0)), 1, mode="edge")
    log = log[y : y + 3, x : x + 3].astype(float)
    gradient = np.array([log[1, 2] - log[1, 0], log[2, 1] - log[0, 1]]) / 2
    dxx, dyy = log[1, 2] - 2 * log[1, 1] + log[1, 0], log[2, 1] - 2 * log[1, 1] + log[0, 1]
    dxy = (log[2, 2] - log[1, 2] - log[2, 1] + 2 * log[1, 1] - log[1, 0] - log[0, 1] + log[0, 0]) / 2
    least = np.finfo(np.float32).eps
    step = np.linalg.solve([[dxx + least, dxy], [dxy, dyy + least]], gradient)
    return x - step[0], y - step[1], heat[y, x]


def plain_integral(logits):
    heat = 1 / (1 + np.exp(-logits.astype(float)))
    total = sum(heat.ravel())
    x = sum(heat[i, j] * j for i in range(heat.shape[0]) for j in range(heat.shape[1])) / total
    y = sum(heat[i, j] * i for i in range(heat.shape[0]) for j in range(heat.shape[1])) / total
    return x, y, heat.max()


def agree(decoded, maps, plain):
    positions, scores = decoded
    for person in range(maps.shape[0]):
        for point in range(maps.shape[1]):
            x, y, score = plain(maps[person, point])
            np.testing.assert_allclose(positions[person, point], (x, y), atol=TOLERANCE)
            np.testing.assert_allclose(scores[person, point], score, rtol=1e-6)


@pytest.mark.parametrize("needs_both", [False, True])
@given(seed=SEEDS)
@settings(max_examples=20)
def test_quarter_offset(needs_both, seed):
    rng = np.random.default_rng(seed)
    for maps in (rng.random((2, 4, 7, 6), dtype=np.float32), gaussians(rng)[0]):
        decoded = decode.decode_quarter(maps, needs_both_axes=needs_both)
        agree(decoded, maps, lambda heat: plain_quarter(heat, needs_both))


@pytest.mark.parametrize("kernel", [11, 17])
@given(seed=SEEDS)
@settings(max_examples=20)
def test_dark(kernel, seed):
    maps, _ = gaussians(np.random.default_rng(seed), noise=0.003)
    agree(decode.decode_dark(maps, kernel), maps, lambda heat: plain_dark(heat, kernel))


@given(seed=SEEDS)
@settings(max_examples=20)
def test_dark_of_udp(seed):
    maps, _ = gaussians(np.random.default_rng(seed))
    agree(decode.decode_dark_udp(maps), maps, lambda heat: plain_dark_udp(heat, 11))


@pytest.mark.parametrize(
    ("decoder", "expected"),
    [
        (decode.decode_dark, [(5.29996, 7.80009), (0, 15), (4.11388, 4.81933), (11, 1)]),
        (decode.decode_dark_udp, [(5.30019, 7.79997), (-0.5, 15.5), (4.11477, 4.81221), (11.5, 1.38903)]),
    ],
)
def test_what_mmposes_own_code_gives(decoder, expected):
    """Peaks in the middle, at a corner, of two people, and at a border."""
    y, x = np.mgrid[:16, :12]

    def bump(cx, cy, sigma, top):
        return top * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * sigma**2))

    maps = np.stack(
        [
            bump(5.3, 7.8, 2, 1),
            bump(0.2, 15.4, 2, 1),
            bump(3.5, 3.5, 2, 0.4) + bump(6, 9, 3, 0.3),
            bump(10.7, 1.1, 1.5, 1),
        ]
    )
    np.testing.assert_allclose(decoder(maps[None].astype(np.float32))[0][0], expected, atol=1e-4)


@given(seed=SEEDS)
@settings(max_examples=20)
def test_dark_finds_the_centre_of_a_gaussian_far_better_than_the_cell(seed):
    maps, centres = gaussians(np.random.default_rng(seed), height=48, width=48)
    inner = ((centres > 10) & (centres < 37)).all(axis=-1)
    error = np.abs(decode.decode_dark(maps)[0] - centres)[inner]
    assert error.size == 0 or error.max() < 0.01


@given(seed=SEEDS)
@settings(max_examples=20)
def test_integral(seed):
    rng = np.random.default_rng(seed)
    maps = rng.normal(-8, 4, (2, 3, 8, 6)).astype(np.float32)
    agree(decode.decode_integral(maps), maps, plain_integral)


def test_combined_decodes_the_last_points_by_integral():
    rng = np.random.default_rng(3)
    maps = np.concatenate(
        [gaussians(rng, k=26)[0], rng.normal(-8, 4, (2, 110, 24, 18)).astype(np.float32)], axis=1
    )
    positions, scores = decode.decode_combined(maps, 110)
    agree((positions[:, :26], scores[:, :26]), maps[:, :26], lambda heat: plain_quarter(heat, True))
    agree((positions[:, 26:], scores[:, 26:]), maps[:, 26:], plain_integral)


@given(seed=SEEDS)
@settings(max_examples=20)
def test_simcc_takes_the_highest_bins_and_the_lower_value(seed):
    rng = np.random.default_rng(seed)
    x, y = rng.normal(0.5, 1, (3, 4, 12)), rng.normal(0.5, 1, (3, 4, 16))
    positions, scores = decode.decode_simcc(x, y)
    for person in range(3):
        for point in range(4):
            row_x, row_y = x[person, point].tolist(), y[person, point].tolist()
            assert scores[person, point] == min(max(row_x), max(row_y))
            assert positions[person, point].tolist() == [row_x.index(max(row_x)), row_y.index(max(row_y))]


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_what_has_no_positive_score_is_not_given(bad):
    maps = np.full((1, 2, 8, 6), bad, np.float32)
    maps[0, 1] = gaussians(np.random.default_rng(0), 1, 1, 8, 6)[0]
    x = np.stack([np.full(12, bad), np.arange(12.0)])[None]
    decoded = [decode.decode_quarter(maps), decode.decode_dark(maps), decode.decode_simcc(x, x)]
    for positions, scores in decoded:
        assert np.isnan(positions[0, 0]).all() and scores[0, 0] == 0
        assert np.isfinite(positions[0, 1]).all() and scores[0, 1] > 0


@given(seed=SEEDS)
@settings(max_examples=15)
def test_roi_maps_against_their_definition(seed):
    """Bicubic enlargement (Keys, a = -0.75) written out, the peak's pixel centre, the softmax mass."""
    rng = np.random.default_rng(seed)
    maps = rng.normal(0, 3, (1, 2, 6, 6)).astype(np.float32)
    corner, size = rng.uniform(0, 50, 2), rng.uniform(0.5, 20, 2)
    box = np.array([[*corner, *(corner + size)]])
    positions, scores = decode.decode_roi_maps(maps, box)
    size = np.maximum(size, 1)
    pixels = [math.ceil(s) for s in size]
    weights = [bicubic_weights(6, n) for n in pixels]
    for point in range(2):
        large = weights[1] @ maps[0, point].astype(float) @ weights[0].T
        y, x = np.unravel_index(np.argmax(large), large.shape)
        truth = corner + (np.array([x, y]) + 0.5) * size / pixels
        np.testing.assert_allclose(positions[0, point], truth, atol=TOLERANCE)
        mass = np.exp(large.max()) / np.exp(maps[0, point].astype(float)).sum()
        np.testing.assert_allclose(scores[0, point], mass, rtol=1e-4)


def bicubic_weights(n_in, n_out, a=-0.75):
    """(n_out, n_in) matrix of a bicubic resize whose border repeats."""
    matrix = np.zeros((n_out, n_in))
    for i in range(n_out):
        at = (i + 0.5) * n_in / n_out - 0.5
        for tap in range(math.floor(at) - 1, math.floor(at) + 3):
            d = abs(at - tap)
            near = (a + 2) * d**3 - (a + 3) * d**2 + 1
            far = a * d**3 - 5 * a * d**2 + 8 * a * d - 4 * a
            matrix[i, min(max(tap, 0), n_in - 1)] += near if d <= 1 else far
    return matrix


def test_blur_is_opencvs_with_zeros_around():
    heat = np.random.default_rng(5).random((1, 3, 20, 15), dtype=np.float32)
    got = decode._blur(heat, 11)
    for map_, blurred in zip(heat[0], got[0], strict=True):
        padded = cv2.GaussianBlur(np.pad(map_, 5), (11, 11), 0)[5:-5, 5:-5]
        np.testing.assert_allclose(blurred, padded, atol=1e-6)
