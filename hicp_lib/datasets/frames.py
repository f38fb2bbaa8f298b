"""Check that annotations and images use the same orientation: rotation flags, and labels outside their image.

An annotation tool may show an image as stored or rotated by its EXIF flag, and write either size; which of
these it did cannot be determined reliably from its file. So images with a flag are refused until the user
says which it was.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.images import image_header
from hicp_lib.datasets.crops import image_sizes
from hicp_lib.formats.annotations import Annotations
from hicp_lib.formats.units import beyond


def in_frame(
    annotations: Annotations, images_dir: Path, orientation: str | None
) -> tuple[Annotations, dict[str, int]]:
    """Annotations with the images' sizes in the requested orientation.

    Parameters
    ----------
    annotations : Annotations
        The people.
    images_dir : Path
        Folder of the annotated images; missing ones are skipped.
    orientation : {"stored", "seen"} or None
        What was annotated: the pixels as stored, or rotated as viewers show them.

    Returns
    -------
    annotations : Annotations
        Sizes as seen, if they were as stored and the images are to be rotated.
    flags : dict of str to int
        File name -> rotation flag (2 to 8) of the images that have one.

    Raises
    ------
    InputError
        If an image has a flag and no orientation is given, or its annotated size does not match.
    """
    images, flags = dict(annotations.images), {}
    for i in np.unique(annotations.image_ids).tolist():
        path, annotated = images_dir / images[i].file_name, (images[i].width_px, images[i].height_px)
        *size, flag = image_header(path)
        if flag == 1:
            continue
        flags[images[i].file_name] = flag
        stored, seen = tuple(size), tuple(size[::-1] if flag > 4 else size)
        if annotated not in {"stored": [stored], "seen": [stored, seen]}.get(orientation or "", []):
            sizes = "{}x{} as stored, {}x{} as viewers show it, annotated as {}x{}"
            raise InputError(
                f"{path}: has a rotation flag ({flag}), {sizes.format(*stored, *seen, *annotated)}; say what "
                "was annotated: --orientation seen (the picture as viewers show it; it is rotated) or stored "
                "(the pixels as in the file), or save the picture rotated, without the flag"
            )
        if orientation == "seen":
            images[i] = replace(images[i], width_px=seen[0], height_px=seen[1])
    return replace(annotations, images=images), flags


def outside_image(annotations: Annotations) -> dict[str, int]:
    """How many labels lie outside their image.

    Returns
    -------
    dict of str to int
        Labelled `keypoints` more than a pixel outside, `boxes` with less than half inside, and the `people`
        affected.
    """
    sizes, points = image_sizes(annotations), annotations.keypoints_px
    keypoints = beyond(points, 0, sizes[:, None]) & (annotations.visibility > 0)
    start, sides = annotations.boxes_px[:, :2], annotations.boxes_px[:, 2:]
    inside = np.clip(start + sides, 0, sizes) - np.clip(start, 0, sizes)
    boxes = inside.prod(axis=1) < 0.5 * sides.prod(axis=1)
    people = keypoints.any(axis=1) | boxes
    return {"keypoints": int(keypoints.sum()), "boxes": int(boxes.sum()), "people": int(people.sum())}
