"""What keeps a detector from an average precision of 1: its network, the missing head, the person finder.

A top-down detector is asked three times: with the whole image as its only box, with the boxes of a person
finder, and with the true boxes. What it loses with the true boxes is its network's; what it loses beyond that
with the finder's is the finder's. A bottom-up detector needs no box, and has no such share.
"""

import pandas as pd

from hicp_lib.evaluation.ap.bootstrap import intervals
from hicp_lib.evaluation.ap.metric_table import Drawn
from hicp_lib.evaluation.cases import labelled

BOX_SOURCES = {"image": "whole image", "detected": "found boxes", "gt": "true boxes"}
SHARES = ("network", "missing head", "person finder")


def box_variants(top_down: str, bottom_up: str) -> dict[str, tuple[str, dict[str, str]]]:
    """What is run to tell the shares apart: label -> detector and its options.

    Examples
    --------
    >>> variants = box_variants("movenet-lightning", "posenet")
    >>> variants["movenet-lightning, true boxes"]
    ('movenet-lightning', {'boxes': 'gt'})
    >>> list(variants)[-1]
    'posenet'
    """
    asked = {f"{top_down}, {said}": (top_down, {"boxes": boxes}) for boxes, said in BOX_SOURCES.items()}
    return {**asked, bottom_up: (bottom_up, {})}


def loss_shares(drawn: Drawn, top_down: str, bottom_up: str) -> pd.DataFrame:
    """1 - AP of bodies, share by share, of the top-down detector on found boxes and of the bottom-up one.

    Parameters
    ----------
    drawn : Drawn
        From `draw_cases`, of the detectors of `box_variants`, on `metric_table.same_people`.
    top_down, bottom_up : str
        As given to `box_variants`.

    Returns
    -------
    DataFrame
        Columns `subset, detector, share` (of `SHARES`), `value, low, high`; of either detector, and the
        difference where both have one. In "headless" the network's share is that in "basic", the missing
        head's what true boxes lose from there; a share can be negative.
    """
    _, found_boxes, true_boxes, _ = box_variants(top_down, bottom_up)
    tables = []
    for subset in dict.fromkeys(subset for subset, *_ in drawn):
        lost = {}
        for ideal, real in ((true_boxes, found_boxes), (bottom_up, bottom_up)):
            start = ("basic" if subset == "headless" else subset, ideal)
            lost[real] = _by_share(drawn, (start, (subset, ideal), (subset, real)))
        pair = {share: lost[bottom_up][share] - lost[found_boxes][share] for share in lost[bottom_up]}
        for detector, shares in (*lost.items(), (f"{bottom_up} less {top_down}", pair)):
            for share, losses in shares.items():
                table = intervals({"AP": losses.iloc[0]}, losses.iloc[1:].to_frame("AP"))
                labels = {"subset": subset, "detector": detector, "share": share}
                tables.append(labelled(table.drop(columns="metric"), **labels))
    return pd.concat(tables, ignore_index=True)


def _by_share(drawn: Drawn, chain: tuple[tuple[str, str], ...]) -> dict[str, pd.Series]:
    """Losses of AP from case to case of a chain, as it is and on the draws; none between equal cases."""
    values = [
        pd.Series([evaluation.AP, *samples["AP"]], dtype=float)
        for evaluation, samples in (drawn[*case, "body"] for case in chain)
    ]
    steps = zip(SHARES, (None, *chain), chain, [1.0, *values], values, strict=False)
    return {share: before - after for share, last, case, before, after in steps if case != last}
