"""The geometry of HiCP's crops.

After Docekal et al. 2022, section III-A. The paper says that people are cropped by their boxes, and that
crops of at least 20,000 pixels are kept. The rest was chosen here:

- A box is rounded outwards to whole pixels and clipped to the image. Keypoint u lies in pixel column i when
  it is in [i - 0.5, i + 0.5); keypoints outside the crop are no longer labelled. Boxes end at the edges of
  pixels, and tools that draw boxes around keypoints measure those from the edges, too. So a crop is enlarged
  by a pixel if a keypoint in its person's box, or on its edge, would be lost, and a keypoint between the
  image's last pixel centres and its edge is moved onto these pixels.
- The segment's area is reduced in proportion to the part of the box that remains.
"""

from dataclasses import replace

import numpy as np

from hicp_lib.core.images import Box, inside
from hicp_lib.formats.annotations import Annotations
from hicp_lib.formats.cropcoco import OUTSIDE

_EDGE_PX = 0.5  # how far rounding may put a keypoint outside the box drawn around it


def whole_pixel_boxes(boxes_px: np.ndarray, widths_px: np.ndarray, heights_px: np.ndarray) -> np.ndarray:
    """Round boxes outwards to whole pixels within their images.

    Parameters
    ----------
    boxes_px : array, shape (n, 4)
        x, y, width, height.
    widths_px, heights_px : array, shape (n,)
        Sizes of the images.

    Returns
    -------
    array of int, shape (n, 4)
        Left, top, right, bottom, the last two exclusive. Right <= left or bottom <= top where a box is empty
        or lies outside its image.

    Examples
    --------
    >>> whole_pixel_boxes(np.array([[-3.5, 2.2, 10, 5]]), np.array([640]), np.array([480]))
    array([[0, 2, 7, 8]])
    """
    limits = np.stack([widths_px, heights_px], axis=-1)
    start, end = boxes_px[:, :2], boxes_px[:, :2] + boxes_px[:, 2:]
    first = np.clip(np.floor(start), 0, limits)
    past = np.where(end > start, np.clip(np.ceil(end), 0, limits), first)
    return np.concatenate([first, past], axis=-1).astype(int)


def on_pixels(annotations: Annotations) -> Annotations:
    """Annotations with keypoints between the last pixels of an image and its edge moved onto those pixels."""
    keypoints, sizes = annotations.keypoints_px, image_sizes(annotations)[:, None]
    past = (keypoints >= sizes - 0.5) & (keypoints <= sizes) & (annotations.visibility > 0)[..., None]
    return replace(annotations, keypoints_px=np.where(past, sizes - 0.51, keypoints))


def image_sizes(annotations: Annotations) -> np.ndarray:
    """Width and height of the image each person is in, shape (n, 2)."""
    images = [annotations.images[i] for i in annotations.image_ids.tolist()]
    return np.array([(image.width_px, image.height_px) for image in images]).reshape(-1, 2)


def person_crops(annotations: Annotations) -> tuple[np.ndarray, np.ndarray]:
    """The crop of each person: the pixels of the box, and of labelled keypoints within it or on its edge.

    Parameters
    ----------
    annotations : Annotations
        From `on_pixels`.

    Returns
    -------
    boxes_px, crops_px : array of int, shape (n, 4)
        Left, top, right, bottom, the last two exclusive: as from `whole_pixel_boxes`, and with the keypoints.
    """
    sizes, (start, sides) = image_sizes(annotations), np.split(annotations.boxes_px[:, None], 2, axis=-1)
    boxes_px, points = whole_pixel_boxes(annotations.boxes_px, *sizes.T), annotations.keypoints_px
    near = (points >= start - _EDGE_PX) & (points <= start + sides + _EDGE_PX)
    own = near.all(axis=-1) & (annotations.visibility > 0)
    own &= (boxes_px[:, None, 2:] > boxes_px[:, None, :2]).all(axis=-1)
    pixels = np.clip(np.floor(np.nan_to_num(points) + 0.5), 0, sizes[:, None] - 1)
    first = np.where(own[..., None], pixels, np.inf).min(axis=1)
    last = np.where(own[..., None], pixels, -np.inf).max(axis=1)
    grown = [np.minimum(boxes_px[:, :2], first), np.maximum(boxes_px[:, 2:], last + 1)]
    return boxes_px, np.hstack(grown).astype(int)


