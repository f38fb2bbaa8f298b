"""What errors against motion capture depend on: distance, score, line of sight.

`errors` is the table of `hicp_lib.evaluation.space.mocap_error.mocap_errors`.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

_BINS: dict[str, list[float] | None] = {
    "distance_m": [0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.5, 3.0, 4.0],
    "score": [0.1, 0.3, 0.5, 0.7, 0.9, 1.001],
    "sight": None,
}


def errors_by(
    errors: pd.DataFrame, column: str, edges: Sequence[float] | None = None, min_score: float = 0.1
) -> pd.DataFrame:
    """Median and quartiles of the error by another column: distance, score, occlusion.

    Parameters
    ----------
    errors : DataFrame
        `mocap_errors`, with the column.
    column : str
        What the error is grouped by.
    edges : sequence of float, optional
        Bins of a number, each closed on the left; None where the column holds labels.
    min_score : float, optional
        Keypoints above it count as found.

    Returns
    -------
    DataFrame
        Columns `detector, method, part` ("elbow", both sides together), `by` (the column), `bin` (as text),
        `middle` (of the bin; NaN for labels), `n, median_m, lower_m, upper_m`; no rows where nothing was
        found.
    """
    columns = ["detector", "method", "part", "by", "bin", "middle", "n", "median_m", "lower_m", "upper_m"]
    found = errors[(errors["score"] > min_score) & errors["error_m"].notna()]
    if found.empty:
        return pd.DataFrame(columns=columns)
    part = found["keypoint"].str.split("_").str[1].rename("part")
    bins = found[column] if edges is None else pd.cut(found[column], list(edges), right=False)
    keys = [found["detector"], found["method"], part, bins.rename("bin")]
    grouped = found["error_m"].groupby(keys, sort=False, observed=True)
    table = grouped.quantile([0.25, 0.5, 0.75]).unstack().set_axis(["lower_m", "median_m", "upper_m"], axis=1)
    table = table.assign(n=grouped.size(), by=column).reset_index().sort_values("bin", kind="stable")
    table["middle"] = np.nan if edges is None else np.array([b.mid for b in table["bin"]], dtype=float)
    table["bin"] = [str(b) if edges is None else f"{b.left:g} to {b.right:g}" for b in table["bin"]]
    return table[columns].sort_values(["detector", "method", "part"], kind="stable", ignore_index=True)


def error_dependence(errors: pd.DataFrame, min_score: float = 0.1) -> pd.DataFrame:
    """`errors_by` distance, score and occlusion, one after the other.

    Parameters
    ----------
    errors : DataFrame
        `mocap_errors`, with the columns `distance_m, sight` of
        `hicp_lib.evaluation.space.occlusion.joint_occlusion`.
    min_score : float, optional
        Keypoints above it count as found.

    Returns
    -------
    DataFrame
        As of `errors_by`.
    """
    return pd.concat([errors_by(errors, column, edges, min_score) for column, edges in _BINS.items()])
