"""AP and AR by the visible parts of a person (the paper's section IV-D)."""

from dataclasses import replace

import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.datasets.visibility import CLASSES, MIN_PEOPLE, people_classes
from hicp_lib.evaluation.ap.metric_table import draw_cases, metric_table, pairs
from hicp_lib.evaluation.cases import Found, Truth
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.formats.annotations import Annotations, ImageInfo


def compare_classes(truth: Truth, found: Found, draws: Draws = Draws()) -> pd.DataFrame:
    """AP and AR per class and detector, and their differences, over the crops of all subsets together.

    Every image must have one evaluated person, like HiCP's crops. Crops of one source image, in any subset,
    are resampled together in the bootstrap.

    Parameters
    ----------
    truth : Truth
        By subset.
    found : Found
        By image id, of every subset and detector.
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        As `metric_table.metric_table`, with the class instead of `subset`, and columns `other, pair`: "" for
        a detector's own metrics, then those of `metric_table.pairs`. With fewer than `MIN_PEOPLE` evaluated
        people, values are NaN.
    """
    classes = people_classes(truth)
    people, detections = pooled(truth, found)
    ids = classes["image_id"] * len(truth) + classes["subset"].map(list(truth).index)
    by_class = {name: set(ids[classes["class"] == name]) for name in CLASSES}
    parts = {name: people.of_images(images) for name, images in by_class.items() if images}
    pairs_of = ((name, detector, run) for name in parts for detector, run in detections.items())
    cases = {(name, d): {i: run[i] for i in run if i in by_class[name]} for name, d, run in pairs_of}
    drawn = draw_cases(parts, cases, draws)
    own = metric_table(drawn)
    less = pairs(drawn).merge(own[["subset", "group", "detector", "metric", "n_people"]])
    table = pd.concat([own.assign(other="", pair=""), less], ignore_index=True)
    table = table.rename(columns={"subset": "class"})
    figures = ["value", "low", "high"]
    table[figures] = table[figures].where(table["n_people"] >= MIN_PEOPLE)
    return table


def pooled(truth: Truth, found: Found) -> tuple[Annotations, dict[str, dict[int, Detections]]]:
    """All subsets as one data set; the image ids of the k-th of n subsets become id * n + k.

    Parameters
    ----------
    truth : Truth
        By subset.
    found : Found
        By image id, of every subset and detector.

    Returns
    -------
    people : Annotations
        Of all subsets, renumbered.
    detections : dict of str to dict of int to Detections
        By detector and image id.
    """
    n, place = len(truth), {subset: k for k, subset in enumerate(truth)}
    parts: list[Annotations] = []
    images: dict[int, ImageInfo] = {}
    for k, people in enumerate(truth.values()):
        parts.append(replace(people, image_ids=people.image_ids * n + k))
        images |= {i * n + k: replace(image, id=i * n + k) for i, image in people.images.items()}
    detections: dict[str, dict[int, Detections]] = {}
    for (subset, detector), run in found.items():
        of_detector = detections.setdefault(detector, {})
        of_detector |= {i * n + place[subset]: one for i, one in run.items()}
    return Annotations.concatenate(parts, images).numbered(), detections
