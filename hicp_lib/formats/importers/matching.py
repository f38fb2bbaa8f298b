"""Which annotated image a prediction belongs to: by its name, its id, or the number in its name."""

import re
from collections import defaultdict
from collections.abc import Callable, Mapping
from operator import attrgetter
from pathlib import PurePosixPath
from typing import Any

from hicp_lib.core.errors import InputError
from hicp_lib.formats.annotations import ImageInfo
from hicp_lib.formats.importers.people import People

_LAST_NUMBER = re.compile(r"(\d+)\D*$", re.ASCII)
_MAX_DIGITS = 18  # of a number that is an id; 64 bits hold it
_name, _stem = attrgetter("name"), attrgetter("stem")
_Table = Mapping[Any, list[int]]


def match_images(people: People, images: dict[int, ImageInfo]) -> list[int | None]:
    """The image of each of `people.sources`, None where there is none.

    Parameters
    ----------
    people : People
        What was predicted; `named_by` says how its sources name images.
    images : dict of int to ImageInfo
        The annotated images, by id.

    Returns
    -------
    list of int or None
        Image ids.

    Raises
    ------
    InputError
        If no source has an image, or one could be several, or two are the same.
    """
    tables = {key: _table(key, images) for key in (str, _name, _stem, _last_number)}
    matched = [_image_of(source, people, images, tables) for source in people.sources]
    first: dict[int, str | int] = {}
    for source, image in zip(people.sources, matched, strict=True):
        if image is not None and first.setdefault(image, source) != source:
            raise InputError(
                f"{people.path}: {first[image]!r} and {source!r} both belong to the image "
                f"{images[image].file_name}; leave the predictions of one run only"
            )
    if people.sources and not first:
        example = next(iter(images.values())).file_name if images else "no image"
        its_example = repr(people.sources[0])[:80]
        raise InputError(
            f"{people.path}: none of its {len(people.sources)} images is annotated; it has {its_example}, "
            f"the annotations {example}; give the annotations of the images the tool saw"
        )
    return matched


def _path(name: str) -> PurePosixPath:
    return PurePosixPath(name.replace("\\", "/"))


def _last_number(path: PurePosixPath) -> int | None:
    found = _LAST_NUMBER.search(path.stem)
    return int(found[1]) if found and len(found[1]) <= _MAX_DIGITS else None


def _table(key: Callable, images: dict[int, ImageInfo]) -> _Table:
    table: defaultdict = defaultdict(list)
    for image in images.values():
        table[key(_path(image.file_name))].append(image.id)
    return dict(table)


def _image_of(
    source: str | int, people: People, images: dict[int, ImageInfo], tables: Mapping[Callable, _Table]
) -> int | None:
    """The image that a source names, as `People.named_by` says."""
    if isinstance(source, int):
        # Tools take the number from the file's name; where it is also the id of another image, ask.
        by_number = [] if people.named_by == "id" else tables[_last_number].get(source, [])
        candidates = sorted({*by_number, *([source] if source in images else [])})
    elif people.named_by == "stem":
        candidates = tables[_stem].get(source) or tables[_name].get(source, [])
    else:
        path = _path(source)
        candidates = next((tables[k][k(path)] for k in (str, _name, _stem) if k(path) in tables[k]), [])
    if len(candidates) > 1:
        names = " and ".join(images[i].file_name for i in candidates[:2])
        raise InputError(
            f"{people.path}: {source!r} could be {names}; give the images names that differ, and run again"
        )
    return candidates[0] if candidates else None