def n_pixels(crop_px: Box) -> int:
    """Pixels of a crop; 0 when it is empty.

    Examples
    --------
    >>> n_pixels((10, 10, 30, 20)), n_pixels((10, 10, 5, 20))
    (200, 0)
    """
    left, top, right, bottom = (int(edge) for edge in crop_px)
    return max(right - left, 0) * max(bottom - top, 0)


def crop_people(annotations: Annotations, rows: np.ndarray, crop_px: Box) -> Annotations:
    """Move people of one image into a crop of it.

    Keypoints outside become unlabelled, boxes are clipped, areas shrink with the boxes.

    Parameters
    ----------
    annotations : Annotations
        The annotated people.
    rows : array of int
        The people, of one image.
    crop_px : tuple of int
        Left, top, right, bottom.

    Returns
    -------
    Annotations
        Without people whose box does not overlap the crop. `images` and `image_ids` remain those of the
        source: the caller names the crop.
    """
    people = annotations.take(rows)
    image = annotations.images[int(people.image_ids[0])]
    in_image = clip_boxes(people.boxes_px, (0, 0, image.width_px, image.height_px))
    boxes = clip_boxes(people.boxes_px, crop_px)
    area, of_area = (part[:, 2] * part[:, 3] for part in (boxes, in_image))
    shown = inside(people.keypoints_px, crop_px)
    offset = np.array(crop_px[:2], dtype=float)
    moved = replace(
        people,
        boxes_px=boxes - [*offset, 0, 0],
        areas_px2=people.areas_px2 * area / np.where(of_area > 0, of_area, 1),
        keypoints_px=np.where(shown[..., None], people.keypoints_px - offset, np.nan),
        visibility=np.where(shown, people.visibility, 0.0),
    )
    return moved.take(area > 0)


def with_outside(people: Annotations, source: Annotations) -> Annotations:
    """Add to people in crops the keypoints outside, known from the images they were cut from.

    Parameters
    ----------
    people : Annotations
        Of crops; evaluated people have `source_id` and `crop_px`.
    source : Annotations
        The annotations that the crops were made from.

    Returns
    -------
    Annotations
        The same people; keypoints that are labelled only in the source get their position, outside the
        picture, and the flag `OUTSIDE`.
    """
    row_of = {int(i): row for row, i in enumerate(source.ids)}
    rows = [i for i, about in enumerate(people.extras) if "crop_px" in about]
    of = [row_of[people.extras[i]["source_id"]] for i in rows]
    corners = np.array([people.extras[i]["crop_px"][:2] for i in rows], float).reshape(-1, 1, 2)
    keypoints, visibility = people.keypoints_px.copy(), people.visibility.copy()
    outside = (visibility[rows] == 0) & (source.visibility[of] != 0)
    keypoints[rows] = np.where(outside[..., None], source.keypoints_px[of] - corners, keypoints[rows])
    visibility[rows] = np.where(outside, OUTSIDE, visibility[rows])
    return replace(people, keypoints_px=keypoints, visibility=visibility)


def clip_boxes(boxes_px: np.ndarray, limits_px: Box) -> np.ndarray:
    """Boxes (n, 4) as x, y, width, height, cut down to left, top, right, bottom; width 0 when outside."""
    limits = np.array(limits_px, dtype=float).reshape(2, 2)
    first = np.clip(boxes_px[:, :2], *limits)
    past = np.clip(boxes_px[:, :2] + boxes_px[:, 2:], *limits)
    return np.concatenate([first, past - first], axis=-1)


def image_name(number: int) -> str:
    """File name of a crop, by its image id."""
    return f"{number:012d}.png"
