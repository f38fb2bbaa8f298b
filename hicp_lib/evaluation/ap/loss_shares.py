"""Causes of lost average precision: network, missing head, person finder, and the measure itself.

A top-down detector is run three times: with the whole image as its only box, with the boxes of a person
finder, and with the true boxes. The loss with true boxes is that of the network; the further loss with the
finder's boxes is that of the finder. A bottom-up detector needs no boxes and has no such share.

From Basic to Headless not only the image changes but also the measure: head keypoints no longer count, the
area that scales OKS shrinks with the crop, and the head's scores no longer enter the ranking.
`head_loss_shares` removes these effects one by one.
"""

from dataclasses import replace

import numpy as np
import pandas as pd

from hicp_lib.evaluation.ap.metric_table import Drawn, draw_cases
from hicp_lib.evaluation.cases import Found, Truth
from hicp_lib.evaluation.statistics.resampling import Draws, with_interval
from hicp_lib.formats.annotations import Annotations

BOX_SOURCES = {"image": "whole image", "detected": "found boxes", "gt": "true boxes"}
SHARES = ("network", "missing head", "person finder")
HEAD_SHARES = ("head points", "area", "ranking", "detector")


def box_variants(top_down: str, bottom_up: str) -> dict[str, tuple[str, dict[str, str]]]:
    """The runs needed to separate the shares: label -> detector and its options.

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
    """Shares of 1 - AP of bodies, for the top-down detector on detected boxes and the bottom-up one.

    Parameters
    ----------
    drawn : Drawn
        From `draw_cases`, of the detectors of `box_variants`, on `metric_table.same_people`.
    top_down, bottom_up : str
        As given to `box_variants`.

    Returns
    -------
    DataFrame
        Columns `subset, detector, share` (of `SHARES`), `value, low, high`; of either detector, and their
        difference if both have the share. In "headless" the network's share is that in "basic", and the
        missing head's share is the further loss with true boxes; a share can be negative.
    """
    _, found_boxes, true_boxes, _ = box_variants(top_down, bottom_up)
    rows = []
    for subset in dict.fromkeys(subset for subset, *_ in drawn):
        lost = {}
        for ideal, real in ((true_boxes, found_boxes), (bottom_up, bottom_up)):
            start = ("basic" if subset == "headless" else subset, ideal)
            lost[real] = _by_share(drawn, (start, (subset, ideal), (subset, real)))
        pair = {share: lost[bottom_up][share] - lost[found_boxes][share] for share in lost[bottom_up]}
        for detector, shares in (*lost.items(), (f"{bottom_up} less {top_down}", pair)):
            rows += [(subset, detector, share, *with_interval(loss)) for share, loss in shares.items()]
    return pd.DataFrame(rows, columns=["subset", "detector", "share", "value", "low", "high"])


def _by_share(drawn: Drawn, chain: tuple[tuple[str, str], ...]) -> dict[str, np.ndarray]:
    """Losses of AP along a chain of cases, on the sample and on the draws; zero between equal cases."""
    values = [_values(drawn, (*case, "body")) for case in chain]
    steps = zip(SHARES, (None, *chain), chain, [1.0, *values], values, strict=False)
    return {share: before - after for share, last, case, before, after in steps if case != last}


def _values(drawn: Drawn, case: tuple[str, str, str]) -> np.ndarray:
    evaluation, samples = drawn[case]
    return np.append(evaluation.AP, samples["AP"])


def head_loss_shares(truth: Truth, found: Found, drawn: Drawn, draws: Draws = Draws()) -> pd.DataFrame:
    """The loss of AP from Basic to Headless, and the shares of it due to the measure.

    The loss is computed four times, each time with one more effect removed: as it is; on the keypoints that
    are labelled in both; with the person's area before any cut; ranked by the scores of the keypoints below
    the head (hands are always ranked by their own). The reduction in a step is the share of that effect; the
    rest is the detector's own loss.

    Parameters
    ----------
    truth : Truth
        By subset, from `metric_table.same_people`, of HiCP folders.
    found : Found
        By image id, of every subset and detector, from there, too.
    drawn : Drawn
        Of these, from `metric_table.draw_cases`.
    draws : Draws, optional
        As given to `draw_cases`.

    Returns
    -------
    DataFrame
        Columns `group, detector, share` ("total", and `HEAD_SHARES`, which add up to it), `value, low, high`:
        95 % bootstrap intervals over source images, all on the same draws.
    """
    shared = _shared_labels(truth["basic"], truth["headless"])
    pair = {case: run for case, run in found.items() if case[0] in shared}
    rows = []
    for group, without_head in (("body", "below the head"), ("hand", "hand")):
        losses = [_losses({case: of for case, of in drawn.items() if case[-1] == group})]
        for held in ({}, {"area": "source"}, {"area": "source", "score": "group"}):
            losses.append(_losses(draw_cases(shared, pair, draws, [without_head], **held)))
        for detector, total in losses[0].items():
            chain = [loss[detector] for loss in losses]
            shares = [before - after for before, after in zip(chain, [*chain[1:], 0.0], strict=True)]
            named = zip(("total", *HEAD_SHARES), (total, *shares), strict=True)
            rows += [(group, detector, share, *with_interval(values)) for share, values in named]
    return pd.DataFrame(rows, columns=["group", "detector", "share", "value", "low", "high"])


def _losses(drawn: Drawn) -> dict[str, np.ndarray]:
    """By detector, AP on Basic minus AP on Headless, on the sample and on the draws."""
    cases = [case for case in drawn if case[0] == "basic"]
    return {case[1]: _values(drawn, case) - _values(drawn, ("headless", *case[1:])) for case in cases}


def _shared_labels(basic: Annotations, headless: Annotations) -> dict[str, Annotations]:
    """Both subsets with only the labels that the same person has in both."""
    counted = [np.flatnonzero(~of.is_crowd) for of in (basic, headless)]
    _, *same = np.intersect1d(basic.ids[counted[0]], headless.ids[counted[1]], return_indices=True)
    rows = [of_subset[chosen] for of_subset, chosen in zip(counted, same, strict=True)]
    both = (basic.visibility[rows[0]] > 0) & (headless.visibility[rows[1]] > 0)
    shared = {}
    for subset, people, chosen in zip(("basic", "headless"), (basic, headless), rows, strict=True):
        visibility = people.visibility.copy()
        visibility[chosen] = np.where(both, visibility[chosen], 0.0)
        shared[subset] = replace(people, visibility=visibility)
    return shared
