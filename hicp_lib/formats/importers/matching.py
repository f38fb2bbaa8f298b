"""Which annotated image a prediction belongs to: by its name, its id, or the number in its name."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import PurePosixPath

from hicp_lib.core.errors import InputError
from hicp_lib.formats.annotations import ImageInfo
from hicp_lib.formats.importers.people import People

_LAST_NUMBER = re.compile(r"(\d+)\D*$", re.ASCII)


def match_images(people: People, images: dict[int, ImageInfo]) -> list[int | None]:
    """The image of each of `people.sources`, None where there is none.

    Raises
    ------
    InputError
        If no source has an image, or one could be several, or two are the same.
    """
    find = _Finder(people, images)
    matched = [find(source) for source in people.sources]
    first: dict[int, str | int] = {}
    for source, image in zip(people.sources, matched, strict=True):
        if image is not None and first.setdefault(image, source) != source:
            raise InputError(
                f"{people.path}: {first[image]!r} and {source!r} both belong to the image "
                f"{images[image].file_name}; leave the predictions of one run only"
            )
    if not first:
        example = next(iter(images.values())).file_name if images else "no image"
        raise InputError(
            f"{people.path}: none of its {len(people.sources)} images is annotated; it has "
            f"{_example(people)}, the annotations {example}; give the annotations of the images the tool saw"
        )
    return matched


def _example(people: People) -> str:
    return repr(people.sources[0])[:80] if people.sources else "none"


class _Finder:
    """Looks up a source as `People.named_by` says."""

    def __init__(self, people: People, images: dict[int, ImageInfo]) -> None:
        self._path, self._named_by, self._images = people.path, people.named_by, images
        self._names = self._table(lambda path: str(path))
        self._base_names = self._table(lambda path: path.name)
        self._stems = self._table(lambda path: path.stem)
        self._numbers = self._table(lambda path: _last_number(path.stem))

    def _table(self, key: Callable[[PurePosixPath], str | int | None]) -> dict[str | int | None, list[int]]:
        table: dict[str | int | None, list[int]] = {}
        for image in self._images.values():
            table.setdefault(key(PurePosixPath(image.file_name.replace("\\", "/"))), []).append(image.id)
        return table

    def __call__(self, source: str | int) -> int | None:
        candidates = self._number(source) if isinstance(source, int) else self._name(source)
        if len(candidates) > 1:
            names = " and ".join(self._images[i].file_name for i in candidates[:2])
            raise InputError(
                f"{self._path}: {source!r} could be {names}; give the images names that differ, and run again"
            )
        return candidates[0] if candidates else None

    def _name(self, name: str) -> list[int]:
        if self._named_by == "stem":
            return self._stems.get(name, [])
        path = PurePosixPath(name.replace("\\", "/"))
        for table, key in ((self._names, str(path)), (self._base_names, path.name), (self._stems, path.stem)):
            if key in table:
                return table[key]
        return []

    def _number(self, number: int) -> list[int]:
        by_id = [number] if number in self._images else []
        if self._named_by == "id":
            return by_id
        # Tools take the number from the file's name; where it is also the id of another image, ask.
        return sorted({*self._numbers.get(number, []), *by_id})


def _last_number(stem: str) -> int | None:
    found = _LAST_NUMBER.search(stem)
    return int(found[1]) if found and len(found[1]) < 19 else None
