"""Whether the coordinates of a file can be pixels of its images, and its boxes x, y, width, height."""

from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError

_FRACTION = 1.5  # as large as fractions of an image get, when keypoints lie a little outside of it
_LEAST_POINTS = 3  # fewer may lie at the corner of an image by chance
_SLACK_PX = 1.0
_FEW = 0.02  # of the labels, which lie outside their images in public data sets, too
_CERTAIN = 10  # people, of whom none contradicts
_MUCH = 0.25  # of a box's side: less from the image's corner, and its two readings are nearly one


def refuse_fractions(path: Path | str, points_px: np.ndarray, what: str = "keypoints") -> None:
    """Refuse coordinates that are fractions of the image, from 0 or -1 to 1.

    Parameters
    ----------
    path : Path or str
        The file or folder, for the message.
    points_px : array, shape (n, k, 2)
        Of everybody in it; NaN, and 0, 0, where not given.
    what : str, optional
        What they are, for the message.

    Raises
    ------
    InputError
        If that is what all coordinates are of half of the people or more, who have three points at least.
    """
    given = np.isfinite(points_px).all(axis=-1) & (points_px != 0).any(axis=-1)
    small = (np.abs(points_px) <= _FRACTION).all(axis=-1)
    people = given.sum(axis=-1) >= min(_LEAST_POINTS, points_px.shape[-2])
    fractions = people & (small | ~given).all(axis=-1)
    if fractions.any() and 2 * fractions.sum() >= people.sum():
        span = "[0, 1]" if points_px[fractions][given[fractions]].min() >= 0 else "[-1, 1]"
        some = "" if fractions.sum() == people.sum() else f" of {fractions.sum()} of {people.sum()} people"
        raise InputError(
            f"{path}: {what}: all coordinates{some} lie in {span}; expected pixels, multiply by the image's "
            "width and height"
        )


def corners_note(
    path: Path | str, boxes_px: np.ndarray, keypoints_px: np.ndarray, sizes_px: np.ndarray
) -> str:
    """Refuse boxes that are x1, y1, x2, y2, and say where they could be.

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
        Empty where they cannot be corners.

    Raises
    ------
    InputError
        If as corners all of them fit images and people, and as x, y, width, height most leave the image, or
        ten end far beyond their people.
    """
    first, last = boxes_px[:, :2], boxes_px[:, 2:]
    low, high = (first - _SLACK_PX)[:, None], (last + _SLACK_PX)[:, None]
    holds = ((keypoints_px >= low) & (keypoints_px <= high) | np.isnan(keypoints_px)).all(axis=(1, 2))
    fits = holds & ((last > first) & (last <= sizes_px + _SLACK_PX)).all(axis=-1)
    far = (first > _MUCH * last).any(axis=-1)
    leaves = (first + last > sizes_px + _SLACK_PX).any(axis=-1) & far
    labelled = np.isfinite(keypoints_px).all(axis=-1).sum(axis=-1) >= _LEAST_POINTS
    n_far = int((far & labelled).sum())
    if not fits[far].all() or not n_far and 2 * leaves.sum() <= far.sum():
        return ""
    if 2 * leaves.sum() > far.sum() or n_far >= _CERTAIN:
        problem = "the boxes fit images and people as x1, y1, x2, y2 only"
        raise InputError(f"{path}: bbox: {problem}; expected x, y, width, height")
    return "the boxes would fit as x1, y1, x2, y2, too; they are read as x, y, width, height"


def outside_note(boxes_px: np.ndarray, keypoints_px: np.ndarray, sizes_px: np.ndarray) -> str:
    """How many labelled keypoints and boxes leave their images; empty if none.

    Parameters
    ----------
    boxes_px, keypoints_px, sizes_px : array
        As of `corners_note`.
    """
    ends = np.stack([boxes_px[:, :2], boxes_px[:, :2] + boxes_px[:, 2:]], axis=1)
    counts = []
    for points in (keypoints_px, ends):
        leaves = (points < -_SLACK_PX) | (points > sizes_px[:, None] + _SLACK_PX)
        counts += [int(leaves.any(axis=-1).sum()), int(np.isfinite(points).all(axis=-1).sum())]
    n_outside, n_points, n_ends, n_corners = counts
    if not n_outside and not n_ends:
        return ""
    turned = "; are the images turned by an orientation flag?" if n_outside > _FEW * n_points else ""
    return (
        f"{n_outside} of {n_points} labelled keypoints and {n_ends} of {n_corners} corners of boxes "
        f"lie outside their images{turned}"
    )
