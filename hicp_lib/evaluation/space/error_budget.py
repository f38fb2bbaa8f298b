"""Contributions to the 3D error of keypoints: every source switched on alone, and off alone, over people.

Simulated recordings have exact ground truth. Starting from it, the sources of `error_sources` are switched on
in any combination. *Skin depth* is the lifting with an error-free depth image at the true pixel, which gives
skin, cloth or an occluding surface; when it is off, the vector from the joint to that point is subtracted.
*Depth sensor* and *2D detection* replace that depth image, and that pixel, by the measured ones. The error is
the distance between the robot's keypoint and its reference.

All sets of sources are compared on the same keypoints: those detected with a score above a threshold, in the
image, and lifted with any of these pixels and depths.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd

from hicp_lib.core.camera import deproject, project, transform
from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import LEFT_HAND, NAMES, RIGHT_HAND
from hicp_lib.evaluation.cases import labelled
from hicp_lib.evaluation.space import error_sources as s
from hicp_lib.evaluation.space.mocap_error import JOINTS
from hicp_lib.evaluation.space.stability import MIN_SCORE, counted, position_array
from hicp_lib.evaluation.statistics.proportions import smallest_difference
from hicp_lib.evaluation.statistics.resampling import Draws, draw_counts, with_interval
from hicp_lib.lifting.robust import METHODS
from hicp_lib.lifting.table import lift_found
from hicp_lib.recordings.recording import EXACT_DEPTH_DIR, PER_FRAME, Recording, read_truth

ALL, AGAINST_MOCAP, IN_BASE = "everything", "against motion capture", "in the robot's frame"
TOTALS = {
    ALL: {*s.SOURCES},
    # A registration through the same, static camera includes the error of the camera's assumed pose.
    AGAINST_MOCAP: {*s.SOURCES} - {s.OFFSETS, s.MOUNT},
    IN_BASE: {*s.SOURCES} - {s.MARKERS, s.REGISTRATION, s.CLOCK},
}
"""Combinations of sources: all, those in the paper's comparison, and those that act on the robot."""
_ALONE, _WITHOUT = "{}, alone", "without {}"
STATES: dict[str, set[str]] = TOTALS | {_ALONE.format(source): {source} for source in s.SOURCES}
STATES |= {_WITHOUT.format(source): {*s.SOURCES} - {source} for source in s.SOURCES}
"""The sources switched on, by the column with the resulting error."""

_FINGERS = tuple(NAMES[k] for hand in (LEFT_HAND, RIGHT_HAND) for k in hand[1:])
_KEYPOINTS = (*JOINTS, *_FINGERS)
_PARTS = [name.partition("_")[2] for name in JOINTS] + ["finger"] * len(_FINGERS)
# The limb of a keypoint: upper arm for shoulders, else forearm.
_SIDES = [name.partition("_")[0] for name in _KEYPOINTS]
_ELBOWS = [_KEYPOINTS.index(f"{side}_elbow") for side in _SIDES]
_OTHERS = ["shoulder" if part == "shoulder" else "wrist" for part in _PARTS]
_ENDS = [_KEYPOINTS.index(f"{side}_{joint}") for side, joint in zip(_SIDES, _OTHERS, strict=True)]
_CAMERA_POSITION = ["x_cam_m", "y_cam_m", "z_cam_m"]
_TRUE, _FOUND = "true", "found"
_NOTHING_M = 1e-9
# Covariates of the error: the column, and the step to which a factor refers.
_COVARIATES = {
    "10 cm further away": ("distance_m", 0.1),
    "limb at the camera, not across": ("towards_camera", 1.0),
    "hidden": ("hidden", 1.0),
}


