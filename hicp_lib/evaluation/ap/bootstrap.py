"""95 % bootstrap intervals of AP and AR: images are drawn with replacement (Efron's percentile interval).

What is resampled are the matches, so a thousand draws cost a fraction of a second. Images that belong
together (crops of one photograph) can be drawn together through `clusters`.
"""

from collections.abc import Hashable, Mapping, Sequence

import numpy as np
import pandas as pd

from hicp_lib.evaluation.ap import cocoeval
from hicp_lib.evaluation.ap.evaluate import Evaluation
from hicp_lib.evaluation.statistics.resampling import MIN_DRAWN, PERCENTILES

N_RESAMPLES = 1000
_BLOCK = 2**17  # detections of several draws that are gone through at a time
Clusters = Mapping[int, Hashable]


def bootstrap_intervals(
    evaluation: Evaluation, n_resamples: int = N_RESAMPLES, seed: int = 0, clusters: Clusters | None = None
) -> pd.DataFrame:
    """Figures with their 95 % intervals.

    Parameters
    ----------
    evaluation : Evaluation
        Whose figures.
    n_resamples : int, optional
        Number of draws.
    seed : int, optional
        Of the draws.
    clusters : Clusters, optional
        Anything by image id; images of equal value are drawn together. Each by itself when left out.

    Returns
    -------
    DataFrame
        Columns `metric, value, low, high`; NaN where nobody counts, and no interval from fewer than
        `MIN_DRAWN` clusters.
    """
    return intervals(evaluation.metrics(), resample([evaluation], n_resamples, seed, clusters)[0])


def difference(a: Evaluation, b: Evaluation, of_a: pd.DataFrame, of_b: pd.DataFrame) -> pd.DataFrame:
    """Differences a - b with 95 % intervals, both on the same draw of images each time.

    The images are paired by their ids: two detectors on one dataset, or one detector on Basic and Headless,
    where equal ids mean the same person. Images only one of them has are drawn, too.

    Parameters
    ----------
    a, b : Evaluation
        What is compared.
    of_a, of_b : DataFrame
        Their figures on the draws, as from one call of `resample`.

    Returns
    -------
    DataFrame
        As of `bootstrap_intervals`.
    """
    others = b.metrics()
    return intervals({name: value - others[name] for name, value in a.metrics().items()}, of_a - of_b)


def resample(
    evaluations: Sequence[Evaluation], n_resamples: int, seed: int, clusters: Clusters | None = None
) -> list[pd.DataFrame]:
    """Figures on draws of images that all evaluations share.

    Parameters
    ----------
    evaluations : sequence of Evaluation
        Paired by their image ids.
    n_resamples, seed : int
        Number of draws, and what they are drawn with.
    clusters : Clusters, optional
        As of `bootstrap_intervals`.

    Returns
    -------
    list of DataFrame
        Per evaluation `n_resamples` rows and a column per metric; no rows from fewer than `MIN_DRAWN`
        clusters.
    """
    image_ids = np.unique(np.concatenate([e.matches.image_ids for e in evaluations]))
    names = [i if clusters is None else clusters[i] for i in image_ids.tolist()]
    cluster, clusters_drawn = pd.factorize(pd.Series(names, dtype=object))
    n = len(clusters_drawn)
    places = [np.searchsorted(image_ids, e.matches.image_ids) for e in evaluations]
    rng = np.random.default_rng(seed)
    n_draws = n_resamples if n >= MIN_DRAWN else 0
    weights = [np.bincount(rng.integers(n, size=n), minlength=n)[cluster] for _ in range(n_draws)]
    return [
        _figures(e.matches, [w[place] for w in weights]) for e, place in zip(evaluations, places, strict=True)
    ]


def _figures(matches: cocoeval.Matches, weights: Sequence[np.ndarray]) -> pd.DataFrame:
    """A row of figures for every draw."""
    block = max(1, _BLOCK // max(1, len(matches.image_rows)))
    parts = [
        pd.DataFrame(cocoeval.metrics(*cocoeval.precision_recall(matches, np.stack(weights[i : i + block]))))
        for i in range(0, len(weights), block)
    ]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(cocoeval.METRICS))


def intervals(values: Mapping[str, float], samples: pd.DataFrame) -> pd.DataFrame:
    """Figures by metric, with percentiles over the draws (`resample`) in which somebody counts.

    Examples
    --------
    >>> intervals({"AP": 0.5}, pd.DataFrame({"AP": [0.4, 0.6, np.nan]})).round(3).to_dict("list")
    {'metric': ['AP'], 'value': [0.5], 'low': [0.405], 'high': [0.595]}
    """
    rows = []
    for name, value in values.items():
        drawn = samples[name].dropna()
        low, high = np.percentile(drawn, PERCENTILES) if len(drawn) else (np.nan, np.nan)
        rows.append((name, value, low, high))
    return pd.DataFrame(rows, columns=["metric", "value", "low", "high"])
