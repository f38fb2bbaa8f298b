"""Detection as a function of the dose of a difficulty: varied on purpose, or as found in a data set.

When varied on purpose (`hicp_lib.experiments.doses`), everything but the dose is the same. In a data set
doses are correlated: people who are near are also cropped. There a curve shows correlation, not causation.
"""

from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import read_image
from hicp_lib.core.keypoints import COCO_17
from hicp_lib.evaluation.ap.metric_table import compare
from hicp_lib.evaluation.cases import Truth
from hicp_lib.evaluation.failures.error_kinds import all_errors
from hicp_lib.evaluation.statistics.proportions import proportions
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.formats.annotations import Annotations

MEASURES = ("AP", "visible keypoints hit", "hidden keypoints hit")
N_BINS = 5
OBSERVED: tuple[str, ...] = ("share of keypoints in the picture", "distance", "picture")
OBSERVED += ("share of keypoints hidden", "distance to the border", "brightness")


def by_level(annotations: Annotations) -> dict[tuple[str, float], Annotations]:
    """The images of each dose and level, which are keys of the people."""
    table = pd.DataFrame(annotations.extras)[["dose", "level"]].assign(image_id=annotations.image_ids)
    groups = table.groupby(["dose", "level"], sort=False)["image_id"]
    return {level: annotations.of_images(set(image_ids)) for level, image_ids in groups}


def dose_curves(
    annotations: Annotations, found: Mapping[str, Mapping[int, Detections]], draws: Draws = Draws()
) -> pd.DataFrame:
    """AP, and the share of keypoints hit, at every level of every dose.

    Parameters
    ----------
    annotations : Annotations
        As from `doses.open_doses`.
    found : mapping of str to mapping of int to Detections
        By image id, of every detector.
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        Columns `dose, level, detector, group, measure` (one of `MEASURES`), `value, low, high, n` (people, or
        keypoints): 95 % bootstrap intervals over people.
    """
    truth = {str(key): people for key, people in by_level(annotations).items()}
    runs = ((name, d, run, its) for d, run in found.items() for name, its in truth.items())
    cases = {(name, detector): {i: run[i] for i in its.images} for name, detector, run, its in runs}
    ap = compare(truth, cases, draws).query("metric == 'AP'")
    ap = ap.rename(columns={"n_people": "n"}).assign(measure="AP")
    errors = all_errors(truth, cases)
    state = np.where(errors["visibility"] >= 2, *MEASURES[1:])
    keys = ["subset", "detector", "group", "measure"]
    table = pd.concat([ap, proportions(errors.assign(measure=state), keys, "hit", draws)])
    levels = pd.DataFrame(by_level(annotations).keys(), index=list(truth), columns=["dose", "level"])
    table = table.join(levels, on="subset")
    columns = ["dose", "level", "detector", "group", "measure", "value", "low", "high", "n"]
    return table[columns].reset_index(drop=True)


def observed_doses(truth: Truth, folders: Mapping[str, Path], source: Annotations) -> pd.DataFrame:
    """The doses of each evaluated person in a data set: one row per labelled body keypoint.

    Parameters
    ----------
    truth : Truth
        By subset.
    folders : mapping of str to Path
        By subset, the folder with their images.
    source : Annotations
        What the crops were made from; distances are known if people have `distance_m`.

    Returns
    -------
    DataFrame
        Columns `subset, image_id, keypoint` and those of `OBSERVED` (NaN if unknown).
    """
    extras = zip(source.ids.tolist(), source.extras, strict=True)
    distances_m = {i: extra.get("distance_m", np.nan) for i, extra in extras}
    tables = []
    for subset, of_subset in truth.items():
        people = of_subset.take(~of_subset.is_crowd)
        images = [people.images[image_id] for image_id in people.image_ids.tolist()]
        pictures = (read_image(Path(folders[subset]) / "images" / image.file_name) for image in images)
        sizes_px = np.array([(image.width_px, image.height_px) for image in images]).reshape(-1, 2)
        flags, points_px = people.visibility[:, COCO_17], people.keypoints_px[:, COCO_17]
        gaps_px = np.minimum(points_px + 0.5, sizes_px[:, None] - points_px - 0.5).min(axis=2)
        n_labelled, n_hidden = (flags > 0).sum(axis=1), ((flags > 0) & (flags < 2)).sum(axis=1)
        of_person = {
            "image_id": people.image_ids,
            "share of keypoints in the picture": (flags > 0).mean(axis=1),
            "share of keypoints hidden": n_hidden / np.maximum(n_labelled, 1),
            "picture": np.sqrt(sizes_px.prod(axis=1)),
            "distance": [distances_m.get(extra.get("source_id", -1), np.nan) for extra in people.extras],
            "brightness": [cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY).mean() for pixels in pictures],
        }
        who, keypoint = np.nonzero(flags > 0)
        of_keypoint = {"subset": subset, "keypoint": keypoint}
        of_keypoint["distance to the border"] = gaps_px[who, keypoint] / sizes_px[who].min(axis=1)
        tables.append(pd.DataFrame(of_person).iloc[who].assign(**of_keypoint))
    return pd.concat(tables, ignore_index=True)[["subset", "image_id", "keypoint", *OBSERVED]]


def observed_curves(errors: pd.DataFrame, observed: pd.DataFrame, draws: Draws = Draws()) -> pd.DataFrame:
    """Share of body keypoints hit, in five bins of each dose with equal numbers of keypoints.

    Parameters
    ----------
    errors : DataFrame
        `error_kinds.all_errors`.
    observed : DataFrame
        `observed_doses`.
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        Columns `subset, dose, detector, level` (median of the bin), `value, low, high, n, n_images`.
    """
    body = errors[errors["group"] == "body"].merge(observed, on=["subset", "image_id", "keypoint"])
    keys = ["subset", "dose", "detector", "level"]
    tables = []
    for dose in OBSERVED:
        for _, rows in body[body[dose].notna()].groupby("subset", sort=False):
            bins = pd.qcut(rows[dose], N_BINS, labels=False, duplicates="drop")
            middle = rows.groupby(bins)[dose].median()
            rows = rows.assign(dose=dose, level=bins.map(middle)).sort_values("level", kind="stable")
            tables.append(proportions(rows, keys, "hit", draws))
    return pd.concat(tables, ignore_index=True)