def keypoint_errors(
    recording: Recording,
    found: Sequence[Detections],
    T_base_mocap: np.ndarray | None,
    amounts: s.Amounts,
    every: int = 1,
    min_score: float = MIN_SCORE,
    seed: int | Sequence[int] = 0,
) -> pd.DataFrame:
    """Errors of every keypoint of a recording with each set of sources, frame by frame.

    Parameters
    ----------
    recording : Recording
        Simulated.
    found : sequence of Detections
        Of each frame; the best person is used.
    T_base_mocap : array or None, shape (4, 4)
        From clicks; None: the reference is the truth, not motion capture.
    amounts : s.Amounts
        Magnitudes of the errors.
    every : int, optional
        Use only the first and then every n-th frame.
    min_score : float, optional
        Keypoints above it are used.
    seed : int or sequence of int, optional
        Of the random magnitudes: the same for all recordings of a person.

    Returns
    -------
    DataFrame
        A row per method and used keypoint: columns `method, keypoint, part, frame`, `distance_m`
        (from the camera), `towards_camera` (0 where its limb, upper arm or forearm, is across the line of
        sight, 1 along it), `hidden` (by something in front), and the error in metres in a column for each of
        `STATES`.

    Raises
    ------
    InputError
        If the joints do not give the camera's poses.
    """
    rng = np.random.default_rng(seed)
    n, truth = len(recording), read_truth(recording)
    true_m = position_array(truth, _KEYPOINTS, n)
    visible = position_array(truth, _KEYPOINTS, n, ["visible"])[..., 0]
    intrinsics = s.wrong_intrinsics(recording.intrinsics, amounts, rng)
    poses, shifts_m = s.wrong_poses(recording, amounts, rng), {}
    if T_base_mocap is not None:
        shifts_m = s.reference_shifts(recording, true_m, T_base_mocap, amounts, rng)
    seen_m = _seen(recording, {_TRUE: s.true_detections(truth, n), _FOUND: found}, every, min_score)
    true_cam_m = transform(np.linalg.inv(recording.T_base_cam), true_m)
    places_m = [*seen_m.values(), *shifts_m.values()]
    counts = np.all([np.isfinite(at_m).all(axis=-1) for at_m in places_m], axis=0) & (visible > 0)
    frame, keypoint = np.nonzero(counts)
    limb_m, sight_m = true_m[:, _ENDS] - true_m[:, _ELBOWS], true_m - recording.T_base_cam[:, None, :3, 3]
    away_m = np.linalg.norm(sight_m, axis=-1)
    cosine = (limb_m * sight_m).sum(axis=-1) / away_m / np.linalg.norm(limb_m, axis=-1)
    columns = {
        "keypoint": np.array(_KEYPOINTS)[keypoint],
        "part": np.array(_PARTS)[keypoint],
        "frame": frame,
        "distance_m": away_m[counts],
        "towards_camera": abs(cosine[counts]),
        "hidden": visible[counts] == 1,
    }
    tables = []
    for method in METHODS:
        skin_m = seen_m[method, _TRUE, False] - true_cam_m
        for state, on in STATES.items():
            at_m = seen_m[method, _FOUND if s.PIXEL in on else _TRUE, s.SENSOR in on]
            at_m = at_m if s.SKIN in on else at_m - skin_m
            if s.INTRINSICS in on:
                at_m = deproject(intrinsics, project(recording.intrinsics, at_m), at_m[..., 2])
            off_m = transform(poses[s.OFFSETS in on, s.MOUNT in on], at_m) - true_m
            off_m = off_m - sum(shift_m for source, shift_m in shifts_m.items() if source in on)
            columns[state] = np.linalg.norm(off_m[counts], axis=-1)
        tables.append(labelled(pd.DataFrame(columns), method=method))
    return pd.concat(tables, ignore_index=True)


def _seen(
    recording: Recording, found: Mapping[str, Sequence[Detections]], every: int, min_score: float
) -> dict[tuple[str, str, bool], np.ndarray]:
    """Positions in the camera's frame (n, k, 3) by method, pixels, and whether the depth is the sensor's."""
    some = replace(recording, **{name: getattr(recording, name)[::every] for name in PER_FRAME})
    exact_paths = [recording.folder / EXACT_DEPTH_DIR / path.name for path in some.depth_paths]
    people, seen_m = {pixels: of[::every] for pixels, of in found.items()}, {}
    for is_measured, of in ((True, some), (False, replace(some, depth_paths=exact_paths))):
        lifted = counted(lift_found(of, people), min_score, _CAMERA_POSITION)
        lifted = lifted.assign(frame=every * lifted["frame"])
        for method, pixels in product(METHODS, found):
            rows = lifted[(lifted["method"] == method) & (lifted["detector"] == pixels)]
            places_m = position_array(rows, _KEYPOINTS, len(recording), _CAMERA_POSITION)
            seen_m[method, pixels, is_measured] = places_m
    return seen_m


