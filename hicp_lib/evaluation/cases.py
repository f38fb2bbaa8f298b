"""The cases to evaluate: every detector on every subset, for its groups of keypoints.

`Truth` is annotations by subset, `Found` detections by image id, of every (subset, detector). A *case* is a
subset, a detector and a group of keypoints.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import GROUPS, N_KEYPOINTS
from hicp_lib.detectors.registry import COMBINED, DETECTORS
from hicp_lib.formats.annotations import Annotations, source_images

Truth = Mapping[str, Annotations]
Found = Mapping[tuple[str, str], Mapping[int, Detections]]


def groups_of(found: Found, detector: str) -> tuple[str, ...]:
    """The keypoint groups for which a detector is evaluated: its own, or those in an imported result.

    A combination gives both. A detector run in several ways is labelled "NAME, how", and keeps its groups.

    Examples
    --------
    >>> groups_of({}, "mediapipe"), groups_of({("basic", "mine"): {1: Detections.none()}}, "mine")
    (('body', 'hand'), ())
    >>> groups_of({}, "movenet-lightning, found boxes")
    ('body',)
    """
    known = DETECTORS.get(detector.partition(", ")[0])
    if known:
        return known.groups
    if detector.startswith(COMBINED):
        return tuple(GROUPS)
    given = np.zeros(N_KEYPOINTS, dtype=bool)
    for (_, name), images in found.items():
        if name == detector:
            for people in images.values():
                given |= np.isfinite(people.keypoints_px).all(axis=-1).any(axis=0)
    return tuple(group for group, keypoints in GROUPS.items() if given[keypoints].any())


def all_cases(found: Found, groups: Iterable[str] = tuple(GROUPS)) -> Iterator[tuple[str, str, str]]:
    """Subset, detector and group of every case; with "each hand" for a detector of hands."""
    for subset, detector in found:
        for group in groups:
            if ("hand" if group.endswith("hand") else "body") in groups_of(found, detector):
                yield subset, detector, group


def labelled(table: pd.DataFrame, **labels: object) -> pd.DataFrame:
    """The table with constant columns put before its own.

    Examples
    --------
    >>> labelled(pd.DataFrame({"oks": [0.5]}), group="body").to_dict("list")
    {'group': ['body'], 'oks': [0.5]}
    """
    return table.assign(**labels)[[*labels, *table.columns]]


def over_people(tables: Sequence[pd.DataFrame], n_frames: Sequence[int]) -> pd.DataFrame:
    """Join tables of frames of several people.

    Parameters
    ----------
    tables : sequence of DataFrame
        One of each person, with a column `frame`.
    n_frames : sequence of int
        How many frames of each there are.

    Returns
    -------
    DataFrame
        A column `subject`, then theirs; frame numbers continue from person to person.

    Examples
    --------
    >>> over_people([pd.DataFrame({"frame": [0, 1]})] * 2, [3, 3]).values.tolist()
    [[0, 0], [0, 1], [1, 3], [1, 4]]
    """
    starts = np.cumsum([0, *n_frames])[:-1]
    moved = (table.assign(frame=table["frame"] + at) for table, at in zip(tables, starts, strict=True))
    people = [labelled(table, subject=k) for k, table in enumerate(moved)]
    return pd.concat(people, ignore_index=True)


def per_case(
    measure: Callable[[Annotations, Mapping[int, Detections], str], pd.DataFrame],
    truth: Truth,
    found: Found,
    groups: Mapping[str, tuple[str, ...]] | None = None,
) -> pd.DataFrame:
    """A measure of every case, concatenated.

    Parameters
    ----------
    measure : callable
        Table with a column `image_id` from annotations, detections and a group.
    truth : Truth
        By subset.
    found : Found
        By image id, of every subset and detector.
    groups : mapping of str to tuple of str, optional
        The groups of each detector; by default those it gives.

    Returns
    -------
    DataFrame
        Columns `subset, detector, group, source_image` and the measure's own.
    """
    tables = []
    for subset, detector in found:
        sources = source_images(truth[subset])
        for group in groups_of(found, detector) if groups is None else groups[detector]:
            table = measure(truth[subset], found[subset, detector], group)
            labels = {"subset": subset, "detector": detector, "group": group}
            tables.append(labelled(table, **labels, source_image=table["image_id"].map(sources)))
    return pd.concat(tables, ignore_index=True)
