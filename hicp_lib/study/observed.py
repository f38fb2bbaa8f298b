"""How detection depends on what people of a data set are like, where nothing is varied by itself."""

import numpy as np
import pandas as pd

from hicp_lib.evaluation.cases import Truth
from hicp_lib.evaluation.statistics.proportions import proportions
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.study.photographs import people_table

N_BINS = 5


def observed_curves(errors: pd.DataFrame, truth: Truth, draws: Draws = Draws()) -> pd.DataFrame:
    """Share of labelled body keypoints hit, by bins of each property of people that hold about as many.

    Parameters
    ----------
    errors : pd.DataFrame
        As from `hicp_lib.evaluation.failures.error_kinds.all_errors`.
    truth : Truth
        By subset; all are taken together.
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    pd.DataFrame
        Columns as of `hicp_lib.evaluation.failures.dose_curves.dose_curves`; `level` is the median of a bin,
        `dose` "height" (of the box, pixels), "labelled" (of the 17 keypoints), "occluded" (share of these) or
        "others" (people in the same crop).
    """
    people = people_table(truth).rename(columns={"height_px": "height", "n_labelled": "labelled"})
    people = people.assign(occluded=people["n_occluded"] / people["labelled"], others=people["n_others"])
    rows = errors[errors["group"] == "body"].merge(people, on=["subset", "annotation_id"])
    tables = []
    for dose in ("height", "labelled", "occluded", "others"):
        bins = np.ceil(N_BINS * rows[dose].rank(pct=True))  # equal values in one
        of_bins = rows.assign(dose=dose, level=rows.groupby(bins)[dose].transform("median"))
        tables.append(proportions(of_bins, ["dose", "level", "detector", "group"], "hit", draws))
    return pd.concat(tables, ignore_index=True).assign(measure="labelled keypoints hit")