def error_budget(errors: pd.DataFrame, draws: Draws = Draws()) -> pd.DataFrame:
    """The error by each source alone, and the gain from switching it off alone.

    Parameters
    ----------
    errors : DataFrame
        As from `keypoint_errors`, of several people, with further columns `view, subject`.
    draws : Draws, optional
        Of people, in the bootstrap.

    Returns
    -------
    DataFrame
        Columns `view, method, part, source, kind`, `value_m, low_m, high_m` (median over a person's
        keypoints, mean over people, 95 % interval), `detectable_m` (the smallest such mean that this number
        of people could distinguish from 0), `n_people, n` (keypoints). Of the kind "total" are `TOTALS`,
        without motion capture only the first; "alone" is the error by a source alone, "gain" the reduction of
        the total error without it. Sources without an effect have no rows.
    """
    rows: list[tuple] = []
    for case, part in errors.groupby(["view", "method", "part"], sort=False):
        medians_m = part.groupby("subject")[list(STATES)].median()
        n_people, acts = len(medians_m), medians_m.max() > _NOTHING_M
        drawn = draw_counts(np.arange(n_people), draws) / n_people
        totals = TOTALS if acts[_ALONE.format(s.REGISTRATION)] else (ALL,)
        values_m = {(total, "total"): medians_m[total] for total in totals}
        for source in s.SOURCES:
            if acts[_ALONE.format(source)]:
                values_m[source, "alone"] = medians_m[_ALONE.format(source)]
                values_m[source, "gain"] = medians_m[ALL] - medians_m[_WITHOUT.format(source)]
        for what, of_m in values_m.items():
            numbers = (*with_interval(drawn @ of_m, n_people), smallest_difference(of_m))
            rows.append((*case, *what, *numbers, n_people, len(part)))
    names = ["source", "kind", "value_m", "low_m", "high_m", "detectable_m", "n_people", "n"]
    return pd.DataFrame(rows, columns=["view", "method", "part", *names])


def covariates(errors: pd.DataFrame, draws: Draws = Draws()) -> pd.DataFrame:
    """Factors on the error in the robot's frame with distance, viewing direction and occlusion.

    Least squares of its logarithm on all covariates jointly, with equal weight for every person.

    Parameters
    ----------
    errors : DataFrame
        As in `error_budget`; views are pooled.
    draws : Draws, optional
        Of people, in the bootstrap.

    Returns
    -------
    DataFrame
        Columns `method, part, covariate, factor, low, high` (95 % interval), `n_people, n` (keypoints). No
        row where the covariate is the same throughout.
    """
    rows = []
    for case, part in errors.groupby(["method", "part"], sort=False):
        steps = {name: part[column] / step for name, (column, step) in _COVARIATES.items()}
        steps = {name: values for name, values in steps.items() if values.nunique() > 1}
        table = np.column_stack([np.ones(len(part)), *steps.values(), np.log(part[IN_BASE])]).astype(float)
        people = [table[part["subject"] == subject] for subject in part["subject"].unique()]
        products = np.stack([of.T @ of / len(of) for of in people])
        sums = np.tensordot(draw_counts(np.arange(len(people)), draws), products, 1)
        factors = np.exp(np.linalg.pinv(sums[:, :-1, :-1]) @ sums[:, :-1, -1:])[:, 1:, 0]
        bounds = zip(steps, *with_interval(factors, len(people)), strict=True)
        rows += [(*case, *row, len(people), len(part)) for row in bounds]
    names = ["covariate", "factor", "low", "high", "n_people", "n"]
    return pd.DataFrame(rows, columns=["method", "part", *names])
