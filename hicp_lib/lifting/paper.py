"""Lift image keypoints with a depth image to points in space by the paper's method (section III-B).

The neighbourhood of a keypoint is a square: the pixels within fx r / d, in u and in v, of the keypoint's
pixel, with d the depth there. r is 20 mm for body and feet, 3 mm for face and hands. Every pixel of it that
has a depth is lifted, x = d (u - cx) / fx, y = d (v - cy) / fy, z = d, and the point is the median of each
coordinate.

What the paper leaves open is defined here:

- r is half the side of the square, though the paper's words could also mean the whole side.
- If the keypoint's own pixel has no depth, the size follows from the nearest pixel whose own neighbourhood
  would include the keypoint; if there is none, the keypoint is not lifted.
- At the image's border the neighbourhood is the part inside. A keypoint outside the image, beyond the
  outer edges of its pixels, is not lifted.
- At a step in depth the side with more pixels wins, even if the keypoint lies on the other one. Each
  coordinate is treated separately, so with sides of equal size the point may lie between them.
- A keypoint that is not detected (NaN) is not lifted.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hicp_lib.core.camera import Camera
from hicp_lib.core.keypoints import BODY, N_KEYPOINTS
from hicp_lib.core.memo import memoised

BODY_RADIUS_M = 0.020
RADIUS_M = np.full(N_KEYPOINTS, 0.003)
RADIUS_M[BODY] = BODY_RADIUS_M

REASONS = ("lifted", "not_detected", "outside_image", "no_depth", "guessed")
"""Meanings of `Lifted.reason`: lifted to a seen depth, or why not; "guessed" has a depth not seen."""
LIFTED, NOT_DETECTED, OUTSIDE_IMAGE, NO_DEPTH, GUESSED = range(5)

MIN_DEPTH_M = 0.1  # below the range of depth cameras; limits the neighbourhood

_BLOCK = 1 << 20  # pixels gathered at a time


@dataclass(frozen=True)
class Lifted:
    """Keypoints in space.

    Attributes
    ----------
    points_m : array, shape (n_people, 136, 3)
        In the camera frame; NaN where not lifted.
    reason : array, shape (n_people, 136), dtype int8
        Index into `REASONS`.
    sigma_m : array, shape (n_people, 136)
        Standard deviation of the depth; NaN where not lifted, and everywhere by the paper's method.
    """

    points_m: np.ndarray
    reason: np.ndarray
    sigma_m: np.ndarray


def lift(
    keypoints_px: np.ndarray, depth_m: np.ndarray, intrinsics: Camera, radius_m: np.ndarray | float = RADIUS_M
) -> Lifted:
    """Lift the keypoints of all people in an image by the paper's method, defined in this module's docstring.

    Parameters
    ----------
    keypoints_px : array, shape (n_people, 136, 2)
        (u, v), pixel centres at integers; NaN: not detected.
    depth_m : array, shape (height, width)
        Depth along the camera's z axis at the pixels of the image the keypoints were found in; 0, NaN or
        infinite: no depth.
    intrinsics : Camera
        Of that image.
    radius_m : float or array, shape (136,), optional
        r, one for all keypoints or one for each.

    Returns
    -------
    Lifted

    Raises
    ------
    ValueError
        If shapes do not match.

    Examples
    --------
    >>> keypoints_px = np.full((1, 136, 2), np.nan)
    >>> keypoints_px[0, 9] = 40, 20  # the left wrist
    >>> lifted = lift(keypoints_px, np.full((48, 64), 2.0), Camera(64, 48, 100.0, 100.0, 32.0, 24.0))
    >>> lifted.points_m[0, 9], REASONS[lifted.reason[0, 9]], REASONS[lifted.reason[0, 10]]
    (array([ 0.16, -0.08,  2.  ]), 'lifted', 'not_detected')
    """
    keypoints_px, depth_m = np.asarray(keypoints_px, float), np.asarray(depth_m)
    if keypoints_px.ndim != 3 or keypoints_px.shape[1:] != (N_KEYPOINTS, 2):
        raise ValueError(f"keypoints have shape {keypoints_px.shape}, not (n_people, {N_KEYPOINTS}, 2)")
    size = (intrinsics.height_px, intrinsics.width_px)
    if depth_m.shape != size:
        raise ValueError(f"the depth image has shape {depth_m.shape}, the camera's is {size}")
    if not np.issubdtype(depth_m.dtype, np.floating):
        depth_m = depth_m.astype(float)
    is_inside = intrinsics.contains(keypoints_px)
    at = np.floor(keypoints_px[is_inside, ::-1] + 0.5).astype(int).T
    radius_m = np.broadcast_to(radius_m, N_KEYPOINTS)[np.nonzero(is_inside)[1]]
    half_px = _half_widths(depth_m, at, intrinsics.fx_px * radius_m)
    lifted = np.full((len(half_px), 3), np.nan)
    for some in _of_like_size(half_px):
        lifted[some] = _medians(depth_m, at[:, some], half_px[some], intrinsics)
    is_unknown = np.isnan(keypoints_px.sum(axis=2))
    reason = np.where(is_unknown, NOT_DETECTED, OUTSIDE_IMAGE).astype(np.int8)
    reason[is_inside] = np.where(np.isnan(lifted[:, 2]), NO_DEPTH, LIFTED)
    points_m = np.full((*reason.shape, 3), np.nan)
    points_m[is_inside] = lifted
    return Lifted(points_m, reason, np.full(reason.shape, np.nan))


def _windows(depth_m: np.ndarray, at: np.ndarray, half_px: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Square pieces of a depth image around pixels (rows and columns, (2, n)), 0 beyond the image's border.

    Depths (n, w, w), w = 2 half_px + 1, and the rows and columns (n, w) of the pieces.
    """
    height, width = depth_m.shape
    rows, columns = at[:, :, None] + np.arange(-half_px, half_px + 1)
    inside_rows, inside_columns = (
        np.maximum(np.minimum(at, n - 1), 0) for at, n in ((rows, height), (columns, width))
    )
    pieces = depth_m.take((inside_rows * width)[:, :, None] + inside_columns[:, None, :])
    for beyond, lines in ((rows != inside_rows, pieces), (columns != inside_columns, pieces.swapaxes(1, 2))):
        if beyond.any():
            lines[beyond] = 0
    return pieces, rows, columns


