"""Which annotated image a prediction belongs to: by its name, its id, or the number in its name."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, Literal

from hicp_lib.core.errors import InputError

if TYPE_CHECKING:
    from hicp_lib.formats.annotations import ImageInfo

_LAST_NUMBER = re.compile(r"(\d+)\D*$", re.ASCII)
_MAX_DIGITS = 18  # of a number that is an id; 64 bits hold it
_name, _stem = attrgetter("name"), attrgetter("stem")
NamedBy = Literal["stem", "id", "number"]
_Table = Mapping[Any, list[int]]


def match_images(
    path: Path, sources: Sequence[str | int], named_by: NamedBy, images: Mapping[int, ImageInfo]
) -> list[int | None]:
    """The image of each source, None where there is none.

    Parameters
    ----------
    path : Path
        Of the predictions, for messages.
    sources : sequence of str or int
        The images that the predictions name, each once.
    named_by : {"stem", "id", "number"}
        How they are named, as in `hicp_lib.formats.importers.people.People`.
    images : dict of int to ImageInfo
        The annotated images, by id.

    Returns
    -------
    list of int or None
        Image ids.

    Raises
    ------
    InputError
        If no source has an image, one matches several, or two match the same.
    """
    tables = {key: _table(key, images) for key in (str, _name, _stem, _last_number)}
    matched = [_image_of(path, source, named_by, images, tables) for source in sources]
    first: dict[int, str | int] = {}
    for source, image in zip(sources, matched, strict=True):
        if image is not None and first.setdefault(image, source) != source:
            raise InputError(
                f"{path}: {first[image]!r} and {source!r} both belong to the image "
                f"{images[image].file_name}; leave the predictions of one run only"
            )
    if sources and not first:
        example = next(iter(images.values())).file_name if images else "no image"
        its_example = repr(sources[0])[:80]
        raise InputError(
            f"{path}: none of its {len(sources)} images is annotated; it has {its_example}, "
            f"the annotations {example}; give the annotations of the images the tool saw"
        )
    return matched


def _path(name: str) -> PurePosixPath:
    return PurePosixPath(name.replace("\\", "/"))


def _last_number(path: PurePosixPath) -> int | None:
    found = _LAST_NUMBER.search(path.stem)
    return int(found[1]) if found and len(found[1]) <= _MAX_DIGITS else None


def _table(key: Callable, images: Mapping[int, ImageInfo]) -> _Table:
    table: defaultdict = defaultdict(list)
    for image in images.values():
        table[key(_path(image.file_name))].append(image.id)
    return dict(table)


def _image_of(
    where: Path, source: str | int, named_by: NamedBy, images: Mapping[int, ImageInfo],
    tables: Mapping[Callable, _Table],
) -> int | None:  # fmt: skip
    """The image that a source names, according to `named_by`."""
    if isinstance(source, int):
        # Tools take the number from the file's name; if it is also the id of another image, it is ambiguous.
        by_number = [] if named_by == "id" else tables[_last_number].get(source, [])
        candidates = sorted({*by_number, *([source] if source in images else [])})
    elif named_by == "stem":
        candidates = tables[_stem].get(source) or tables[_name].get(source, [])
    else:
        path = _path(source)
        candidates = next((tables[k][k(path)] for k in (str, _name, _stem) if k(path) in tables[k]), [])
    if len(candidates) > 1:
        names = " and ".join(images[i].file_name for i in candidates[:2])
        raise InputError(
            f"{where}: {source!r} could be {names}; give the images names that differ, and run again"
        )
    return candidates[0] if candidates else None
