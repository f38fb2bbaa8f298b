"""The network for close range: what its training and its evaluation left behind (`tools/closerange`)."""

import pandas as pd

from hicp_lib.core.datafiles import REFERENCE_DIR
from hicp_lib.evaluation.failures.presence import MEASURES

FOLDER = REFERENCE_DIR / "closerange"
_COMBINED = "combined:"


def trained(table: str) -> pd.DataFrame:
    """A table of `tools/closerange`: curve, differences, extended, photographs, ablations or resolutions."""
    return pd.read_csv(FOLDER / f"{table}.csv")


def criteria(differences: pd.DataFrame, extended: pd.DataFrame, photographs: pd.DataFrame) -> pd.DataFrame:
    """What was asked of the network before it was trained, and what it reaches.

    Parameters
    ----------
    differences : pd.DataFrame
        AP of the network less that of others on held-out people, columns as of `metric_table.pairs`.
    extended : pd.DataFrame
        As from `presence.extended_table`, of the same.
    photographs : pd.DataFrame
        As `differences`, on photographs.

    Returns
    -------
    pd.DataFrame
        Columns `what, other, asked, value, low, high, met`: AP less another's, what it should be at least,
        and its 95 % interval (none where none was drawn).
    """
    headless = differences[differences["subset"] == "headless"]
    hands, bodies = (headless[headless["group"] == group] for group in ("hand", "body"))
    combined = hands[hands["other"].str.startswith(_COMBINED)].sort_values("value")
    scores = extended[(extended["subset"] == "headless") & (extended["measure"] == MEASURES[2])]
    scores = scores.set_index("detector")["value"]
    ours = scores.index.str.startswith("closerange")
    best = scores[~ours].idxmax()
    decided = {"other": best, "value": scores[ours].iloc[0] - scores[best]}
    rows = [
        ("bodies, Headless", 0.03, bodies[bodies["other"] == "movenet-lightning"].iloc[0]),
        ("both hands, Headless", 0.10, combined.iloc[0]),
        ("bodies by extended OKS, Headless", 0.0, decided),
    ]
    small = photographs[photographs["other"] == "movenet-lightning"]
    rows += [
        (f"bodies, {row['subset'].capitalize()}, photographs", -0.02, row) for _, row in small.iterrows()
    ]
    named = [
        {"what": what, "asked": asked} | {name: row.get(name) for name in ("other", "value", "low", "high")}
        for what, asked, row in rows
    ]
    table = pd.DataFrame(named)[["what", "other", "asked", "value", "low", "high"]]
    return table.assign(met=table["value"] >= table["asked"])
