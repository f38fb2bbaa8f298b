"""Effect of the head: the change of each keypoint when the head is cut off, and hallucinated heads."""

import pandas as pd

from hicp_lib.core.keypoints import NAMES
from hicp_lib.evaluation.failures.placed_keypoints import landed
from hicp_lib.evaluation.statistics.proportions import proportions
from hicp_lib.evaluation.statistics.resampling import Draws

HEAD_POINTS = range(5)  # nose, eyes, ears


def with_and_without_head(errors: pd.DataFrame) -> pd.DataFrame:
    """The same body keypoints of the same people with the head, and without it as columns `..._headless`.

    Parameters
    ----------
    errors : DataFrame
        `error_kinds.all_errors` with the subsets "basic" and "headless".

    Returns
    -------
    DataFrame
    """
    body = errors[errors["group"] == "body"]
    basic, headless = (body[body["subset"] == subset] for subset in ("basic", "headless"))
    return basic.merge(headless, on=["detector", "annotation_id", "keypoint"], suffixes=("", "_headless"))


def change_per_keypoint(errors: pd.DataFrame, draws: Draws = Draws()) -> pd.DataFrame:
    """Hit rate of each body keypoint with and without the head, on the same keypoints of the same people.

    Parameters
    ----------
    errors : DataFrame
        `error_kinds.all_errors` with the subsets "basic" and "headless".
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        Columns `detector, keypoint` (name), `basic, headless, change, low, high, n` (pairs), `n_images`; the
        interval is that of the change, over source images.
    """
    by = ["detector", "keypoint"]
    both = with_and_without_head(errors)
    both = both[both["source_image"] == both["source_image_headless"]].sort_values(by)
    both["change"] = both["hit_headless"].astype(float) - both["hit"]
    rates = both.groupby(by)[["hit", "hit_headless"]].mean().reset_index()
    table = proportions(both, by, "change", draws, are_shares=False).merge(rates, on=by)
    table["keypoint"] = [NAMES[k] for k in table["keypoint"]]
    table = table.rename(columns={"value": "change", "hit": "basic", "hit_headless": "headless"})
    return table[[*by, "basic", "headless", "change", "low", "high", "n", "n_images"]]


def hallucinated_heads(placed: pd.DataFrame) -> pd.DataFrame:
    """Head keypoints given in Headless, where there are none: rows of `placed_keypoints` with `landed`."""
    rows = placed[(placed["subset"] == "headless") & placed["keypoint"].isin(HEAD_POINTS) & placed["given"]]
    rows = rows[rows["state"].isin(["outside", "unknown"])]
    return rows.assign(landed=landed(rows))
