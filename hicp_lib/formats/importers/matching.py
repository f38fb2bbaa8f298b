"""Which annotated image a prediction belongs to: by its name, its id, or the number in its name."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from operator import attrgetter
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.formats.json_validation import Rows

if TYPE_CHECKING:
    from hicp_lib.formats.annotations import ImageInfo

_LAST_NUMBER = re.compile(r"(\d+)\D*$", re.ASCII)
_MAX_DIGITS = 18  # of a number that is an id; 64 bits hold it
_name, _stem = attrgetter("name"), attrgetter("stem")
NamedBy = Literal["stem", "id", "number"]
_Table = Mapping[Any, list[int]]


class ImageMatcher:
    """Tells which annotated image a prediction belongs to.

    Parameters
    ----------
    path : Path
        Of the predictions, for messages.
    named_by : {"stem", "id", "number"}
        How they name images, as in `hicp_lib.formats.importers.people.People`.
    images : dict of int to ImageInfo
        The annotated images, by id.
    """

    def __init__(self, path: Path, named_by: NamedBy, images: Mapping[int, ImageInfo]) -> None:
        self._path, self._named_by, self._images = path, named_by, images
        self._tables = {key: _table(key, images) for key in (str, _name, _stem, _last_number)}
        self._image_of: dict[str | int, int | None] = {}
        self._source_of: dict[int, str | int] = {}
        self._are_named: bool | None = None

    def match(self, sources: Iterable[str | int]) -> list[int | None]:
        """The image of each source, None where there is none.

        Parameters
        ----------
        sources : iterable of str or int
            The images that the predictions name.

        Returns
        -------
        list of int or None
            Image ids.

        Raises
        ------
        InputError
            If no source has an image, one matches several, or two match the same, of these and earlier ones.
        """
        sources = list(sources)
        for source in sources:
            if source not in self._image_of:
                image = self._image_of[source] = self._find(source)
                if image is not None and self._source_of.setdefault(image, source) != source:
                    raise InputError(
                        f"{self._path}: {self._source_of[image]!r} and {source!r} both belong to the image "
                        f"{self._images[image].file_name}; leave the predictions of one run only"
                    )
        if sources and not self._source_of:
            example = next(iter(self._images.values())).file_name if self._images else "no image"
            its_example = repr(sources[0])[:80]
            raise InputError(
                f"{self._path}: none of its {len(self._image_of)} images is annotated; it has {its_example}, "
                f"the annotations {example}; give the annotations of the images the tool saw"
            )
        return [self._image_of[source] for source in sources]

    def images_of(self, rows: Rows) -> np.ndarray:
        """The image ids of rows, to which further ones may follow: shape (n,), int64.

        By name if the first row has a `file_name`, since tools number images differently.

        Raises
        ------
        InputError
            As `match`, or if a row has no image.
        """
        if self._are_named is None:
            self._are_named = bool(rows.rows) and "file_name" in rows.rows[0]
        if self._are_named:
            key, named = "file_name", rows.column("file_name", _is_text, "a file name")
            ids = self.match(named)
        else:
            key, named = "image_id", rows.integers("image_id").tolist()
            ids = [i if i in self._images else None for i in named]
        for i, image in enumerate(ids):
            if image is None:
                raise rows.error(i, f"{key} {repr(named[i])[:80]} is not among the annotated images")
        return np.array(ids, dtype=np.int64)

    def _find(self, source: str | int) -> int | None:
        tables = self._tables
        if isinstance(source, int):
            # Tools take the number from the file's name; if another image has it as its id, it is ambiguous.
            by_number = [] if self._named_by == "id" else tables[_last_number].get(source, [])
            candidates = sorted({*by_number, *([source] if source in self._images else [])})
        elif self._named_by == "stem":
            candidates = tables[_stem].get(source) or tables[_name].get(source, [])
        else:
            path = _path(source)
            candidates = next((tables[k][k(path)] for k in (str, _name, _stem) if k(path) in tables[k]), [])
        if len(candidates) > 1:
            names = " and ".join(self._images[i].file_name for i in candidates[:2])
            raise InputError(
                f"{self._path}: {source!r} could be {names}; give the images names that differ, and run again"
            )
        return candidates[0] if candidates else None


def _is_text(value: object) -> bool:
    return isinstance(value, str)


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
