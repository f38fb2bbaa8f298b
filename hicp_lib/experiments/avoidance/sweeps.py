"""Many runs of the closed loop without rendering: with true keypoints, or with a detector's error model.

Only the smallest distances of every run are kept, so that latencies, losses and speeds can be swept over
people.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import pandas as pd

from hicp_lib.core.executor import run_jobs
from hicp_lib.experiments.avoidance.closed_loop import Latency, Trial, simulate, true_keypoints
from hicp_lib.experiments.avoidance.error_model import ErrorModel, lossy, modelled
from hicp_lib.experiments.avoidance.reaching import LEAVES_S, NEAR_S
from hicp_lib.experiments.avoidance.runs import TRUE_KEYPOINTS


@dataclass(frozen=True)
class Variant:
    """One run of a sweep.

    Attributes
    ----------
    trial : Trial
    detector : str
        `TRUE_KEYPOINTS`, or the detector whose errors the keypoints have.
    latency : Latency
    lost_share : float
        Of the images, those in which nobody is found, beyond the detector's own losses.
    burst_images : float
        Average number in a row.
    """

    trial: Trial
    detector: str
    latency: Latency = Latency()
    lost_share: float = 0.0
    burst_images: float = 1.0


def variants(
    trials: Sequence[Trial],
    latencies: Mapping[str, Latency],
    models: Mapping[str, ErrorModel],
    speeds_m_s: Sequence[float] = (),
    latencies_s: Sequence[float] = (),
    losses: Sequence[float] = (),
) -> list[Variant]:
    """One thing swept at a time, for true keypoints and every model, with every person.

    Latencies and losses are swept with people who do not follow, losses and speeds at the stated latency.

    Parameters
    ----------
    trials : sequence of Trial
    latencies : mapping of str to Latency
        Stated, by detector.
    models : mapping of str to ErrorModel
        By detector.
    speeds_m_s, latencies_s, losses : sequence of float
        Values of the sweeps.

    Returns
    -------
    list of Variant
        Without repetition.
    """
    found: dict[Variant, None] = {}
    for trial, name in product(trials, [TRUE_KEYPOINTS, *models]):
        stated, still = latencies.get(name, Latency()), replace(trial, follow_m_s=0.0)
        burst = models[name].burst_images if name in models else 1.0
        at = partial(Variant, detector=name, burst_images=burst)
        found |= dict.fromkeys(at(replace(trial, follow_m_s=v), latency=stated) for v in speeds_m_s)
        found |= dict.fromkeys(at(still, latency=Latency(transport_s=v)) for v in latencies_s)
        found |= dict.fromkeys(at(still, latency=stated, lost_share=v) for v in losses)
    return list(found)


def least_distances(cycles: pd.DataFrame) -> dict[str, float]:
    """Smallest distances: `reach_m` until the first reach ended, `min_distance_m` until the person left."""
    distance_m, t_s = cycles["distance_m"], cycles["t_s"]
    return {"reach_m": float(distance_m[t_s <= NEAR_S].min()), "min_distance_m": float(distance_m.min())}


def sweep(variants: Sequence[Variant], models: Mapping[str, ErrorModel]) -> pd.DataFrame:
    """Simulate variants, people in parallel.

    Parameters
    ----------
    variants : sequence of Variant
    models : mapping of str to ErrorModel
        By detector.

    Returns
    -------
    pd.DataFrame
        A row per variant, in their order: `script, subject, follow_m_s, detector, gains, latency_s,
        lost_share, reach_m, min_distance_m`.
    """
    people = pd.Series([(of.trial.script, of.trial.subject.number) for of in variants])
    own = [rows.index for _, rows in people.groupby(people, sort=False)]
    jobs = [(k, partial(_of_person, [variants[row] for row in rows], models)) for k, rows in enumerate(own)]
    return pd.concat([part.set_axis(own[k]) for k, part in run_jobs(jobs)]).sort_index()


def _of_person(variants: Sequence[Variant], models: Mapping[str, ErrorModel]) -> pd.DataFrame:
    return pd.DataFrame([_run(variant, models.get(variant.detector)) for variant in variants])


def _run(variant: Variant, model: ErrorModel | None) -> dict:
    trial = replace(variant.trial, duration_s=LEAVES_S[0])  # the rest is not needed
    # The same errors and losses at every latency, as far as images are the same.
    drawn = partial(trial.subject.stream, trial.script)
    whole = modelled(model, drawn(variant.detector)) if model else true_keypoints
    perceive = lossy(whole, variant.lost_share, variant.burst_images, drawn("losses"))
    cycles = simulate(trial, perceive, variant.latency)
    row = {"script": trial.script, "subject": trial.subject.number, "follow_m_s": trial.follow_m_s}
    row |= {"detector": variant.detector, "gains": "ours", "latency_s": variant.latency.total_s}
    return row | {"lost_share": variant.lost_share} | least_distances(cycles)
