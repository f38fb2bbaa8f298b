"""Compare photographs with rendered people: results of `tools/photographs.py`, and their agreement."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from hicp_lib.core.datafiles import REFERENCE_DIR
from hicp_lib.core.keypoints import COCO_17
from hicp_lib.evaluation.ap.metric_table import Drawn
from hicp_lib.evaluation.statistics.resampling import with_interval
from hicp_lib.formats.annotations import Annotations

FOLDER = REFERENCE_DIR / "photographs"
RENDERED, PHOTOGRAPHED = "this run", "photographs"


def photographs(table: str) -> pd.DataFrame:
    """A table that `tools/photographs.py` wrote: metrics, head_loss, draws, people or images."""
    return pd.read_parquet(FOLDER / f"{table}.parquet")


def rank_agreement(drawn: Drawn) -> pd.DataFrame:
    """Kendall's rank correlation of detectors by AP of bodies, between photographs and a run.

    Parameters
    ----------
    drawn : Drawn
        The run's cases, of bodies.

    Returns
    -------
    DataFrame
        Columns `subset, n_detectors, tau, low, high`; the interval is over joint resamples of photographs and
        of the run's images.
    """
    from scipy.stats import kendalltau

    known, rows = photographs("draws"), []
    values = photographs("metrics").query("metric == 'AP'").set_index(["subset", "detector"])["value"]
    for subset in dict.fromkeys(case[0] for case in drawn):
        detectors = [d for s, d, group in drawn if (s, group) == (subset, "body") and (s, d) in values.index]
        if len(detectors) < 2:
            continue
        cases = [drawn[subset, detector, "body"] for detector in detectors]
        ours = np.stack([np.append(its.AP, samples["AP"]) for its, samples in cases])
        theirs = np.stack([np.append(values[subset, d], known[f"{subset} {d}"]) for d in detectors])
        n = min(ours.shape[1], theirs.shape[1])
        draws = np.array([kendalltau(ours[:, k], theirs[:, k]).statistic for k in range(n)])
        rows.append((subset, len(detectors), *with_interval(draws)))
    return pd.DataFrame(rows, columns=["subset", "n_detectors", "tau", "low", "high"])


def beside(table: pd.DataFrame) -> pd.DataFrame:
    """AP of bodies in a run and on photographs, for the detectors in both.

    Parameters
    ----------
    table : pd.DataFrame
        As from `metric_table`.

    Returns
    -------
    DataFrame
        Columns `where, subset, detector, value, low, high, n_people`.
    """
    columns = ["where", "subset", "detector", "value", "low", "high", "n_people"]
    parts = [table.assign(where=RENDERED), photographs("metrics").assign(where=PHOTOGRAPHED)]
    rows = pd.concat(parts, ignore_index=True).query("metric == 'AP' and group == 'body'")
    both = set.intersection(*(set(of["detector"]) for _, of in rows.groupby("where")))
    return rows.loc[rows["detector"].isin(both) & rows["subset"].isin(table["subset"]), columns]


def who_is_there(truth: Mapping[str, Annotations]) -> pd.DataFrame:
    """Size and labels of people in a run and on photographs, medians and shares.

    Parameters
    ----------
    truth : mapping of str to Annotations
        By subset.

    Returns
    -------
    DataFrame
        One row per place and subset.
    """
    parts = [people_table(truth).assign(where=RENDERED), photographs("people").assign(where=PHOTOGRAPHED)]
    rows = pd.concat(parts, ignore_index=True)
    rows = rows.assign(occluded=rows["n_occluded"] / rows["n_labelled"], alone=rows["n_others"] == 0)
    columns = {
        "people": ("annotation_id", "size"), "height_px": ("height_px", "median"),
        "labelled_of_17": ("n_labelled", "median"), "occluded_share": ("occluded", "mean"),
        "alone_share": ("alone", "mean"),
    }  # fmt: skip
    return rows.groupby(["where", "subset"], sort=False).agg(**columns).reset_index()


def people_table(truth: Mapping[str, Annotations]) -> pd.DataFrame:
    """All people in the crops: size of the box, labels of COCO's 17 points, other people in the crop.

    Parameters
    ----------
    truth : mapping of str to Annotations
        By subset.

    Returns
    -------
    DataFrame
        Columns `subset, annotation_id, height_px, n_labelled, n_occluded, n_others`.
    """
    parts = []
    for subset, people in truth.items():
        own = people.take(~people.is_crowd)
        flags = own.visibility[:, COCO_17]
        ids, counts = np.unique(people.image_ids, return_counts=True)
        columns = {
            "annotation_id": own.ids, "height_px": own.boxes_px[:, 3], "n_labelled": (flags > 0).sum(axis=1),
            "n_occluded": (flags == 1).sum(axis=1),
            "n_others": counts[np.searchsorted(ids, own.image_ids)] - 1,
        }  # fmt: skip
        parts.append(pd.DataFrame(columns).assign(subset=subset))
    return pd.concat(parts, ignore_index=True)
