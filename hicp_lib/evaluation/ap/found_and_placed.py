"""Separate whether people are found from how well they are placed, which AP mixes."""

import pandas as pd

from hicp_lib.evaluation.matching import MATCH_OKS
from hicp_lib.evaluation.statistics.proportions import proportions
from hicp_lib.evaluation.statistics.resampling import Draws

FOUND, OKS_OF_FOUND, WELL_PLACED = "found", "mean OKS of those found", "OKS of .5 or more, of those found"
_WELL_PLACED_OKS = 0.5


def found_and_placed(people: pd.DataFrame, draws: Draws = Draws()) -> pd.DataFrame:
    """How many people are found, and how well those are placed.

    A person is found if the best detection has an OKS of at least `matching.MATCH_OKS` (.1), the lowest value
    at which Ronchi and Perona (2017) match a detection to a person.

    Parameters
    ----------
    people : DataFrame
        As from `metric_table.people_oks`.
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        Columns `subset, group, detector, what` (`FOUND`, `OKS_OF_FOUND`, `WELL_PLACED`), `value` (NaN if
        nobody is found), `low, high` (95 %, over source images), `n` (people), `n_images`.
    """
    by = ["subset", "group", "detector"]
    people = people.assign(value=people["oks"] >= MATCH_OKS)
    found = people[people["value"]]
    well_placed = found.assign(value=found["oks"] >= _WELL_PLACED_OKS)
    measures = {FOUND: people, OKS_OF_FOUND: found.assign(value=found["oks"]), WELL_PLACED: well_placed}
    tables = [proportions(rows, by, "value", draws).assign(what=what) for what, rows in measures.items()]
    everyone = tables[0][by].merge(pd.DataFrame({"what": list(measures)}), how="cross")
    table = everyone.merge(pd.concat(tables), how="left", on=[*by, "what"])
    return table.fillna({"n": 0, "n_images": 0}).astype({"n": int, "n_images": int})
