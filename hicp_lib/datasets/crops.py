"""The geometry of HiCP: which crop of an image shows a person close by, and where the head is cut off.

After Docekal et al. 2022, section III-A. The paper fixes that people are cropped by their
boxes, that crops of at least 20,000 pixels are kept, and that the head is removed by the
positions of head and body. The rest is chosen here:

- A box is rounded outwards to whole pixels and clipped to the image. Keypoint u lies in pixel
  column i when i - 0.5 <= u < i + 0.5; keypoints outside the crop are no longer labelled.
- The head's position is the mean of its labelled keypoints (nose, eyes, ears, head top, face),
  the body's that of the other labelled body keypoints (hands do not count: 21 points on a
  raised hand would outweigh the trunk).
- The head lies on that side of the body (above, below, left, right) in which it is displaced
  most. The cut is the first pixel border towards the body that leaves every head keypoint on
  the other side. Faces seen from behind or under a mask are often not labelled: then the chin is
  assumed as far from nose, eyes and ears as the head top is, since these lie half-way.
- The segment's area shrinks in proportion to the part of the box that remains.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from hicp_lib.core.images import Box, inside
from hicp_lib.core.keypoints import BODY, HEAD, INDEX
from hicp_lib.formats.annotations import Annotations
from hicp_lib.formats.cropcoco import OUTSIDE

TRUNK = np.setdiff1d(BODY, HEAD)
_MID_HEAD = np.arange(0, 5)  # nose, eyes, ears
_TOP, _CHIN = INDEX["head_top"], INDEX["face_8"]

Side = Literal["left", "top", "right", "bottom"]


@dataclass(frozen=True)
class HeadCut:
    """Where head and body are in a crop, and what remains without the head.

    Attributes
    ----------
    head_px, body_px : array, shape (2,)
        The two centres.
    side : {"left", "top", "right", "bottom"}
        The side of the crop that is removed.
    kept_px : tuple of int
        Left, top, right, bottom of what remains, right and bottom exclusive.
    """

    head_px: np.ndarray
    body_px: np.ndarray
    side: Side
    kept_px: Box


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


def headless_cut(keypoints_px: np.ndarray, visibility: np.ndarray, crop_px: Box) -> HeadCut | None:
    """Find the cut that takes the head off a person.

    Parameters
    ----------
    keypoints_px : array, shape (136, 2)
        In Halpe's order.
    visibility : array, shape (136,)
        Only keypoints above 0 and inside the crop count.
    crop_px : tuple of int
        Left, top, right, bottom of the crop, in the keypoints' frame.

    Returns
    -------
    HeadCut or None
        None when no head keypoint or no other body keypoint is labelled. Nothing may remain (an empty
        `kept_px`) when the head reaches the far side of the crop.
    """
    labelled = (visibility > 0) & inside(keypoints_px, crop_px)
    head, body = (keypoints_px[part[labelled[part]]] for part in (HEAD, TRUNK))
    if not len(head) or not len(body):
        return None
    head_px, body_px = head.mean(axis=0), body.mean(axis=0)
    away = head_px - body_px
    axis = 0 if abs(away[0]) > abs(away[1]) else 1
    reach = np.concatenate([head, _assumed_chin(keypoints_px, labelled)])[:, axis]
    left, top, right, bottom = (int(edge) for edge in crop_px)
    before, after = int(np.floor(reach.min() + 0.5)), int(np.floor(reach.max() + 0.5)) + 1
    cuts: dict[tuple[int, bool], tuple[Side, Box]] = {  # by axis, and whether the head is further along it
        (0, False): ("left", (after, top, right, bottom)),
        (0, True): ("right", (left, top, before, bottom)),
        (1, False): ("top", (left, after, right, bottom)),
        (1, True): ("bottom", (left, top, right, before)),
    }
    return HeadCut(head_px, body_px, *cuts[axis, bool(away[axis] > 0)])


def _assumed_chin(keypoints_px: np.ndarray, labelled: np.ndarray) -> np.ndarray:
    """The head top mirrored at nose, eyes and ears, shape (1, 2); (0, 2) with a chin or without a top."""
    middle = keypoints_px[_MID_HEAD[labelled[_MID_HEAD]]]
    if labelled[_CHIN] or not labelled[_TOP] or not len(middle):
        return np.zeros((0, 2))
    return 2 * middle.mean(axis=0, keepdims=True) - keypoints_px[_TOP]


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
        What is annotated.
    rows : array of int
        The people, of one image.
    crop_px : tuple of int
        Left, top, right, bottom.

    Returns
    -------
    Annotations
        Without people whose box does not reach into the crop. `images` and `image_ids` stay the source's: the
        caller names the crop.
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
    """People of crops, with what the images they were cut from know of keypoints outside the crops.

    Parameters
    ----------
    people : Annotations
        Of crops; those who count name their `source_id` and `crop_px`.
    source : Annotations
        What the crops were made from.

    Returns
    -------
    Annotations
        The same people; keypoints that are labelled in the source only have a place, outside the picture,
        and the flag `OUTSIDE`.
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
    """Of a crop's image, by its image id."""
    return f"{number:012d}.png"
