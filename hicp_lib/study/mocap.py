"""The data of the motion capture test: what was detected and lifted, the clock's offset, and errors."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from hicp_lib.core.cached_tables import cached
from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.detectors.runtime.results import detections_of
from hicp_lib.detectors.runtime.run import detect_images
from hicp_lib.evaluation.cases import labelled
from hicp_lib.evaluation.space import mocap_error
from hicp_lib.evaluation.space.lifting_ablation import N_STEPS, lifting_ablation
from hicp_lib.evaluation.space.occlusion import joint_occlusion
from hicp_lib.evaluation.space.stability import POSITION, position_array
from hicp_lib.lifting.robust import METHODS
from hicp_lib.lifting.table import lift_found
from hicp_lib.mocap.registration import Registration
from hicp_lib.mocap.synchronisation import ClockOffset, clock_offset
from hicp_lib.recordings.qualisys import MotionCapture, read_mocap
from hicp_lib.recordings.recording import MOCAP_FILE, Recording, read_truth
from hicp_lib.study.registration import Registered


def open_mocap(recording: Recording) -> MotionCapture:
    """The recording's motion capture.

    Raises
    ------
    InputError
        If there is none, or it is not an export of 3D data.
    """
    if recording.mocap_path is None:
        raise InputError(
            f"{recording.folder}: has no {MOCAP_FILE}; export 3D data from Qualisys with header into it"
        )
    return read_mocap(recording.mocap_path)


def detect_frames(recording: Recording, detectors: Sequence[str]) -> dict[str, list[Detections]]:
    """What detectors find in every frame; kept on disk.

    Parameters
    ----------
    recording : Recording
    detectors : sequence of str

    Returns
    -------
    dict of str to list of Detections
        By detector, in the order of the frames.
    """
    paths = dict(enumerate(recording.rgb_paths))
    return {detector: list(detections_of(detect_images(detector, paths)).values()) for detector in detectors}


def lift_frames(
    recording: Recording, found: Mapping[str, Sequence[Detections]]
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Everyone's keypoints in space; kept on disk.

    Parameters
    ----------
    recording : Recording
    found : mapping of str to sequence of Detections
        As from `detect_frames`.

    Returns
    -------
    pd.DataFrame
        Columns as of `hicp_lib.lifting.table.lift_found`, by each of `METHODS`.
    pd.DataFrame
        The first detector's, also by every step between the methods where true positions are known (for
        `ablation`).
    """
    n_steps = METHODS if read_truth(recording) is None else METHODS | N_STEPS
    table = cached(lift_found, recording, found, n_steps)
    return table[table["method"].isin(METHODS)], table[table["detector"] == next(iter(found))]


def find_clock(recording: Recording, mocap: MotionCapture, points: pd.DataFrame) -> ClockOffset:
    """What to add to the motion capture's stamps, from how fast elbows and wrists move.

    Parameters
    ----------
    recording : Recording
    mocap : MotionCapture
    points : pd.DataFrame
        The first of `lift_frames`; those of all detectors and methods are compared at once.

    Returns
    -------
    ClockOffset

    Raises
    ------
    InputError
        If nothing moves together (`hicp_lib.mocap.synchronisation.clock_offset`).
    """
    best = points[points["person"] == 0]
    cases = [rows for _, rows in best.groupby(["detector", "method"], sort=False)]
    seen_m = [position_array(rows, mocap_error.TABLE_JOINTS, len(recording)) for rows in cases]
    # Speeds are the same in any frame: no registration is needed yet.
    means = mocap_error.marker_means(mocap, mocap.times_s, np.eye(4), mocap_error.TABLE_JOINTS)
    means_m = means[POSITION].to_numpy(float).reshape(len(mocap.times_s), len(mocap_error.TABLE_JOINTS), 3)
    return clock_offset(
        recording.times_s, np.concatenate(seen_m, axis=1), mocap.times_s, np.tile(means_m, (1, len(cases), 1))
    )


def medians_under(
    registered: Registered, points: pd.DataFrame, n_resamples: int = 1000, seed: int = 0
) -> pd.DataFrame:
    """What the choice of the registration does to the median errors of elbows and wrists.

    Parameters
    ----------
    registered : Registered
    points : pd.DataFrame
        The first of `lift_frames`.
    n_resamples, seed : int
        Number of bootstrap draws, and what they are drawn with.

    Returns
    -------
    pd.DataFrame
        Column `registration`, then as from `median_errors`, score above 0.1; the exact transform, where it is
        known, comes last.
    """
    fits = list(registered.fits)
    fits += [] if registered.exact is None else [Registration("exact", registered.exact)]
    tables = []
    for fit in fits:
        errors = mocap_error.mocap_errors(points, registered.reference(fit, mocap_error.TABLE_JOINTS))
        medians = mocap_error.median_errors(errors, mocap_error.MIN_SCORES[-1:], n_resamples, seed)
        tables.append(labelled(medians, registration=fit.method))
    return pd.concat(tables, ignore_index=True)


def errors_at_joints(registered: Registered, points: pd.DataFrame) -> pd.DataFrame:
    """`mocap_errors` under the best registration, with the lines of sight: columns `distance_m, sight`.

    Parameters
    ----------
    registered : Registered
    points : pd.DataFrame
        The first of `lift_frames`.

    Returns
    -------
    pd.DataFrame
    """
    reference, recording = registered.reference(), registered.recording
    errors = mocap_error.mocap_errors(points, reference, read_truth(recording))
    return errors.merge(joint_occlusion(recording, reference), on=["frame", "keypoint"])


def ablation(recording: Recording, stepwise: pd.DataFrame) -> pd.DataFrame | None:
    """`lifting_ablation` of the second of `lift_frames`; None where no true positions are known."""
    truth = read_truth(recording)
    return None if truth is None else lifting_ablation(stepwise, truth)
