"""The head's part in it: what changes for each keypoint when the head is cut off, and heads made up."""

from __future__ import annotations

import pandas as pd

from hicp_lib.core.keypoints import NAMES
from hicp_lib.evaluation.failures.placed_keypoints import from_the_cut, landed
from hicp_lib.evaluation.statistics.proportions import shares

HEAD_POINTS = range(5)  # nose, eyes, ears


def change_per_keypoint(errors: pd.DataFrame, n_resamples: int = 1000, seed: int = 0) -> pd.DataFrame:
    """Hit rate of each body keypoint with and without the head, on the same keypoints of the same people.

    Parameters
    ----------
    errors : `error_kinds.all_errors` with the subsets "basic" and "headless"

    Returns
    -------
    DataFrame, columns `detector, keypoint` (name), `basic, headless, change, low, high, n` (pairs),
    `n_images`; the interval is the change's, over source images
    """
    keys = ["detector", "keypoint", "annotation_id", "source_image"]
    body = errors[errors["group"] == "body"]
    pairs = body[body["subset"] == "basic"].merge(
        body[body["subset"] == "headless"], on=keys, suffixes=("_basic", "_headless")
    )
    pairs["change"] = pairs["hit_headless"].astype(float) - pairs["hit_basic"]
    table = shares(
        pairs.sort_values(["detector", "keypoint"]), ["detector", "keypoint"], "change", n_resamples, seed
    )
    rates = pairs.groupby(["detector", "keypoint"])[["hit_basic", "hit_headless"]].mean().reset_index()
    table = table.rename(columns={"value": "change"}).merge(rates, on=["detector", "keypoint"])
    table = table.rename(columns={"hit_basic": "basic", "hit_headless": "headless"})
    table["keypoint"] = [NAMES[k] for k in table["keypoint"]]
    return table[["detector", "keypoint", "basic", "headless", "change", "low", "high", "n", "n_images"]]


def invented_heads(placed: pd.DataFrame) -> pd.DataFrame:
    """Head keypoints given in Headless, where there are none: the rows of `placed_keypoints` for them.

    Further columns: `landed`, and `along`, `below` as from `from_the_cut`.
    """
    rows = placed[(placed["subset"] == "headless") & placed["keypoint"].isin(HEAD_POINTS) & placed["given"]]
    rows = rows[rows["state"].isin(["outside", "unknown"])]
    return rows.assign(landed=landed(rows), **from_the_cut(rows))


def invented_shares(
    placed: pd.DataFrame, min_score: float, n_resamples: int = 1000, seed: int = 0
) -> pd.DataFrame:
    """How many head keypoints are made up, where they go, and how surely.

    Returns
    -------
    DataFrame, columns `detector, what, value, low, high, n, n_images`
    """
    missing = placed[(placed["subset"] == "headless") & placed["keypoint"].isin(HEAD_POINTS)]
    missing = missing[missing["state"].isin(["outside", "unknown"])]
    given = invented_heads(placed)
    sure = given["score"] >= min_score
    tables = [
        _labelled(missing, "given at all", missing["given"], n_resamples, seed),
        _labelled(
            missing,
            f"given with a score of at least {min_score}",
            missing["score"] >= min_score,
            n_resamples,
            seed,
        ),
    ]
    for place in ("outside", "at the border", "inside"):
        tables.append(
            _labelled(given, f"of those given: put {place}", given["landed"] == place, n_resamples, seed)
        )
    tables.append(_labelled(given[sure], "of the sure ones: right", given["hit"][sure], n_resamples, seed))
    return pd.concat(tables, ignore_index=True)


def _labelled(rows: pd.DataFrame, what: str, flags: pd.Series, n_resamples: int, seed: int) -> pd.DataFrame:
    table = shares(rows.assign(flag=flags.astype(float)), ["detector"], "flag", n_resamples, seed)
    table.insert(1, "what", what)
    return table
