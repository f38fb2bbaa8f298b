"""The worst cases of each detector, found by rule.

- *Surest mistakes*: people for whom the scores of wrong keypoints (inversion, swap or miss), added up, are
  highest.
- *Overlooked*: people with the most visible keypoints whom no detection fits (an OKS of .1 is asked for; a
  body found with left and right exchanged throughout may not reach it).

Equal cases follow in the order of their ids; of each source image only the worst case counts.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

WRONG = ("inversion", "swap", "miss")
KINDS_OF_CASE = ("surest mistakes", "overlooked")


def worst_cases(errors: pd.DataFrame, n: int = 4) -> pd.DataFrame:
    """The `n` worst cases per detector and kind of case, bodies only.

    Parameters
    ----------
    errors : `error_kinds.all_errors`

    Returns
    -------
    DataFrame, columns `detector, case, rank` (from 1), `subset, image_id, badness`
    """
    body = errors[errors["group"] == "body"]
    mistakes = body["score"].where(body["kind"].isin(WRONG), 0.0)
    unseen = (body["kind"] == "not found") & (body["visibility"] >= 2)
    rows = body.assign(**{"surest mistakes": mistakes, "overlooked": unseen.astype(float)})
    people = rows.groupby(["detector", "subset", "source_image", "image_id"], sort=True)[list(KINDS_OF_CASE)]
    table = (
        people.sum()
        .reset_index()
        .melt(["detector", "subset", "source_image", "image_id"], var_name="case", value_name="badness")
    )
    table = table[table["badness"] > 0].sort_values("badness", ascending=False, kind="stable")
    table = table.drop_duplicates(["detector", "case", "source_image"])
    table = table.assign(rank=table.groupby(["detector", "case"]).cumcount() + 1)
    detectors = list(dict.fromkeys(errors["detector"]))
    place = np.lexsort(
        (table["rank"], table["case"].map(KINDS_OF_CASE.index), table["detector"].map(detectors.index))
    )
    table = table.iloc[place]
    columns = ["detector", "case", "rank", "subset", "image_id", "badness"]
    return table.loc[table["rank"] <= n, columns].reset_index(drop=True)
