"""People drawn on images: keypoints and limbs, for one detector, for the truth, or side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import matplotlib.colors
import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import FACE, HANDS, LIMBS, N_KEYPOINTS
from hicp_lib.study.plots.style import Figure, detector_colour, in_style, in_words, new_figure

_SHIFT = 4  # fractional bits of OpenCV's drawing coordinates


def draw_people(
    image: np.ndarray,
    keypoints_px: np.ndarray,
    scores: np.ndarray,
    colour: str,
    min_score: float = 0.1,
    thickness_px: float | None = None,
) -> np.ndarray:
    """Draw skeletons onto a copy of an image.

    Parameters
    ----------
    image : array, shape (height, width, 3), RGB, uint8
    keypoints_px : array, shape (n_persons, 136, 2), NaN where absent
    scores : array, shape (n_persons, 136); points and limbs below `min_score` are left out
    colour : any Matplotlib colour; every line gets a thin dark rim so that it shows on any background
    thickness_px : width of a body limb; default a 260th of the image's diagonal
    """
    canvas = np.ascontiguousarray(image).copy()
    rgb = tuple(int(round(255 * channel)) for channel in matplotlib.colors.to_rgb(colour))
    width_px = thickness_px or max(1.5, np.hypot(*image.shape[:2]) / 260)
    for points, confidence in zip(keypoints_px, scores, strict=True):
        shown = (
            np.isfinite(points).all(axis=1) & (confidence >= min_score) & (np.abs(points).max(axis=1) < 1e5)
        )
        for rim, pen in ((1.6, (20, 20, 20)), (0.0, rgb)):
            _draw_limbs(canvas, points, shown, pen, width_px, rim)
            _draw_points(canvas, points, shown, pen, width_px, rim)
    return canvas


def _draw_limbs(canvas, points, shown, pen, width_px, rim) -> None:
    for a, b in LIMBS:
        if shown[a] and shown[b]:
            width = width_px * (0.55 if a in HANDS else 1.0) + rim
            cv2.line(
                canvas, _fixed(points[a]), _fixed(points[b]), pen, max(1, round(width)), cv2.LINE_AA, _SHIFT
            )


def _draw_points(canvas, points, shown, pen, width_px, rim) -> None:
    for i in np.flatnonzero(shown):
        size = 0.45 if i in FACE else 0.6 if i in HANDS else 1.2
        radius = round((width_px * size + rim / 2) * (1 << _SHIFT))
        cv2.circle(canvas, _fixed(points[i]), radius, pen, -1, cv2.LINE_AA, _SHIFT)


def _fixed(point) -> tuple[int, int]:
    return tuple(int(round(value * (1 << _SHIFT))) for value in point)


@in_style
def picture_grid(
    rows: Sequence[Sequence[np.ndarray | None]],
    *,
    row_titles: Sequence[str] = (),
    column_titles: Sequence[str] = (),
    caption: str,
    alt: str,
    cell_in: float = 2.2,
) -> Figure:
    """Pictures in rows and columns, each scaled into an equal cell; None leaves a cell empty."""
    n_columns = max(len(row) for row in rows)
    # Each row is as high as its highest picture needs, within limits; cells are equally wide.
    heights = [
        float(
            np.clip(
                max((image.shape[0] / image.shape[1] for image in row if image is not None), default=1),
                0.4,
                1.7,
            )
        )
        for row in rows
    ]
    size = {"width_in": cell_in * n_columns, "height_in": cell_in * sum(heights) + 0.3}
    figure, axes = new_figure(len(rows), n_columns, squeeze=False, height_ratios=heights, **size)
    for i, row in enumerate(rows):
        for j in range(n_columns):
            axis = axes[i, j]
            axis.set(xticks=[], yticks=[])
            axis.grid(False)
            for spine in axis.spines.values():
                spine.set_visible(False)
            if j < len(row) and row[j] is not None:
                axis.imshow(row[j], interpolation="lanczos")
            if i == 0 and j < len(column_titles):
                axis.set_title(column_titles[j], loc="center", fontsize=9)
            if j == 0 and i < len(row_titles):
                axis.set_ylabel(row_titles[i], fontsize=9)
    return Figure(figure, caption, alt)


def detections_grid(
    pictures: Mapping[str, tuple[np.ndarray, Mapping[str, Detections]]], min_score: float, note: str = ""
) -> Figure:
    """Pictures (rows) as seen by detectors (columns).

    Parameters
    ----------
    pictures : title -> (RGB image, detector name -> its detections); all with the same detectors
    min_score : keypoints below it are not drawn
    note : what the pictures are, for the caption
    """
    detectors = list(next(iter(pictures.values()))[1])
    rows = [
        [
            draw_people(image, found[d].keypoints_px, found[d].scores, detector_colour(d), min_score)
            for d in detectors
        ]
        for image, found in pictures.values()
    ]
    seen = [
        f"{detector} {sum(len(found[detector]) > 0 for _, found in pictures.values())}"
        for detector in detectors
    ]
    return picture_grid(
        rows,
        row_titles=list(pictures),
        column_titles=detectors,
        caption=f"Keypoints with a score of at least {min_score}, per detector.{' ' if note else ''}{note}",
        alt=f"{len(rows)} pictures with drawn skeletons; with somebody found: {in_words(seen)}.",
        cell_in=min(3.2, 11 / len(detectors)),
    )


def visible_scores(visibility: np.ndarray) -> np.ndarray:
    """Annotated visibility flags as drawing scores: visible 1, occluded 0.5, not labelled 0."""
    flags = np.asarray(visibility, dtype=float).reshape(-1, N_KEYPOINTS)
    return np.where(flags >= 2, 1.0, np.where(flags > 0, 0.5, 0.0))
