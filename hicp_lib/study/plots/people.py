"""People drawn on images: keypoints and limbs, for one detector, for the truth, or side by side."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import read_image
from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.formats.annotations import Annotations
from hicp_lib.inspection.skeletons import draw_people
from hicp_lib.study.plots.palette import detector_colour
from hicp_lib.study.plots.style import COLUMN_IN, Figure, in_lines, in_style, new_figure, texts

_CELL_RATIOS = (0.4, 1.7)  # height over width of a cell: at least, at most


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
        As #RRGGBB.
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


@in_style
def picture_grid(
    rows: Sequence[Sequence[np.ndarray | None]],
    caption: str,
    alt: str,
    row_titles: Sequence[str] = (),
    titles: Sequence[str] = (),
    cell_in: float = 2.2,
    title_pt: float = 0,
) -> Figure:
    """Pictures in rows and columns, each scaled into an equal cell.

    Parameters
    ----------
    rows : sequence of sequence of array, shape (height, width, 3)
        RGB, uint8; None leaves a cell empty.
    caption, alt : str
    row_titles : sequence of str
    titles : sequence of str
        Of the pictures, row by row; as many as there are columns name these.
    cell_in : float
        Width of a cell in inches.
    title_pt : float
        Size of all titles; 0 for 9, and less over narrow cells.

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
    named = axes[0] if len(titles) == n_columns else [axis for axis in axes.flat if axis.images]
    for axis, title in zip(named, titles, strict=bool(titles)):
        axis.set_title(in_lines(title), loc="center", fontsize=title_pt or min(9, 4 * cell_in), pad=2)
    for axis, title in zip(axes[:, 0], row_titles, strict=False):
        axis.set_ylabel(title, fontsize=max(title_pt, 9))
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
    n_seen = {d: sum(len(found[d]) > 0 for _, found in pictures.values()) for d in detectors}
    seen = [f"{d} {n} of {len(pictures)}" for d, n in n_seen.items()]
    said = {"min_score": min_score, "note": note and f" {note}", "pictures": list(pictures), "seen": seen}
    return picture_grid(
        [drawn[start : start + columns] for start in range(0, len(drawn), columns)],
        *texts("detections_grid", **said),
        row_titles=list(pictures) if len(pictures) > 1 else (),
        titles=detectors,
        cell_in=COLUMN_IN / max(columns, 2),
    )
