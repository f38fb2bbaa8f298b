"""AP and AR by which parts of a person a picture shows (the paper's section IV-D)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.datasets.visibility import CLASSES, MIN_PEOPLE, people_classes
from hicp_lib.evaluation.ap.metric_table import compare
from hicp_lib.formats.annotations import Annotations


def compare_classes(
    truth: Mapping[str, Annotations],
    found: Mapping[tuple[str, str], Mapping[int, Detections]],
    n_resamples: int = 1000,
    seed: int = 0,
) -> pd.DataFrame:
    """AP and AR per class and detector, over the crops of all subsets together.

    Every image shows one person who counts, as HiCP's crops do. Crops of one source image, in whatever
    subset, are drawn together in the bootstrap.

    Returns
    -------
    As `compare`, with the class in the place of `subset`; with fewer than
    `MIN_PEOPLE` people who count, figures are NaN.
    """
    classes = people_classes(truth)
    people, detections = pooled(truth, found)
    by_class = {name: set(_pooled_ids(truth, classes[classes["class"] == name])) for name in CLASSES}
    by_class = {name: images for name, images in by_class.items() if images}
    parts = {name: people.of_images(images) for name, images in by_class.items()}
    cases = {
        (name, detector): {i: of_image for i, of_image in run.items() if i in by_class[name]}
        for name in by_class
        for detector, run in detections.items()
    }
    table = compare(parts, cases, n_resamples, seed).rename(columns={"subset": "class"})
    judged = table["n_people"] >= MIN_PEOPLE
    return table.assign(**{name: table[name].where(judged) for name in ("value", "low", "high")})


def pooled(
    truth: Mapping[str, Annotations], found: Mapping[tuple[str, str], Mapping[int, Detections]]
) -> tuple[Annotations, dict[str, dict[int, Detections]]]:
    """All subsets as one data set, with image ids that tell the subsets apart (see `_pooled_id`)."""
    number = {subset: _pooled_id(truth, subset) for subset in truth}
    parts = [
        replace(
            people,
            images={number[s](i): replace(image, id=number[s](i)) for i, image in people.images.items()},
            image_ids=number[s](people.image_ids),
        )
        for s, people in truth.items()
    ]
    images = {i: image for part in parts for i, image in part.images.items()}
    detections: dict[str, dict[int, Detections]] = {}
    for (subset, detector), run in found.items():
        detections.setdefault(detector, {}).update({number[subset](i): one for i, one in run.items()})
    return Annotations.concatenate(parts, images).numbered(), detections


def _pooled_id(truth: Mapping[str, Annotations], subset: str) -> Callable:
    """Image ids of one subset to ids over all of them."""
    place = list(truth).index(subset)
    return lambda image_id: image_id * len(truth) + place


def _pooled_ids(truth: Mapping[str, Annotations], rows: pd.DataFrame) -> list[int]:
    return [_pooled_id(truth, row.subset)(row.image_id) for row in rows.itertuples()]
