"""Choose the costs of the robust lifting on development identities, one at a time.

    python tools/choose_lifting.py FOLDER [--constants NAME ...] [--factors 0.5 0.7 1.4 2]

Renders every development body in the setups of the study's 3D pages with the D435's model, detects people
(once; cached in FOLDER), and lifts the detections with each constant in turn multiplied by each factor. The
first criterion is the 95th percentile of the errors of wrists, elbows and fingers (geometric mean over the
three), the second their medians. Another value is better if it improves this by 3 % or more, and the interval
of the difference, over resamples of people, excludes 0. No held-out identity and no other sensor is used.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.camera import transform
from hicp_lib.core.executor import run_jobs
from hicp_lib.core.files import atomic_path
from hicp_lib.core.keypoints import INDEX, LEFT_HAND, N_KEYPOINTS
from hicp_lib.detectors.registry import make_detector
from hicp_lib.evaluation.space.lifting_ablation import GROUPS, MIN_SCORE
from hicp_lib.experiments.laboratory import COLOUR
from hicp_lib.experiments.recordings.frames import camera_poses, record_frame
from hicp_lib.experiments.recordings.scenarios import scenario
from hicp_lib.lifting import body_measures, depth_candidates, hand_shapes, limb_lengths, robust
from hicp_lib.simulation.body.identities import Subject, split_members

DEVELOPMENT = "development"
DETECTORS = ("mediapipe", "movenet-thunder")
FRAMES = {"relative-upper": range(4), "relative-lower": range(4), "mocap": range(1, 48, 6)}
N_DRAWS, LEAST_GAIN = 1000, 0.03
HAND = LEFT_HAND[0]  # hands are the last keypoints
_BODY, _HANDS = slice(0, 26), slice(HAND, N_KEYPOINTS)
CONSTANTS = {
    **{
        f"{name} {part}": (depth_candidates, name, of)
        for name in ("RADIUS_M", "_SIGMA_M", "_HIDDEN")
        for part, of in (("body", _BODY), ("hands", _HANDS))
    },
    **{name: (depth_candidates, name, None) for name in ("_STEEP_M", "_ON_STEP", "_IN_FRONT")},
    **{
        f"{part} {key}": (limb_lengths, part, number)
        for part in ("_BODY", "_HAND")
        for number, key in enumerate(("share", "more_m", "most_short"))
    },
    "_MOST_LONG": (limb_lengths, "_MOST_LONG", None),
    **{
        name: (hand_shapes, name, None)
        for name in (
            "_SIZE_SIGMA", "_PALM_SIGMA_M", "_FINGER_SIGMA_M", "_MOST", "_LIKELY", "_DEPTH_SIGMA_M",
            "_MOST_DEPTH", "_BESIDE_M", "_BEHIND_M",
        )
    },
    "_END_ON": (robust, "_END_ON", None),
    "_SLEEVE_M": (body_measures, "_SLEEVE_M", None),
    "_BACK_OF_HAND_M": (body_measures, "_BACK_OF_HAND_M", None),
}  # fmt: skip
GROUP = np.full(N_KEYPOINTS, -1)
for _number, _names in enumerate(GROUPS.values()):
    GROUP[[INDEX[name] for name in _names]] = _number


def make_person(folder: Path, number: int) -> None:
    """Render a person's frames and detect them."""
    subject, detectors, frames = Subject(0, number, DEVELOPMENT), [*map(make_detector, DETECTORS)], []
    for view, chosen in FRAMES.items():
        poses = camera_poses(scenario(view, number), max(chosen) + 1)
        for k in chosen:
            rgb, depth_m, _, truth = record_frame(view, subject, k)
            true_m = transform(np.linalg.inv(poses[k]), np.array(truth["keypoints_m"]))
            frames.append((depth_m.astype(np.float32), true_m, [_best(one.detect(rgb)) for one in detectors]))
    names = ("depth_m", "true_m", "found")
    with atomic_path(folder / f"{number}.npz") as temporary:
        np.savez_compressed(
            temporary, **dict(zip(names, map(np.array, zip(*frames, strict=True)), strict=True))
        )


def _best(found) -> np.ndarray:
    """(136, 3): u, v and score of the person with the best score; NaN without any."""
    if not len(found.person_scores):
        return np.full((N_KEYPOINTS, 3), np.nan)
    best = found.person_scores.argmax()
    return np.column_stack([found.keypoints_px[best], found.scores[best]])


def open_person(folder: Path, number: int) -> dict[str, np.ndarray]:
    with np.load(folder / f"{number}.npz") as file:
        return dict(file)


