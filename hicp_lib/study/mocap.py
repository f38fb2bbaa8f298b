"""The data of the motion capture test: one recording, its clock offset, and its registration.

A simulated recording knows its exact transform and clock; clicks are simulated there. A laboratory's own
holds `clicks.csv` (markers clicked in images, see `hicp_lib.mocap.clicking`), or `registration.json` when
the transform is known from elsewhere.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from hicp_lib.core.cached_tables import cached
from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.detectors.runtime.results import detections_of
from hicp_lib.detectors.runtime.run import detect_images
from hicp_lib.evaluation.cases import labelled
from hicp_lib.evaluation.space.lifting_ablation import N_STEPS, lifting_ablation
from hicp_lib.evaluation.space.mocap_error import (
    MIN_SCORES,
    TABLE_JOINTS,
    marker_means,
    median_errors,
    mocap_errors,
)
from hicp_lib.evaluation.space.occlusion import joint_occlusion
from hicp_lib.evaluation.space.stability import POSITION, position_array
from hicp_lib.lifting.robust import METHODS
from hicp_lib.lifting.table import lift_found
from hicp_lib.mocap import registration
from hicp_lib.mocap.clicking import CLICKS_FILE, read_clicks
from hicp_lib.mocap.reprojection import register_by_reprojection
from hicp_lib.mocap.synchronisation import ClockOffset, clock_offset
from hicp_lib.recordings.qualisys import MotionCapture, read_mocap
from hicp_lib.recordings.recording import MOCAP_FILE, Recording, open_recording, read_simulation, read_truth


@dataclass(frozen=True)
class Registered:
    """The registrations of a recording.

    Attributes
    ----------
    fits : list of registration.Registration
        In the order of the module `hicp_lib.mocap.registration`, then by reprojection: the one to use.
    exact : array or None, shape (4, 4)
        The true transform T_base_mocap; None where it is not known.
    clicks : pd.DataFrame
        The clicks of the images the paper's registration rests on; empty where the transform was given.
    """

    fits: list[registration.Registration]
    exact: np.ndarray | None
    clicks: pd.DataFrame


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
    seen_m = [position_array(rows, TABLE_JOINTS, len(recording)) for rows in cases]
    # Speeds are the same in any frame: no registration is needed yet.
    means = marker_means(mocap, mocap.times_s, np.eye(4), TABLE_JOINTS)
    means_m = means[POSITION].to_numpy(float).reshape(len(mocap.times_s), len(TABLE_JOINTS), 3)
    return clock_offset(
        recording.times_s, np.concatenate(seen_m, axis=1), mocap.times_s, np.tile(means_m, (1, len(cases), 1))
    )


def register(
    recording: Recording,
    mocap: MotionCapture,
    offset_s: float,
    n_images: int = 12,
    noise_px: float = 1.0,
    seed: int = 0,
) -> Registered:
    """Every registration a recording allows; of one cut short, clicks beyond its end are not used.

    Parameters
    ----------
    recording : Recording
    mocap : MotionCapture
    offset_s : float
        Of the motion capture's clock, as from `find_clock`.
    n_images : int
        Images with simulated clicks; like the two below, not used on a laboratory's own recording.
    noise_px : float
        Standard deviation of a simulated click in each direction.
    seed : int
        Of the simulated clicks.

    Returns
    -------
    Registered

    Raises
    ------
    InputError
        If the recording has neither clicks nor a registration, or they are malformed.
    """
    clicks, exact = simulated_clicks(recording, mocap, n_images, noise_px, seed)
    clicks_path = recording.folder / CLICKS_FILE
    if exact is None and not clicks_path.is_file():
        return Registered([_given(recording)], None, pd.DataFrame())
    if exact is None:
        clicks = read_clicks(clicks_path, open_recording(recording.folder), mocap.names)
        clicks = clicks[clicks["frame"] < len(recording)]
    matched = registration.lift_clicks(recording, clicks, mocap, offset_s)
    eight = registration.select_paper_markers(matched)
    fits = [registration.register_selected(eight), registration.register_robustly(matched)]
    fits.append(register_by_reprojection(recording, clicks, mocap, fits[-1], offset_s))
    if registration.CAMERA_MARKER in mocap.names:
        places = registration.camera_places(recording, mocap, offset_s)
        ways = (False, True)
        fits = [registration.register_by_camera_marker(eight, *places, way) for way in ways] + fits
    return Registered(fits, exact, clicks.merge(eight[["frame", "marker"]]))


def simulated_clicks(
    recording: Recording, mocap: MotionCapture, n_images: int, noise_px: float, seed: int
) -> tuple[pd.DataFrame, np.ndarray | None]:
    """Clicks in a simulated recording, and its true transform.

    Parameters
    ----------
    recording : Recording
    mocap : MotionCapture
    n_images : int
    noise_px : float
    seed : int
        These three as of `register`.

    Returns
    -------
    pd.DataFrame
        As from `hicp_lib.simulation.sensors.clicks.simulate_clicks`; empty where it is not simulated.
    array or None, shape (4, 4)
        T_base_mocap; None where it is not simulated.
    """
    simulation = read_simulation(recording)
    if not simulation:
        return pd.DataFrame(), None
    from hicp_lib.simulation.sensors.clicks import simulate_clicks

    exact, offset_s = np.array(simulation["T_base_mocap"]), simulation["mocap_offset_s"]
    return simulate_clicks(recording, mocap, exact, n_images, noise_px, offset_s, seed), exact


def _given(recording: Recording) -> registration.Registration:
    file, n_clicks = registration.REGISTRATION_FILE, registration.N_PAPER_MARKERS
    if (recording.folder / file).is_file():
        return registration.read_registration(recording.folder / file)
    raise InputError(
        f"{recording.folder}: has neither {CLICKS_FILE} (frame,marker,u_px,v_px) nor {file}; click {n_clicks}"
        " or more markers with hicp_lib.mocap.clicking, or give T_base_mocap"
    )


def medians_under(
    registered: Registered,
    points: pd.DataFrame,
    recording: Recording,
    mocap: MotionCapture,
    offset_s: float,
    n_resamples: int = 1000,
    seed: int = 0,
) -> pd.DataFrame:
    """What the choice of the registration does to the median errors of elbows and wrists.

    Parameters
    ----------
    registered : Registered
    points : pd.DataFrame
        The first of `lift_frames`.
    recording : Recording
    mocap : MotionCapture
    offset_s : float
        Of the motion capture's clock.
    n_resamples, seed : int
        Number of bootstrap draws, and what they are drawn with.

    Returns
    -------
    pd.DataFrame
        Column `registration`, then as from `median_errors`, score above 0.1; the exact transform, where it is
        known, comes last.
    """
    fits = {fit.method: fit.T_base_mocap for fit in registered.fits}
    fits |= {} if registered.exact is None else {"exact": registered.exact}
    tables = []
    for name, T_base_mocap in fits.items():
        reference = marker_means(mocap, recording.times_s - offset_s, T_base_mocap, TABLE_JOINTS)
        medians = median_errors(mocap_errors(points, reference), MIN_SCORES[-1:], n_resamples, seed)
        tables.append(labelled(medians, registration=name))
    return pd.concat(tables, ignore_index=True)


def errors_at_joints(
    points: pd.DataFrame, registered: Registered, recording: Recording, mocap: MotionCapture, offset_s: float
) -> pd.DataFrame:
    """`mocap_errors` under the best registration, with the lines of sight: columns `distance_m, sight`.

    Parameters
    ----------
    points : pd.DataFrame
        The first of `lift_frames`.
    registered : Registered
    recording : Recording
    mocap : MotionCapture
    offset_s : float
        Of the motion capture's clock.

    Returns
    -------
    pd.DataFrame
    """
    stamps_s, T_base_mocap = recording.times_s - offset_s, registered.fits[-1].T_base_mocap
    reference = marker_means(mocap, stamps_s, T_base_mocap)
    errors = mocap_errors(points, reference, read_truth(recording))
    return errors.merge(joint_occlusion(recording, reference), on=["frame", "keypoint"])


def ablation(recording: Recording, stepwise: pd.DataFrame) -> pd.DataFrame | None:
    """`lifting_ablation` of the second of `lift_frames`; None where no true positions are known."""
    truth = read_truth(recording)
    return None if truth is None else lifting_ablation(stepwise, truth)
