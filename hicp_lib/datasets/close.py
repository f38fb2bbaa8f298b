"""Close: a third subset in addition to HiCP's Basic and Headless, with single parts of people.

A robot within reach of a person sees only a head, an arm or two legs, which crops of whole people rarely
show. This subset is not in the paper. It is cut from the crops of Basic by rule: around the labelled
keypoints of one part, with a margin. A crop is kept if it has at least `min_pixels` pixels and its
annotations belong to the intended class (`hicp_lib.datasets.visibility`); of every class, the first
`n_per_class` people. No detector influences this selection.

Arms and legs of rendered people and of people in COCO are small: with Basic's minimum size hardly any would
remain. So the crops are smaller than Basic's, and resolution differs between classes.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np

from hicp_lib.core.cache import key
from hicp_lib.core.files import cache_dir, sha256_file
from hicp_lib.core.images import Box, read_image, write_png
from hicp_lib.core.keypoints import HEAD, INDEX, LEFT_HAND, RIGHT_HAND
from hicp_lib.datasets.crops import crop_people, image_name, n_pixels, whole_pixel_boxes
from hicp_lib.datasets.visibility import visibility_class
from hicp_lib.formats.annotations import Annotations, ImageInfo, read_annotations, write_annotations

MARGIN = 0.1  # fraction of the larger side of the keypoints' extent, added on every side


def _named(*names: str) -> np.ndarray:
    return np.array([INDEX[name] for name in names])


_LEFT = np.r_[_named("left_elbow", "left_wrist"), LEFT_HAND]
_RIGHT = np.r_[_named("right_elbow", "right_wrist"), RIGHT_HAND]
# Intended class: keypoints around which the crop is cut.
AIMS: dict[str, np.ndarray] = {
    "only head": HEAD,
    "only left arm": _LEFT,
    "only right arm": _RIGHT,
    "both arms": np.r_[_LEFT, _RIGHT, _named("left_shoulder", "right_shoulder")],
    "both arms without shoulders": np.r_[_LEFT, _RIGHT],
    "only legs": _named("left_knee", "right_knee", "left_ankle", "right_ankle"),
}


def open_close(basic: Path, n_per_class: int = 30, min_pixels: int = 5_000) -> Path:
    """The dataset folder of Close for a folder of Basic; made in the cache if it does not exist.

    Parameters
    ----------
    basic : Path
        Dataset folder (`images/`, `annotations.json`) that `create_hicp` wrote.
    n_per_class : int, optional
        Maximum number of crops per class.
    min_pixels : int, optional
        Minimum size of a crop.

    Returns
    -------
    Path
    """
    of_basic = {"annotations": sha256_file(basic / "annotations.json"), "basic": str(basic.resolve())}
    result_key = key([open_close], **of_basic, n_per_class=n_per_class, min_pixels=min_pixels)
    folder = cache_dir() / "close" / result_key[:16]
    if (folder / "annotations.json").is_file():
        return folder
    source = read_annotations(basic / "annotations.json")
    parts = [part for aim in AIMS for part in islice(_crops_of(source, aim, min_pixels), n_per_class)]
    for number, (image_id, (left, top, right, bottom), _) in enumerate(parts, start=1):
        pixels = read_image(basic / "images" / source.images[image_id].file_name)
        write_png(folder / "images" / image_name(number), pixels[top:bottom, left:right])
    write_annotations(folder / "annotations.json", _joined(source, parts))
    return folder


def _crops_of(source: Annotations, aim: str, min_pixels: int) -> Iterator[tuple[int, Box, Annotations]]:
    """The crops of the intended class: image id in Basic, box, people (the evaluated one first)."""
    for image_id, image in source.images.items():
        people = source.take(source.image_ids == image_id)
        people = people.take(np.argsort(people.is_crowd, kind="stable"))
        box = _box_around(people, AIMS[aim], image)
        if box is not None and n_pixels(box) >= min_pixels:
            shown = crop_people(people, np.arange(len(people)), box)
            if not shown.is_crowd[0] and visibility_class(shown.visibility[:1])[0] == aim:
                yield image_id, box, shown


def _box_around(people: Annotations, keypoints: np.ndarray, image: ImageInfo) -> Box | None:
    """The extent of the first person's labelled keypoints with a margin, in whole pixels of the image."""
    points = people.keypoints_px[0, keypoints[people.visibility[0, keypoints] > 0]]
    if len(points) < 2:
        return None
    low, high = points.min(axis=0), points.max(axis=0)
    margin = MARGIN * (high - low).max()
    box = np.r_[low - margin, high - low + 2 * margin][None]
    crop = whole_pixel_boxes(box, np.array([image.width_px]), np.array([image.height_px]))[0]
    left, top, right, bottom = crop.tolist()
    return left, top, right, bottom


def _joined(source: Annotations, parts: list[tuple[int, Box, Annotations]]) -> Annotations:
    """The crops as one data set; image ids count from 1, and people have keys for their source."""
    own = source.take(~source.is_other)
    origins = dict(zip(own.image_ids.tolist(), own.extras, strict=True))
    images, pieces = {}, []
    for number, (image_id, box, people) in enumerate(parts, start=1):
        images[number] = ImageInfo(number, image_name(number), box[2] - box[0], box[3] - box[1])
        left, top = origins[image_id]["crop_px"][:2]
        in_source = [box[0] + left, box[1] + top, box[2] + left, box[3] + top]
        about = origins[image_id] | {"subset": "close", "crop_px": in_source}
        extras = [about, *({"other": True} for _ in people.ids[1:])]
        pieces.append(replace(people, image_ids=np.full(len(people), number), extras=extras))
    return Annotations.concatenate(pieces, images).numbered()
