"""The data of the motion capture test: detections, lifted keypoints, clock offset, and errors.

Each person has a recording of their own, with motion capture, its clock and registration.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from hicp_lib.core.cached_tables import cached
from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import BODY
from hicp_lib.detectors.runtime.results import detections_of
from hicp_lib.detectors.runtime.run import detect_images
from hicp_lib.evaluation.cases import labelled, over_people
from hicp_lib.evaluation.space import mocap_error
from hicp_lib.evaluation.space.error_sources import true_detections
from hicp_lib.evaluation.space.lifting_ablation import N_STEPS, lifting_errors, sigma_coverage, summary
from hicp_lib.evaluation.space.occlusion import joint_occlusion
from hicp_lib.evaluation.space.stability import POSITION, position_array
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.lifting.robust import METHODS
from hicp_lib.lifting.table import lift_found
from hicp_lib.mocap.registration import Registration
from hicp_lib.mocap.synchronisation import ClockOffset, clock_offset
from hicp_lib.recordings.qualisys import MotionCapture, read_mocap
from hicp_lib.recordings.recording import MOCAP_FILE, Recording, colour_files, read_simulation, read_truth
from hicp_lib.study.plots.palette import PERFECT
from hicp_lib.study.registration import Registered

_CLOCKS = [
    "person", "n_frames", "offset_s", "first_half_s", "second_half_s", "correlation", "off_s", "left_out",
]  # fmt: skip


@dataclass(frozen=True)
class Person:
    """One person of the test.

    Attributes
    ----------
    recording : Recording
    mocap : MotionCapture
    found : dict of str to list of Detections
        By detector, in every frame.
    points, stepwise : pd.DataFrame
        As from `lift_frames`; includes the perfect detector if there is ground truth.
    clock : ClockOffset
    """

    recording: Recording
    mocap: MotionCapture
    found: dict[str, list[Detections]]
    points: pd.DataFrame
    stepwise: pd.DataFrame
    clock: ClockOffset


def follow_people(
    recordings: Sequence[Recording], detectors: Sequence[str]
) -> tuple[list[Person], pd.DataFrame]:
    """All people whose motion capture can be synchronised with the camera.

    Parameters
    ----------
    recordings : sequence of Recording
        One of each person, with motion capture.
    detectors : sequence of str

    Returns
    -------
    list of Person
    pd.DataFrame
        A row for each recording: columns `person` (from 0 on), `n_frames, offset_s, first_half_s,
        second_half_s, correlation` (as of `ClockOffset`), `off_s` (difference from the true offset), NaN if
        unknown; `left_out` (why the person is, else "").

    Raises
    ------
    InputError
        If no one is left.
    """
    people, rows = [], []
    for number, recording in enumerate(recordings):
        mocap, found = open_mocap(recording), detect_frames(recording, detectors)
        points, stepwise = lift_frames(recording, found | perfect_detections(recording))
        told = (number, len(recording))
        try:
            clock = find_clock(recording, mocap, points[points["detector"].isin(found)])
        except InputError as error:
            rows.append((*told, *[np.nan] * 5, str(error)))
            continue
        off_s = clock.offset_s - (read_simulation(recording) or {}).get("mocap_offset_s", np.nan)
        rows.append((*told, clock.offset_s, *clock.halves_s, clock.correlation, off_s, ""))
        people.append(Person(recording, mocap, found, points, stepwise, clock))
    if not people:
        raise InputError(f"{recordings[0].folder}: {rows[0][-1]}")
    return people, pd.DataFrame(rows, columns=_CLOCKS)


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
    """Detections in every frame; cached on disk.

    Parameters
    ----------
    recording : Recording
    detectors : sequence of str

    Returns
    -------
    dict of str to list of Detections
        By detector, in the order of the frames.
    """
    paths = colour_files(recording)
    return {detector: list(detections_of(detect_images(detector, paths)).values()) for detector in detectors}


def perfect_detections(recording: Recording) -> dict[str, list[Detections]]:
    """The body's true keypoints in every frame, including occluded ones, with scores of 1.

    Markers are on the skin, joints below it, and depth cameras see the skin: so the floor for detectors is
    some centimetres. It is not a lower bound: a detector whose errors lean towards the skin may fall below
    it.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    dict of str to list of Detections
        Under `PERFECT`, in the order of the frames; empty without ground truth.
    """
    truth = read_truth(recording)
    return {} if truth is None else {PERFECT: true_detections(truth, len(recording), BODY)}


def lift_frames(
    recording: Recording, found: Mapping[str, Sequence[Detections]]
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Lifted keypoints of all people; cached on disk.

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
        The first detector's, for every step between the methods, if true positions are known (for
        `ablation`).
    """
    n_steps = METHODS if read_truth(recording) is None else METHODS | N_STEPS
    table = cached(lift_found, recording, found, n_steps)
    return table[table["method"].isin(METHODS)], table[table["detector"] == next(iter(found))]