def lift_person(person: dict[str, np.ndarray], n_steps: int = len(robust.STEPS)) -> np.ndarray:
    """(4, frames, detectors, 136): error, depth's signed error, its sigma [m], and `REASONS`."""
    lifted = np.empty((4, *person["found"].shape[:3]))
    for k, (depth_m, true_m) in enumerate(zip(person["depth_m"], person["true_m"], strict=True)):
        for d, found in enumerate(person["found"][k]):
            one = robust.lift_robust(found[None, :, :2], depth_m, COLOUR, n_steps)
            off_m = np.where(found[:, 2:] >= MIN_SCORE, one.points_m[0] - true_m, np.nan)
            lifted[:, k, d] = np.linalg.norm(off_m, axis=1), off_m[:, 2], one.sigma_m[0], one.reason[0]
    return lifted


def scaled(name: str, factor: float) -> None:
    """Multiply a constant."""
    module, attribute, part = CONSTANTS[name]
    value = getattr(module, attribute)
    if part is None:
        setattr(module, attribute, value * factor)
    else:
        scale = np.ones(len(value))
        scale[part] = factor
        setattr(module, attribute, value * scale)
    body_measures.load_measures.cache_clear()
    hand_shapes._turns.cache_clear()


def errors_m(folder: Path, people: Sequence[int], name: str, factor: float) -> np.ndarray:
    """(people, frames, detectors, 136) with a constant multiplied."""
    kept = [getattr(module, attribute) for module, attribute, _ in CONSTANTS.values()]
    try:
        scaled(name, factor)
        return np.array([lift_person(open_person(folder, number))[0] for number in people])
    finally:
        for (module, attribute, _), value in zip(CONSTANTS.values(), kept, strict=True):
            setattr(module, attribute, value)


def compared(before_m: np.ndarray, after_m: np.ndarray) -> Iterator[float]:
    """Log ratios (groups) of 95th percentiles and medians: as they are, then in draws of people."""
    rng, both = np.random.default_rng(0), np.isfinite(before_m) & np.isfinite(after_m)
    n_people = len(before_m)
    draws = [np.ones(n_people)]
    draws += [np.bincount(rng.integers(0, n_people, n_people), minlength=n_people) for _ in range(N_DRAWS)]
    logs = np.empty((len(draws), 2, len(GROUPS)))
    for group in range(len(GROUPS)):
        chosen = both & (group == GROUP)
        whose = np.nonzero(chosen)[0]
        for sign, errors in ((-1, before_m), (1, after_m)):
            order = errors[chosen].argsort()
            values, of = errors[chosen][order], whose[order]
            for k, weights in enumerate(draws):
                sums = weights[of].cumsum()
                at = np.searchsorted(sums, np.array([0.95, 0.5]) * sums[-1])
                logs[k, :, group] = sign * np.log(values[at]) + (logs[k, :, group] if sign > 0 else 0)
    return logs


def row(name: str, factor: float, before_m: np.ndarray, after_m: np.ndarray) -> dict[str, object]:
    """What a value brings: changes of percentiles and medians, by group and in the mean with its interval."""
    logs = compared(before_m, after_m)
    told: dict[str, object] = {"constant": name, "factor": factor}
    for k, what in enumerate(("p95", "median")):
        mean = logs[0, k].mean(), *np.quantile(logs[1:, k].mean(axis=1), (0.025, 0.975))
        told |= dict(zip((what, f"{what}_low", f"{what}_high"), np.expm1(mean), strict=True))
        told |= {f"{what} {group}": np.expm1(log) for group, log in zip(GROUPS, logs[0, k], strict=True)}
    return told | {"better": bool(told["p95"] <= -LEAST_GAIN and told["p95_high"] < 0)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--constants", nargs="+", choices=CONSTANTS, default=[*CONSTANTS], metavar="NAME")
    parser.add_argument("--factors", nargs="+", type=float, default=[0.5, 0.7, 1.4, 2.0])
    options = parser.parse_args()
    people = range(len(split_members(DEVELOPMENT)["bodies"]))
    options.folder.mkdir(parents=True, exist_ok=True)
    todo = [n for n in people if not (options.folder / f"{n}.npz").exists()]
    list(run_jobs([(f"{n}.npz", partial(make_person, number=n)) for n in todo], folder=options.folder))
    lift = partial(errors_m, options.folder, people)
    before_m, rows = lift(options.constants[0], 1.0), []
    cases = [(name, factor) for name in options.constants for factor in options.factors]
    for case, after_m in run_jobs([(case, partial(lift, *case)) for case in cases]):
        rows.append(row(*case, before_m, after_m))
        print(pd.DataFrame(rows[-1:]).round(4).to_csv(index=False, header=len(rows) == 1), end="", flush=True)
    pd.DataFrame(rows).to_csv(options.folder / "sweep.csv", index=False)


if __name__ == "__main__":
    main()
