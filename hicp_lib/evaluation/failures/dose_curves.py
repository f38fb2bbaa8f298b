"""Detection as a function of the dose of a difficulty, everything else being the same
(`hicp_lib.experiments.doses`)."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.evaluation.ap.metric_table import compare
from hicp_lib.evaluation.failures.error_kinds import all_errors
from hicp_lib.evaluation.statistics.proportions import proportions
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.formats.annotations import Annotations

MEASURES = ("AP", "visible keypoints hit", "hidden keypoints hit")


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