def has_depth(depth_m: np.ndarray) -> np.ndarray:
    """Where a depth image holds a depth: positive and finite.

    Parameters
    ----------
    depth_m : array

    Returns
    -------
    array of bool
        Of the same shape.

    Examples
    --------
    >>> has_depth(np.array([0.0, 1.5, np.nan, np.inf]))
    array([False,  True, False, False])
    """
    return (depth_m > 0) & (depth_m < np.inf)


def _of_like_size(half_px: np.ndarray) -> Iterator[np.ndarray]:
    """Indices of neighbourhoods that differ less than twofold in size, few enough to be gathered at once."""
    octave = np.maximum(np.frexp(half_px)[1], 2)  # up to 3 pixels are one size
    for number in np.flatnonzero(np.bincount(octave)):
        alike = np.flatnonzero(octave == number)
        yield from _blocks(alike, half_px[alike].max())


def _blocks(points: np.ndarray, half_px: int) -> list[np.ndarray]:
    """Parts of points whose windows are gathered at once, of one at least."""
    n_blocks = 1 + len(points) * (2 * int(half_px) + 1) ** 2 // _BLOCK
    return np.array_split(points, min(n_blocks, len(points))) if n_blocks > 1 else [points]


def _half_widths(depth_m: np.ndarray, at: np.ndarray, radius_px: np.ndarray) -> np.ndarray:
    """Half widths of the neighbourhoods in whole pixels, (n,); `radius_px` is fx r, (n,), pixels x metres."""
    half = _sizes(radius_px, depth_m[*at])
    lost, reach, limit = np.flatnonzero(half < 0), 1, 2
    while len(lost) and reach < limit:
        # No corner of a neighbourhood is farther away than that of the least depth.
        limit = int(np.ceil(np.sqrt(2) * radius_px[lost].max() / MIN_DEPTH_M))
        reach = min(4 * reach, limit)
        for some in _blocks(lost, reach):
            half[some] = _sizes_that_reach(depth_m, at[:, some], radius_px[some], reach)
        lost = lost[half[lost] < 0]
    return np.maximum(half, 0)  # a hole that no pixel reaches has no depth


def _sizes(radius_px: np.ndarray, depth_m: np.ndarray) -> np.ndarray:
    """Half widths at some depths, whole numbers; -1 where there is no depth."""
    sizes = radius_px / np.maximum(depth_m, MIN_DEPTH_M)
    return np.where(has_depth(depth_m), sizes, -1).astype(int)


def _sizes_that_reach(depth_m: np.ndarray, at: np.ndarray, radius_px: np.ndarray, reach: int) -> np.ndarray:
    """Half width that the nearest pixel sets whose neighbourhood reaches the middle, (n,).

    -1 where there is none within `reach` pixels.
    """
    pieces, _, _ = _windows(depth_m, at, reach)
    order, away = _disk(reach)
    sizes = _sizes(radius_px[:, None], pieces.reshape(len(pieces), -1)[:, order])
    nearest = (sizes >= away).argmax(axis=1)  # the first one, or the first of all if there is none
    sizes = sizes[np.arange(len(sizes)), nearest]
    return np.where(sizes >= away[nearest], sizes, -1)


@memoised()
def _disk(reach: int) -> tuple[np.ndarray, np.ndarray]:
    """Pixels of a square window at most `reach` from its middle, nearest first, and how wide each must be."""
    steps = np.arange(-reach, reach + 1)
    square = steps**2 + steps[:, None] ** 2
    order = np.argsort(square, axis=None, kind="stable")[: np.count_nonzero(square <= reach**2)]
    return order, np.maximum(abs(steps), abs(steps[:, None])).ravel()[order]


def _medians(depth_m: np.ndarray, at: np.ndarray, half_px: np.ndarray, intrinsics: Camera) -> np.ndarray:
    """Coordinate-wise medians of lifted neighbourhoods, (n, 3); gathered in windows of the largest's size."""
    reach = int(half_px.max())
    z, v, u = _windows(depth_m, at, reach)
    x = ((u - intrinsics.cx_px) / intrinsics.fx_px).astype(z.dtype)
    y = ((v - intrinsics.cy_px) / intrinsics.fy_px).astype(z.dtype)
    missing = ~has_depth(z)
    if half_px.min() < reach:
        far = abs(np.arange(-reach, reach + 1)) > half_px[:, None]
        missing |= far[:, :, None]
        missing |= far[:, None, :]
    points = np.empty((3, *z.shape), z.dtype)
    np.multiply(z, x[:, None, :], out=points[0])
    np.multiply(z, y[:, :, None], out=points[1])
    points[2] = z
    n_missing = np.count_nonzero(missing, axis=(1, 2))
    if n_missing.any():
        np.copyto(points, np.inf, where=missing)  # sorted to the end
    points = points.reshape(3, len(z), -1)
    points.sort(axis=2)
    n = points.shape[2] - n_missing
    every = np.arange(len(n))
    medians = (points[:, every, (n - 1) // 2].astype(float) + points[:, every, n // 2]) / 2
    return np.where(n > 0, medians, np.nan).T
