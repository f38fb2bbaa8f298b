"""The worst cases of each detector, selected by rule.

- *Surest mistakes*: people with the highest sum of scores of wrong keypoints (inversion, swap or miss).
- *Overlooked*: people with the most visible keypoints whom no detection matches (with an OKS of .1 or more; a
  body detected with left and right exchanged may not reach it).

- *Lost close by* (`lost_points`): the keypoint with the highest score among those that a detector places well
  on a person with a head, but not on the same person without, though it finds the person in both.

Equal cases are ordered by their ids; of each source image only the worst case is used.
"""

from collections import Counter

import numpy as np
import pandas as pd

from hicp_lib.core.keypoints import NAMES
from hicp_lib.evaluation.failures.without_head import with_and_without_head

WRONG = ("inversion", "swap", "miss")
KINDS_OF_CASE = ("surest mistakes", "overlooked")


def worst_cases(errors: pd.DataFrame, n: int = 4) -> pd.DataFrame:
    """The worst cases per detector and kind of case, bodies only.

    Parameters
    ----------
    errors : DataFrame
        `error_kinds.all_errors`.
    n : int, optional
        Number of cases of each.

    Returns
    -------
    DataFrame
        Columns `detector, case, rank` (from 1), `subset, image_id, badness, mistakes` (in words: of what kind
        how many, or how many keypoints can be seen).
    """
    body = errors[errors["group"] == "body"]
    mistakes = body["score"].where(body["kind"].isin(WRONG), 0.0)
    unseen = (body["kind"] == "not found") & (body["visibility"] >= 2)
    rows = body.assign(**{"surest mistakes": mistakes, "overlooked": unseen.astype(float)})
    keys = ["detector", "subset", "source_image", "image_id"]
    sums = rows.groupby(keys, sort=True)[list(KINDS_OF_CASE)].sum().reset_index()
    table = sums.melt(keys, var_name="case", value_name="badness")
    table = table[table["badness"] > 0].sort_values("badness", ascending=False, kind="stable")
    table = table.drop_duplicates(["detector", "case", "source_image"])
    table = table.assign(rank=table.groupby(["detector", "case"]).cumcount() + 1)
    wrong = body[body["kind"].isin(WRONG)].groupby(keys)["kind"].agg(_counted)
    table = table.join(wrong.astype(str).rename("mistakes"), on=keys)
    seen = table["badness"].astype(int).astype(str) + " visible keypoints"
    table["mistakes"] = table["mistakes"].where(table["case"] == KINDS_OF_CASE[0], seen)
    orders = {"detector": list(dict.fromkeys(errors["detector"])), "case": list(KINDS_OF_CASE)}
    place = table["rank"], *(table[name].map(orders[name].index) for name in ("case", "detector"))
    columns = ["detector", "case", "rank", "subset", "image_id", "badness", "mistakes"]
    return table.iloc[np.lexsort(place)].query("rank <= @n")[columns].reset_index(drop=True)


def _counted(kinds: pd.Series) -> str:
    return ", ".join(f"{kind} × {n}" for kind, n in Counter(kinds).most_common())


def lost_points(errors: pd.DataFrame) -> pd.DataFrame:
    """The keypoint that each detector loses without the head, bodies only: a row with and one without it.

    Parameters
    ----------
    errors : DataFrame
        `error_kinds.all_errors` with the subsets "basic" and "headless".

    Returns
    -------
    DataFrame
        Columns `detector, case` (which keypoint is lost, and how), `subset, image_id, annotation_id,
        keypoint` (Halpe index).
    """
    both = with_and_without_head(errors)
    is_lost = (both["kind"] == "good") & ~both["hit_headless"] & (both["kind_headless"] != "not found")
    lost = both[is_lost].sort_values("score", ascending=False, kind="stable").drop_duplicates("detector")
    points = [NAMES[keypoint].replace("_", " ") for keypoint in lost["keypoint"]]
    lost["case"] = [f"{point}: {kind}" for point, kind in zip(points, lost["kind_headless"], strict=True)]
    close = lost.assign(subset="headless", image_id=lost["image_id_headless"])
    columns = ["detector", "case", "subset", "image_id", "annotation_id", "keypoint"]
    return pd.concat([lost.assign(subset="basic"), close], ignore_index=True)[columns]
