"""People drawn on images: keypoints and limbs, for one detector, for the truth, or side by side."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import matplotlib.colors
import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import read_image
from hicp_lib.core.keypoints import FACE, HANDS, LIMBS, N_KEYPOINTS
from hicp_lib.formats.annotations import Annotations
from hicp_lib.study.plots.palette import detector_colour
from hicp_lib.study.plots.style import Figure, in_lines, in_style, in_words, new_figure

_SHIFT = 4  # fractional bits of OpenCV's drawing coordinates
_MAX_PX = 1e5  # points farther off would overflow them
_RIM_PX, _RIM_COLOUR = 1.6, (20, 20, 20)
# Widths of lines and radii of points, as multiples of a body limb's width.
_HAND_LIMB, _FACE_POINT, _HAND_POINT, _BODY_POINT = 0.55, 0.45, 0.6, 1.2
_CELL_RATIOS = (0.4, 1.7)  # height over width of a cell: at least, at most


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
    image : array, shape (height, width, 3)
        RGB, uint8.
    keypoints_px : array, shape (n_persons, 136, 2)
        NaN where absent.
    scores : array, shape (n_persons, 136)
    colour : str
        Any Matplotlib colour; every line gets a thin dark rim so that it shows on any background.
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
    rgb = tuple(int(round(255 * channel)) for channel in matplotlib.colors.to_rgb(colour))
    width_px = thickness_px or max(1.5, np.hypot(*image.shape[:2]) / 260)
    for points, confidence in zip(keypoints_px, scores, strict=True):
        is_near = np.isfinite(points).all(axis=1) & (np.abs(points).max(axis=1) < _MAX_PX)
        shown = is_near & (confidence >= min_score)
        for rim_px, pen in ((_RIM_PX, _RIM_COLOUR), (0.0, rgb)):
            _draw_person(canvas, points, shown, pen, width_px, rim_px)
    return canvas


def draw_detections(
    image: np.ndarray, found: Detections, detector: str, min_score: float = 0.1
) -> np.ndarray:
    """Draw what a detector found onto a copy of an image, in the detector's colour.

    Parameters
    ----------
    image : array, shape (height, width, 3)
        RGB, uint8.
    found : Detections
    detector : str
        Its name.
    min_score : float
        Points below it, and their limbs, are left out.

    Returns
    -------
    array, shape (height, width, 3)
    """
    return draw_people(image, found.keypoints_px, found.scores, detector_colour(detector), min_score)


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
        for colour, width_px in ((_RIM_COLOUR, 5), ((255, 255, 255), 2)):
            cv2.circle(canvas, centre_px, radius_px, colour, width_px, cv2.LINE_AA)
    return canvas


def draw_truth(
    annotations: Annotations,
    images_dir: str | Path,
    image_id: int,
    rows: np.ndarray,
    colour: str,
    n_keypoints: int = N_KEYPOINTS,
) -> np.ndarray:
    """An image with annotated keypoints drawn.

    Parameters
    ----------
    annotations : Annotations
    images_dir : str or Path
        Folder of the images.
    image_id : int
    rows : array of bool, shape (n_annotations,)
        Whose keypoints.
    colour : str
        Any Matplotlib colour.
    n_keypoints : int
        Of Halpe's 136, only the first so many: 26 are body, feet and head.

    Returns
    -------
    array, shape (height, width, 3)
        RGB, uint8.
    """
    image = read_image(Path(images_dir) / annotations.images[image_id].file_name)
    shown = (annotations.visibility[rows] > 0) & (np.arange(N_KEYPOINTS) < n_keypoints)
    return draw_people(image, annotations.keypoints_px[rows], shown.astype(float), colour)


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


@in_style
def picture_grid(
    rows: Sequence[Sequence[np.ndarray | None]],
    *,
    row_titles: Sequence[str] = (),
    titles: Sequence[str] = (),
    caption: str,
    alt: str,
    cell_in: float = 2.2,
) -> Figure:
    """Pictures in rows and columns, each scaled into an equal cell.

    Parameters
    ----------
    rows : sequence of sequence of array, shape (height, width, 3)
        RGB, uint8; None leaves a cell empty.
    row_titles : sequence of str
    titles : sequence of str
        Of the cells, row by row; as many as there are columns name these.
    caption, alt : str
    cell_in : float
        Width of a cell in inches.

    Returns
    -------
    Figure
    """
    n_columns = max(len(row) for row in rows)
    # Each row is as high as its highest picture needs, within limits; cells are equally wide.
    ratios = [[image.shape[0] / image.shape[1] for image in row if image is not None] for row in rows]
    heights = [float(np.clip(max(of_row, default=1), *_CELL_RATIOS)) for of_row in ratios]
    size = {"width_in": cell_in * n_columns, "height_in": cell_in * sum(heights) + 0.3}
    figure, axes = new_figure(len(rows), n_columns, squeeze=False, height_ratios=heights, **size)
    for (i, j), axis in np.ndenumerate(axes):
        axis.set(xticks=[], yticks=[])
        axis.grid(False)
        axis.spines[:].set_visible(False)
        if j < len(rows[i]) and rows[i][j] is not None:
            axis.imshow(rows[i][j], interpolation="lanczos")
    for axis, title in zip(axes.flat, titles, strict=False):
        axis.set_title(in_lines(title), loc="center", fontsize=min(9, 4 * cell_in))
    for axis, title in zip(axes[:, 0], row_titles, strict=False):
        axis.set_ylabel(title, fontsize=9)
    return Figure(figure, caption, alt)


@in_style
def detections_grid(
    pictures: Mapping[str, tuple[np.ndarray, Mapping[str, Detections]]], min_score: float, note: str = ""
) -> Figure:
    """Pictures (rows) as seen by detectors (columns); one picture alone, two abreast.

    Parameters
    ----------
    pictures : mapping of str to (array, mapping of str to Detections)
        Title -> RGB image, and detector name -> its detections; all with the same detectors.
    min_score : float
        Keypoints below it are not drawn.
    note : str
        What the pictures are, for the caption.

    Returns
    -------
    Figure
    """
    detectors = list(next(iter(pictures.values()))[1])
    columns = len(detectors) if len(pictures) > 1 else min(len(detectors), 2)
    shown = [(image, found[d], d) for image, found in pictures.values() for d in detectors]
    drawn = [draw_detections(*one, min_score) for one in shown]
    seen = [f"{d} {sum(len(found[d]) > 0 for _, found in pictures.values())}" for d in detectors]
    return picture_grid(
        [drawn[start : start + columns] for start in range(0, len(drawn), columns)],
        row_titles=list(pictures) if len(pictures) > 1 else (),
        titles=detectors,
        caption=f"Keypoints with a score of at least {min_score}, per detector.{' ' if note else ''}{note}",
        alt=f"Skeletons on {in_words(pictures)}; pictures with somebody found: {in_words(seen)}.",
        cell_in=min(3.2, 11 / columns),
    )
