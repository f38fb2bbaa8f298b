"""95 % bootstrap intervals of AP and AR: images are resampled with replacement (Efron's percentile interval).

The matches are resampled, so a thousand draws take a fraction of a second. Images that belong together (crops
of one photograph) can be resampled together through `clusters`.
"""

from collections.abc import Hashable, Mapping, Sequence

import numpy as np

from hicp_lib.core.progress import with_bar
from hicp_lib.evaluation.ap import cocoeval
from hicp_lib.evaluation.ap.evaluate import Evaluation
from hicp_lib.evaluation.statistics.resampling import MIN_DRAWN, Draws, with_interval

_BLOCK = 2**16  # detections of several draws processed at a time
Clusters = Mapping[int, Hashable]
Samples = Mapping[str, np.ndarray]  # metric -> its value in every draw
Figures = dict[str, tuple[float, float, float]]  # metric -> its value, and the ends of its 95 % interval


def bootstrap_intervals(
    evaluation: Evaluation, draws: Draws = Draws(), clusters: Clusters | None = None
) -> Figures:
    """Metrics with their 95 % intervals.

    Parameters
    ----------
    evaluation : Evaluation
        The evaluation.
    draws : Draws, optional
        Of clusters.
    clusters : Clusters, optional
        Any value by image id; images with equal values are resampled together. By default each image alone.

    Returns
    -------
    Figures
        Of every metric; NaN if no person is evaluated, and no interval from fewer than `MIN_DRAWN` clusters.
    """
    return intervals(evaluation.metrics(), resample([evaluation], draws, clusters)[0], evaluation)


def difference(a: Evaluation, b: Evaluation, of_a: Samples, of_b: Samples) -> Figures:
    """Differences a - b with 95 % intervals, both on the same resamples of images.

    The images are paired by their ids: two detectors on one dataset, or one detector on Basic and Headless,
    where equal ids mean the same person. Images that only one of them has are resampled, too.

    Parameters
    ----------
    a, b : Evaluation
        What is compared.
    of_a, of_b : Samples
        Their metrics on the draws, from one call of `resample`.

    Returns
    -------
    Figures
        As of `bootstrap_intervals`.
    """
    others = b.metrics()
    values = {name: value - others[name] for name, value in a.metrics().items()}
    return intervals(values, {name: of_a[name] - of_b[name] for name in values})


def resample(
    evaluations: Sequence[Evaluation], draws: Draws, clusters: Clusters | None = None
) -> list[Samples]:
    """Metrics on resamples of images, shared by all evaluations.

    Parameters
    ----------
    evaluations : sequence of Evaluation
        Paired by their image ids.
    draws : Draws
        Of clusters.
    clusters : Clusters, optional
        As of `bootstrap_intervals`.

    Returns
    -------
    list of Samples
        Per evaluation and metric `draws.n` values; none if there are fewer than `MIN_DRAWN` clusters.
    """
    image_ids = np.unique(np.concatenate([e.matches.image_ids for e in evaluations]))
    rows: dict[Hashable, int] = {}
    names = [i if clusters is None else clusters[i] for i in image_ids.tolist()]
    cluster = np.array([rows.setdefault(name, len(rows)) for name in names], dtype=int)
    n = len(rows)
    places = [np.searchsorted(image_ids, e.matches.image_ids) for e in evaluations]
    rng = np.random.default_rng(draws.seed)
    n_draws = draws.n if n >= MIN_DRAWN else 0
    drawn = (np.bincount(rng.integers(n, size=n), minlength=n)[cluster] for _ in range(n_draws))
    # An image is practically never drawn more than 255 times, so bytes suffice; images may be many.
    weights = [of.astype(np.uint8) for of in drawn]
    return [_samples(e.matches, weights, place) for e, place in zip(evaluations, places, strict=True)]


def _samples(matches: cocoeval.Matches, weights: Sequence[np.ndarray], place: np.ndarray) -> Samples:
    block = max(1, _BLOCK // max(1, len(matches.image_rows)))
    starts = with_bar(range(0, len(weights), block), "bootstrap")
    blocks = (np.stack([w[place] for w in weights[i : i + block]]) for i in starts)
    parts = [cocoeval.metrics(*cocoeval.precision_recall(matches, of_block)) for of_block in blocks]
    return {name: np.concatenate([np.zeros(0), *(part[name] for part in parts)]) for name in cocoeval.METRICS}


def intervals(values: Mapping[str, float], samples: Samples, of: Evaluation | None = None) -> Figures:
    """Values by metric, with percentiles over the draws (`resample`) that have evaluated people.

    AP is at most the share of people found, so AP and AR of 0 or 1 have the interval of such a share
    (`with_interval`).

    Parameters
    ----------
    values : mapping of str to float
        By metric.
    samples : Samples
        Of the same metrics.
    of : Evaluation, optional
        Whose values they are; none for differences, which are no shares. People, or hands, of one image
        count once.

    Returns
    -------
    Figures

    Examples
    --------
    >>> low_high = intervals({"AP": 0.5}, {"AP": np.array([0.4, 0.6, np.nan])})["AP"]
    >>> [round(float(x), 3) for x in low_high]
    [0.5, 0.405, 0.595]
    """
    n_images = min(of.n_people, of.n_images) if of else 0
    drawn = {name: np.append(value, samples[name]) for name, value in values.items()}
    return {name: with_interval(each, n_frames=n_images) for name, each in drawn.items()}