def find_clock(recording: Recording, mocap: MotionCapture, points: pd.DataFrame) -> ClockOffset:
    """The clock offset of motion capture, from the speeds of elbows and wrists.

    Parameters
    ----------
    recording : Recording
    mocap : MotionCapture
    points : pd.DataFrame
        The first of `lift_frames`; all detectors and methods are used jointly.

    Returns
    -------
    ClockOffset

    Raises
    ------
    InputError
        If no movements match (`hicp_lib.mocap.synchronisation.clock_offset`).
    """
    best = points[points["person"] == 0]
    cases = [rows for _, rows in best.groupby(["detector", "method"], sort=False)]
    seen_m = [position_array(rows, mocap_error.TABLE_JOINTS, len(recording)) for rows in cases]
    # Speeds do not depend on the frame, so no registration is needed yet.
    means = mocap_error.marker_means(mocap, mocap.times_s, np.eye(4), mocap_error.TABLE_JOINTS)
    means_m = means[POSITION].to_numpy(float).reshape(len(mocap.times_s), len(mocap_error.TABLE_JOINTS), 3)
    tiled_m = np.tile(means_m, (1, len(cases), 1))
    return clock_offset(recording.times_s, np.concatenate(seen_m, axis=1), mocap.times_s, tiled_m)


def medians_under(
    registered: Sequence[Registered], points: Sequence[pd.DataFrame], draws: Draws = Draws()
) -> pd.DataFrame:
    """Effect of the registration on the median errors of elbows and wrists.

    Parameters
    ----------
    registered : sequence of Registered
        Of each person.
    points : sequence of pd.DataFrame
        The first of `lift_frames`, of each.
    draws : Draws
        Of the bootstrap.

    Returns
    -------
    pd.DataFrame
        Column `registration`, then as from `median_errors`, score above 0.1; the exact transform, if known,
        comes last.
    """
    errors: dict[str, list[tuple[pd.DataFrame, int]]] = {}
    for one, lifted in zip(registered, points, strict=True):
        exact = [] if one.exact is None else [Registration("exact", one.exact)]
        for fit in [*one.fits, *exact]:
            table = mocap_error.mocap_errors(lifted, one.reference(fit, mocap_error.TABLE_JOINTS))
            errors.setdefault(fit.method, []).append((table, len(one.recording)))
    of_all = {method: over_people(*zip(*of, strict=True)) for method, of in errors.items()}
    least = mocap_error.MIN_SCORES[-1:]
    medians = {method: mocap_error.median_errors(table, least, draws) for method, table in of_all.items()}
    return pd.concat([labelled(of, registration=method) for method, of in medians.items()], ignore_index=True)


def errors_at_joints(registered: Sequence[Registered], points: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """`mocap_errors` under the best registration, with the lines of sight: columns `distance_m, sight`.

    Parameters
    ----------
    registered : sequence of Registered
        Of each person.
    points : sequence of pd.DataFrame
        The first of `lift_frames`, of each.

    Returns
    -------
    pd.DataFrame
        Of all people (`over_people`).
    """
    tables = []
    for one, lifted in zip(registered, points, strict=True):
        reference = one.reference()
        errors = mocap_error.mocap_errors(lifted, reference, read_truth(one.recording))
        tables.append(errors.merge(joint_occlusion(one.recording, reference), on=["frame", "keypoint"]))
    return over_people(tables, [len(one.recording) for one in registered])


def ablation(people: Sequence[Person]) -> tuple[pd.DataFrame, pd.DataFrame] | None:
    """Each step of lifting on all people's `stepwise`, and how often depths are within their sigma.

    None if true positions are unknown.
    """
    known = [(one, truth) for one in people if (truth := read_truth(one.recording)) is not None]
    errors = [lifting_errors(one.stepwise, truth, one.recording.T_base_cam) for one, truth in known]
    return (summary(pd.concat(errors)), sigma_coverage(pd.concat(errors))) if errors else None
