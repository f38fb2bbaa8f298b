"""Checks that a file's coordinates are pixels of its images, and its boxes x, y, width, height."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import INDEX

_FRACTION = 1.5  # largest fractions of an image, with keypoints slightly outside
_SIGNED = -0.25  # below it, fractions start at -1: those from 0 are only slightly negative
_LEAST_POINTS = 3  # fewer may be at an image's corner by chance
_SLACK_PX = 1.0
_FEW = 0.02  # fraction of labels outside their images that occurs in public data sets
_SHOULDERS, _HIPS = ([INDEX[f"left_{part}"], INDEX[f"right_{part}"]] for part in ("shoulder", "hip"))
_FALLEN = "most shoulders are below hips; is the origin the bottom?"
_CERTAIN = 10  # number of people, without a contradiction
_MUCH = 0.25  # of a box's side: nearer to the image's corner, both readings are similar


def count_fractions(points_px: np.ndarray, n_before: int = 0) -> tuple[int, int, float, int]:
    """Count for `fractions_note`.

    Parameters
    ----------
    points_px : array, shape (n, k, 2)
        Of people; NaN, and 0, 0, where missing.
    n_before : int, optional
        How many people of the file were counted before.

    Returns
    -------
    n_people : int
        Those with three points or more.
    n_fractions : int
        Those of them all of whose coordinates may be fractions of the image, from 0 or -1 to 1.
    least : float
        The least coordinate of these.
    first : int
        The first of them in the file, from 0.
    """
    given = np.isfinite(points_px).all(axis=-1) & (points_px != 0).any(axis=-1)
    small = ((points_px <= _FRACTION) & (points_px >= -_FRACTION)).all(axis=-1)
    people = given.sum(axis=-1) >= min(_LEAST_POINTS, points_px.shape[-2])
    fractions = people & (small | ~given).all(axis=-1)
    least = points_px[fractions][given[fractions]].min(initial=0.0)
    first = n_before + int(np.append(fractions, True).argmax())
    return int(people.sum()), int(fractions.sum()), float(least), first


def fractions_note(
    path: Path | str, counts: Sequence[tuple[int, int, float, int]], what: str = "keypoints"
) -> str:
    """Refuse coordinates that are fractions of the image, and note where some people's may be.

    Parameters
    ----------
    path : Path or str
        The file or folder, for the message.
    counts : sequence of (int, int, float, int)
        `count_fractions` of all people in it, or of parts of them.
    what : str, optional
        What they are, for the message.

    Returns
    -------
    str
        Empty if nobody's may be.

    Raises
    ------
    InputError
        If this holds for all coordinates of at least half of the people who have three points or more.
    """
    n_people, n_fractions = (sum(of[k] for of in counts) for k in (0, 1))
    if n_fractions and 2 * n_fractions >= n_people:
        signed = min(of[2] for of in counts) < _SIGNED
        span, first = ("[-1, 1]", "add 1, halve and ") if signed else ("[0, 1]", "")
        expected = f"expected pixels, {first}multiply by the image's width and height"
        raise InputError(f"{path}: {what}: all coordinates lie in {span}; {expected}")
    row = next((of[3] for of in counts if of[1]), 0)
    some = f"{what} of {n_fractions} of {n_people} people, first of entry {row} (from 0), lie in [-1, 1]"
    return f"{some}; they are read as pixels: are they fractions of the image?" if n_fractions else ""


def corners_note(
    path: Path | str, boxes_px: np.ndarray, keypoints_px: np.ndarray, sizes_px: np.ndarray
) -> str:
    """Refuse boxes given as x1, y1, x2, y2, and note where this is possible.

    Parameters
    ----------
    path : Path or str
        The file, for the message.
    boxes_px : array, shape (n, 4)
        Of people.
    keypoints_px : array, shape (n, k, 2)
        Labelled ones; NaN elsewhere.
    sizes_px : array, shape (n, 2)
        Width and height of their images.

    Returns
    -------
    str
        Empty if they cannot be corners.

    Raises
    ------
    InputError
        If all of them fit images and people as corners, while as x, y, width, height most leave the image, or
        ten end far beyond their people.
    """
    first, last = boxes_px[:, :2], boxes_px[:, 2:]
    leave = beyond(keypoints_px, first[:, None], last[:, None])
    ordered = np.all((last > first) & (last <= sizes_px + _SLACK_PX), axis=-1)
    fits = ordered & ~leave.any(axis=1)
    labelled = np.isfinite(keypoints_px[..., 0]).sum(axis=-1) >= _LEAST_POINTS
    far = labelled & (first > _MUCH * last).any(axis=-1)
    n_far, n_beyond = far.sum(), (far & (first + last > sizes_px + _SLACK_PX).any(axis=-1)).sum()
    if not n_far or (far & ~fits).any():
        return ""
    if 2 * n_beyond > n_far or n_far >= _CERTAIN:
        problem = "the boxes fit images and people as x1, y1, x2, y2 only"
        raise InputError(f"{path}: bbox: {problem}; expected x, y, width, height")
    return "the boxes would fit as x1, y1, x2, y2, too; they are read as x, y, width, height"


def beyond(points_px: np.ndarray, low_px: ArrayLike, high_px: ArrayLike) -> np.ndarray:
    """Which points exceed a range by more than a pixel, the tolerance for rounding.

    Parameters
    ----------
    points_px : array, shape (..., 2)
        NaN does not count.
    low_px, high_px : float or array, shape (..., 2)
        Minimum and maximum of both coordinates.

    Returns
    -------
    array of bool, shape (...)

    Examples
    --------
    >>> beyond(np.array([[-2.0, 5.0], [-1.0, 11.0], [np.nan, 5.0]]), 0, 10)
    array([ True, False, False])
    """
    low_px, high_px = np.asarray(low_px) - _SLACK_PX, np.asarray(high_px) + _SLACK_PX
    u, v = np.moveaxis((points_px < low_px) | (points_px > high_px), -1, 0)
    return u | v


def doubts(boxes_px: np.ndarray, keypoints_px: np.ndarray, sizes_px: np.ndarray) -> str:
    """Signs that coordinates are not pixels of the images from their top left corner; empty if none.

    Parameters
    ----------
    boxes_px, keypoints_px, sizes_px : array
        As of `corners_note`.
    """
    (first, room), sizes = np.split(boxes_px[:, None], 2, axis=-1), sizes_px[:, None]
    last, few = first + room, _FEW * np.isfinite(keypoints_px[..., 0]).sum()
    ends = np.hstack([first, last])
    n_points, n_ends = (int(beyond(of, 0, sizes).sum()) for of in (keypoints_px, ends))
    n_astray = int(beyond(keypoints_px, first - _MUCH * room, last + _MUCH * room).sum())
    turned = "; are the images turned by an orientation flag?" if n_points > few else ""
    rises_px = keypoints_px[:, _HIPS, 1] - keypoints_px[:, _SHOULDERS, 1]
    fallen = (rises_px < 0).sum() > (rises_px >= 0).sum()
    outside = f"{n_points} labelled keypoints, {n_ends} corners of boxes outside images{turned}"
    astray = f"{n_astray} labelled keypoints are far from the box of their person"
    found = {outside: n_points + n_ends, astray: n_astray > few, _FALLEN: fallen}
    return "; ".join(note for note, holds in found.items() if holds)
