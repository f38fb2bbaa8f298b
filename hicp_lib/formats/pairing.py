"""Which annotated image each of a file's results is of: by its file's name, or else by its id."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from pathlib import PureWindowsPath
from typing import TYPE_CHECKING

import numpy as np

from hicp_lib.formats.json_validation import Rows

if TYPE_CHECKING:
    from hicp_lib.formats.annotations import ImageInfo

_OTHER_SET = "give the annotations of the images that the detector was run on"


def paired_images(rows: Rows, images: Mapping[int, ImageInfo]) -> np.ndarray:
    """The annotated image of each result.

    Ids count where not every result has a `file_name`: two tools may number the same images differently.

    Parameters
    ----------
    rows : Rows
        The results.
    images : mapping of int to ImageInfo
        The annotated images, by id.

    Returns
    -------
    array of int, shape (n,)
        Image ids.

    Raises
    ------
    InputError
        For an image that is not annotated, and a name that two have.
    """
    if rows.rows and all("file_name" in row for row in rows.rows):
        return _by_name(rows, images)
    ids = rows.integers("image_id")
    unknown = ~np.isin(ids, list(images))
    for i in np.flatnonzero(unknown)[:1].tolist():
        n, of = len(np.unique(ids[unknown])), len(np.unique(ids))
        problem = f"image_id {ids[i]} is not among the annotated images ({n} of {of} ids are not)"
        raise rows.error(i, f"{problem}; {_OTHER_SET}")
    return ids


def _by_name(rows: Rows, images: Mapping[int, ImageInfo]) -> np.ndarray:
    whole, last = defaultdict(list), defaultdict(list)
    for image in images.values():
        path = PureWindowsPath(image.file_name)  # splits at both kinds of slash
        whole[path.as_posix()].append(image.id)
        last[path.name].append(image.id)
    names = rows.column("file_name", lambda name: isinstance(name, str) and name != "", "a file name")
    found = {}
    for i, name in enumerate(names):
        if name in found:
            continue
        path = PureWindowsPath(name)
        candidates = whole.get(path.as_posix()) or last.get(path.name, [])
        if len(candidates) != 1:
            what = "could be several annotated images" if candidates else "is not among the annotated images"
            raise rows.error(i, f"file_name {name[:80]!r} {what}; {_OTHER_SET}")
        found[name] = candidates[0]
    return np.array([found[name] for name in names], dtype=np.int64)
