"""Detect people in a folder of images, a data set or a video, and write them to a file as they are found."""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import atomic_path
from hicp_lib.core.folders import listed_and_others
from hicp_lib.core.images import rotation_note
from hicp_lib.core.video import SUFFIXES as VIDEO_SUFFIXES
from hicp_lib.core.video import open_video
from hicp_lib.detectors.runtime.run import Image, boxes_by_image, detect_each
from hicp_lib.formats.annotations import read_annotations, refuse_other_sizes
from hicp_lib.formats.detection_files import json_list, names_beside, open_detections
from hicp_lib.formats.json_validation import MAX_INTEGER

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp", ".webp", ".tif", ".tiff")


Facts = dict[str, Any]  # what is known of an image: `file_name`, or of a frame `frame` and `time_s`


@dataclass(frozen=True)
class Pictures:
    """The images to process.

    Attributes
    ----------
    source : Path
        The folder or video, for messages.
    images : iterable of (int, dict, path or array)
        Image ids, further facts of each, and the images.
    n_images : int or None
        Their expected number; None if unknown.
    boxes_px : mapping of int to array, optional
        Annotated boxes by image id.
    note : str, optional
        What of the folder is passed over.
    """

    source: Path
    images: Iterable[tuple[int, Facts, Image]]
    n_images: int | None
    boxes_px: Mapping[int, np.ndarray] | None = None
    note: str = ""


def open_pictures(source: Path) -> Pictures:
    """The images of a folder, or the frames of a video.

    Image ids are COCO's if files are named that way (000000012345.jpg is 12345, up to `MAX_INTEGER`), else
    they count files in natural order; for a video, frames from 0.

    Raises
    ------
    InputError
        If it is neither a folder nor a video.
    """
    if source.suffix.lower() in VIDEO_SUFFIXES:
        n_frames, frames = open_video(source)
        images = ((i, {"frame": i, "time_s": time_s}, frame) for i, (time_s, frame) in enumerate(frames))
        return Pictures(source, images, n_frames or None)
    if not source.is_dir():
        raise InputError(f"{source}: is not a folder; give the folder that holds the images, or a video")
    names, rest = listed_and_others(source, IMAGE_SUFFIXES)
    if not names:
        what = f"holds no images{rest and f', {rest}'}"
        raise InputError(f"{source}: {what}; expected files such as 000001.jpg or photo.png")
    stems = [os.path.splitext(name)[0] for name in names]
    numbers = {int(stem) for stem in stems if stem.isascii() and stem.isdigit()}
    are_ids = len(numbers) == len(names) and max(numbers) <= MAX_INTEGER
    ids = map(int, stems) if are_ids else range(1, len(names) + 1)
    note = rest and f"{source}: {rest}; images end in {', '.join(IMAGE_SUFFIXES)}"
    return Pictures(source, _files(source, zip(ids, names, strict=True)), len(names), note=note)


def open_dataset(folder: Path) -> Pictures:
    """The images of a data set folder (`images/`, `annotations.json`), with the annotated boxes.

    Raises
    ------
    InputError
        If the annotations are absent or malformed, or of images of another size.
    """
    annotations = read_annotations(folder / "annotations.json")
    refuse_other_sizes(annotations, folder / "images")
    names = [(i, image.file_name) for i, image in annotations.images.items()]
    return Pictures(folder, _files(folder / "images", names), len(names), boxes_by_image(annotations))


def _files(folder: Path, names: Iterable[tuple[int, str]]) -> Iterator[tuple[int, Facts, Image]]:
    return ((i, {"file_name": name}, f"{folder}{os.sep}{name}") for i, name in names)


def detect_to_file(
    name: str, pictures: Pictures, out: Path, tell: Callable[[str], None],
    by_image: Callable[[str], None] | None = None, strict: bool = False, **options,
) -> tuple[int, int, int]:  # fmt: skip
    """Detect people and write them, image by image; images that cannot be read are skipped.

    `names_beside(out)` lists all images, including those without people, and those that could not be read.

    Parameters
    ----------
    name : str
        The detector.
    pictures : Pictures
    out : Path
        The file to write, as `hicp_lib.formats.detection_files.open_detections` says.
    tell : callable
        Takes warnings, a line at a time.
    by_image : callable, optional
        Takes a line about each image.
    strict : bool, optional
        Whether an unreadable image ends the run.
    **options : object
        Of `hicp_lib.detectors.runtime.run.detect_each`.

    Returns
    -------
    n_people, n_images, n_broken : int
        People found, images processed, and images that could not be read.

    Raises
    ------
    InputError
        If no image can be read, or one where `strict`; and as of `detect_each`.
    """
    n_people = n_images = n_broken = 0
    n, known, flagged = pictures.n_images, dict[int, Facts](), dict[str, int]()
    images = (known.update({i: facts}) or (i, image) for i, facts, image in pictures.images)
    if pictures.note:
        tell(pictures.note)
    each = detect_each(name, images, boxes_px=pictures.boxes_px, n_images=n, flagged=flagged, **options)
    with ExitStack() as stack:
        append = stack.enter_context(json_list(stack.enter_context(atomic_path(names_beside(out)))))
        write = stack.enter_context(open_detections(out))  # left first: it removes an earlier list
        for image_id, found in stack.enter_context(closing(each)):
            facts = known.pop(image_id)
            if isinstance(found, InputError):
                if strict:
                    raise found
                append({"id": image_id, **facts, "error": str(found)})
                tell(str(found))
                n_broken += 1
                continue
            append({"id": image_id, **facts})
            write(image_id, facts, found.detections)
            if by_image is not None:
                by_image(_line(image_id, facts, found.detections))
            n_images, n_people = n_images + 1, n_people + len(found.detections)
        if not n_images:
            raise InputError(f"{pictures.source}: none of its {n or 0} images can be read")
    if flagged:
        tell(rotation_note(flagged))
    if n not in (None, n_images + n_broken):
        tell(f"{pictures.source}: says {n} frames, {n_images} could be decoded; it may be cut off")
    return n_people, n_images, n_broken


def _line(image_id: int, facts: Mapping[str, Any], people: Detections) -> str:
    """An image's row of a table in text."""
    name = facts.get("file_name") or f"{facts['time_s']:.3f} s"
    n_given = np.isfinite(people.keypoints_px).all(axis=-1).sum(axis=1).tolist()
    each = [f"{score:.2f} ({n})" for score, n in zip(people.person_scores, n_given, strict=True)]
    return f"{image_id:>8}  {name:<32} {len(people):>3}  {' '.join(each)}".rstrip()
