"""95 % bootstrap intervals of AP and AR: images are drawn with replacement (Efron's percentile interval).

What is resampled are the matches pycocotools made, so a thousand draws cost seconds. Images
that belong together (crops of one photograph) can be drawn together through `clusters`.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping

import numpy as np
import pandas as pd

from hicp_lib.evaluation.ap import cocoeval as engine
from hicp_lib.evaluation.ap.evaluate import Evaluation
from hicp_lib.evaluation.statistics.resampling import MIN_DRAWN, PERCENTILES

N_RESAMPLES = 1000


def bootstrap_intervals(
    evaluation: Evaluation,
    n_resamples: int = N_RESAMPLES,
    seed: int = 0,
    clusters: Mapping[int, Hashable] | None = None,
) -> pd.DataFrame:
    """Figures with their 95 % intervals.

    Parameters
    ----------
    clusters : image id -> anything; images of equal value are drawn together. Default: each by itself

    Returns
    -------
    DataFrame, columns `metric, value, low, high`; NaN where nobody counts, and no interval from fewer than
    `MIN_DRAWN` clusters
    """
    samples = resample([evaluation], n_resamples, seed, clusters)[0]
    return intervals(evaluation.metrics(), samples)


def bootstrap_difference(
    a: Evaluation,
    b: Evaluation,
    n_resamples: int = N_RESAMPLES,
    seed: int = 0,
    clusters: Mapping[int, Hashable] | None = None,
) -> pd.DataFrame:
    """Differences a - b with 95 % intervals, both on the same draw of images each time.

    The images are paired by their ids: two detectors on one dataset, or one detector on Basic and
    Headless, where equal ids mean the same person. Images only one of them has are drawn, too.
    Parameters and columns as for `bootstrap_intervals`.
    """
    of_a, of_b = resample([a, b], n_resamples, seed, clusters)
    return difference(a, b, of_a, of_b)


def difference(a: Evaluation, b: Evaluation, of_a: pd.DataFrame, of_b: pd.DataFrame) -> pd.DataFrame:
    """As `bootstrap_difference`, from the figures of both on the same draws (`resample`)."""
    others = b.metrics()
    return intervals({name: value - others[name] for name, value in a.metrics().items()}, of_a - of_b)


def resample(
    evaluations: list[Evaluation],
    n_resamples: int,
    seed: int,
    clusters: Mapping[int, Hashable] | None = None,
) -> list[pd.DataFrame]:
    """Figures on `n_resamples` draws of images, per evaluation a DataFrame with a column per metric."""
    image_ids = np.unique(np.concatenate([e.matches.image_ids for e in evaluations]))
    names = [i if clusters is None else clusters[i] for i in image_ids.tolist()]
    cluster, _ = pd.factorize(np.array([*names, None], dtype=object)[:-1])
    n_clusters = int(cluster.max(initial=-1)) + 1
    places = [np.searchsorted(image_ids, e.matches.image_ids) for e in evaluations]
    rng = np.random.default_rng(seed)
    rows: list[list[dict]] = [[] for _ in evaluations]
    for _ in range(n_resamples if n_clusters >= MIN_DRAWN else 0):
        drawn = np.bincount(rng.integers(n_clusters, size=n_clusters), minlength=n_clusters)
        weights = drawn[cluster]
        for e, place, kept in zip(evaluations, places, rows, strict=True):
            kept.append(engine.metrics(*engine.precision_recall(e.matches, weights[place])))
    return [pd.DataFrame(kept, columns=list(engine.METRICS)) for kept in rows]


def intervals(values: dict[str, float], samples: pd.DataFrame) -> pd.DataFrame:
    """Figures by metric, with percentiles over the draws (`resample`) in which somebody counts."""
    rows = []
    for name, value in values.items():
        drawn = samples[name].dropna()
        low, high = np.percentile(drawn, PERCENTILES) if len(drawn) else (np.nan, np.nan)
        rows.append({"metric": name, "value": value, "low": low, "high": high})
    return pd.DataFrame(rows)
