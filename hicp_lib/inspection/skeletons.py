"""Draw keypoints and limbs onto images."""

import cv2
import numpy as np

from hicp_lib.core.keypoints import FACE, HANDS, LIMBS

RIM_COLOUR = (20, 20, 20)
_SHIFT = 4  # fractional bits of OpenCV's drawing coordinates
_MAX_PX = 1e5  # points farther off would overflow them
_RIM_PX = 1.6
# Widths of lines and radii of points, as multiples of a body limb's width.
_HAND_LIMB, _FACE_POINT, _HAND_POINT, _BODY_POINT = 0.55, 0.45, 0.6, 1.2


def draw_people(
    image: np.ndarray, keypoints_px: np.ndarray, scores: np.ndarray, colour: str, min_score: float = 0.1,
    thickness_px: float | None = None,
) -> np.ndarray:  # fmt: skip
    """Draw skeletons onto a copy of an image.

    Parameters
    ----------
    image : array, shape (height, width, 3)
        RGB, uint8.
    keypoints_px : array, shape (n_persons, 136, 2)
        NaN where absent.
    scores : array, shape (n_persons, 136)
    colour : str
        As #RRGGBB; every line gets a thin dark rim so that it shows on any background.
    min_score : float
        Points below it, and their limbs, are left out.
    thickness_px : float, optional
        Width of a body limb; a 260th of the image's diagonal where left out.

    Returns
    -------
    array, shape (height, width, 3)

    Examples
    --------
    >>> keypoints_px, scores = np.full((1, 136, 2), np.nan), np.zeros((1, 136))
    >>> keypoints_px[0, 0], scores[0, 0] = (8, 4), 0.9
    >>> draw_people(np.zeros((9, 16, 3), np.uint8), keypoints_px, scores, "#FF0000")[4, 8].tolist()
    [255, 0, 0]
    """
    canvas = np.ascontiguousarray(image).copy()
    rgb = tuple(bytes.fromhex(colour.removeprefix("#")))
    width_px = thickness_px or max(1.5, np.hypot(*image.shape[:2]) / 260)
    for points, confidence in zip(keypoints_px, scores, strict=True):
        is_near = np.isfinite(points).all(axis=1) & (np.abs(points).max(axis=1) < _MAX_PX)
        shown = is_near & (confidence >= min_score)
        for rim_px, pen in ((_RIM_PX, RIM_COLOUR), (0.0, rgb)):
            _draw_person(canvas, points, shown, pen, width_px, rim_px)
    return canvas


def draw_rings(image: np.ndarray, places_px: np.ndarray, radius_px: int) -> np.ndarray:
    """Draw white rings onto a copy of an image.

    Parameters
    ----------
    image : array, shape (height, width, 3)
        RGB, uint8.
    places_px : array, shape (n, 2)
        Their centres; NaN for none.
    radius_px : int

    Returns
    -------
    array, shape (height, width, 3)
    """
    canvas = np.ascontiguousarray(image).copy()
    for place_px in places_px[(np.abs(places_px) < _MAX_PX).all(axis=1)]:
        centre_px = place_px.round().astype(int).tolist()
        for colour, width_px in ((RIM_COLOUR, 5), ((255, 255, 255), 2)):
            cv2.circle(canvas, centre_px, radius_px, colour, width_px, cv2.LINE_AA)
    return canvas


def _draw_person(canvas, points, shown, pen, width_px: float, rim_px: float) -> None:
    for a, b in LIMBS:
        if shown[a] and shown[b]:
            width = max(1, round(width_px * (_HAND_LIMB if a in HANDS else 1.0) + rim_px))
            cv2.line(canvas, _fixed(points[a]), _fixed(points[b]), pen, width, cv2.LINE_AA, _SHIFT)
    for i in np.flatnonzero(shown):
        size = _FACE_POINT if i in FACE else _HAND_POINT if i in HANDS else _BODY_POINT
        radius = round((width_px * size + rim_px / 2) * (1 << _SHIFT))
        cv2.circle(canvas, _fixed(points[i]), radius, pen, -1, cv2.LINE_AA, _SHIFT)


def _fixed(point) -> tuple[int, int]:
    u, v = (int(round(value * (1 << _SHIFT))) for value in point)
    return u, v
