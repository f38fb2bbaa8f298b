"""Whether annotations and pictures are in one frame: rotation flags, and labels outside their image.

A tool that annotates may show a picture as it is stored or turned as its rotation flag says (EXIF), and
write either size; what it wrote cannot be told from the file with certainty. So pictures with a flag are
refused until somebody says which it was.
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
    """Annotations with the images' sizes in the frame that is asked for.

    Parameters
    ----------
    annotations : Annotations
        The people.
    images_dir : Path
        Folder of the annotated images; those that are missing are passed over.
    orientation : {"stored", "seen"} or None
        What was annotated: the pixels as they lie in the file, or turned as viewers show them.

    Returns
    -------
    annotations : Annotations
        Sizes as seen where they were as stored and the pictures are to be turned.
    flags : dict of str to int
        File name -> rotation flag (2 to 8) of the pictures that have one.

    Raises
    ------
    InputError
        If a picture has a flag and nothing is asked for, or its annotated size is not that of the frame.
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
                "was annotated: --orientation seen (the picture as viewers show it; it is turned) or stored "
                "(the pixels as they lie in the file), or save the picture turned, without the flag"
            )
        if orientation == "seen":
            images[i] = replace(images[i], width_px=seen[0], height_px=seen[1])
    return replace(annotations, images=images), flags


def outside_image(annotations: Annotations) -> dict[str, int]:
    """How many labels lie outside their image.

    Returns
    -------
    dict of str to int
        Labelled `keypoints` more than a pixel outside, `boxes` of which less than half is inside, and the
        `people` who have any.
    """
    sizes, points = image_sizes(annotations), annotations.keypoints_px
    keypoints = beyond(points, 0, sizes[:, None]) & (annotations.visibility > 0)
    start, sides = annotations.boxes_px[:, :2], annotations.boxes_px[:, 2:]
    inside = np.clip(start + sides, 0, sizes) - np.clip(start, 0, sizes)
    boxes = inside.prod(axis=1) < 0.5 * sides.prod(axis=1)
    people = keypoints.any(axis=1) | boxes
    return {"keypoints": int(keypoints.sum()), "boxes": int(boxes.sum()), "people": int(people.sum())}
