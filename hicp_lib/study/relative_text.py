"""Tables of the relative 3D test for reading: one line per view, detector and keypoint.

What a recording has nothing for is said in the table's place.
"""

from __future__ import annotations

import pandas as pd

from hicp_lib.study.table_format import bounds_of, wide, with_bounds

_ROW = ["view", "detector", "part"]
_DISTANCES = {"spread_m": "spread [cm]", "bias_m": "bias [cm]", "error_m": "error [cm]"}


def shares_text(
    table: pd.DataFrame | None, threshold_m: float, caption: str = ""
) -> tuple[pd.DataFrame, str]:
    """Shares within a distance as "0.71 [0.65, 0.77]", a column per method; `table` of `within_distance`.

    Returns
    -------
    The table, and the caption with a sentence that counts the cases in which either method is ahead.
    """
    if table is None:
        return _not_available("true positions (truth.parquet)"), caption
    rows = table[table["threshold_m"] == threshold_m]
    return wide(rows.assign(text=bounds_of(rows)), _ROW, "method"), f"{caption}{_higher(rows)}"


def _higher(rows: pd.DataFrame) -> str:
    """How often each of two methods has the higher share, in words."""
    shares = rows.pivot(index=_ROW, columns="method", values="value")
    if shares.shape[1] != 2:
        return ""
    first, second = shares
    more = (shares[first] - shares[second]).dropna()
    return (
        f" Of {len(more)} cases, {first} has the higher share in {(more > 0).sum()}, {second} in "
        f"{(more < 0).sum()}."
    )


def distances_text(table: pd.DataFrame) -> pd.DataFrame:
    """Spread, bias and error in centimetres as "1.2 [1.1, 1.4]"; `table` of `spread_and_bias`."""
    shown = table[[*_ROW, "method"]].assign(images=table["n_images"].map("{:.0f}".format))
    for name, title in _DISTANCES.items():
        if name in table:
            numbers_cm = 100 * table[[name, f"{name}_low", f"{name}_high"]]
            shown[title] = [with_bounds(*row, digits=1) for row in numbers_cm.itertuples(index=False)]
    return shown


def causes_text(table: pd.DataFrame) -> pd.DataFrame:
    """Spread and bias per cause in centimetres as "0.4 / 1.3", a column per cause; of `spread_causes`."""
    if table.empty:
        return _not_available("what a simulated recording has: truth, depth without errors, joints")
    text = [f"{100 * s:.1f} / {100 * b:.1f}" for s, b in zip(table["spread_m"], table["bias_m"], strict=True)]
    return wide(table.assign(text=text), _ROW, "cause")


def _not_available(needed: str) -> pd.DataFrame:
    return pd.DataFrame({"needs": [needed], "here": "not available for this recording"})
