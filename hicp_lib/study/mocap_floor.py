"""How much of the distance from motion capture is not the detector's, and what the neighbourhood's size adds.

Markers lie on the skin and joints below it, and depth sees the skin. So a detector without an error in the
image is still some centimetres off: the floor that detectors are compared with. It is no bound: errors in the
image that lean towards the skin in sight may bring a detector below it.
"""

from collections.abc import Sequence

import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import BODY
from hicp_lib.evaluation.cases import labelled, over_people
from hicp_lib.evaluation.space.error_sources import true_detections
from hicp_lib.evaluation.space.mocap_error import MIN_SCORES, TABLE_JOINTS, median_errors, mocap_errors
from hicp_lib.evaluation.space.stability import POSITION
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.lifting.table import lift_pixels
from hicp_lib.recordings.recording import Recording, read_truth
from hicp_lib.study.plots.palette import PERFECT
from hicp_lib.study.registration import Registered


def perfect_detections(recording: Recording) -> dict[str, list[Detections]]:
    """The body's true keypoints in every frame, hidden ones too, with scores of 1.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    dict of str to list of Detections
        Under `PERFECT`, in the order of the frames; empty where the truth is not known.
    """
    truth = read_truth(recording)
    return {} if truth is None else {PERFECT: true_detections(truth, len(recording), BODY)}


def medians_by_radius(
    registered: Sequence[Registered], points: Sequence[pd.DataFrame], radii_m: Sequence[float], draws: Draws
) -> pd.DataFrame:
    """Median errors of the paper's lifting by the size of the neighbourhood that it takes depth from.

    Parameters
    ----------
    registered : sequence of Registered
        Of each person.
    points : sequence of pd.DataFrame
        As from `hicp_lib.lifting.table.lift_found`, of each; of some frames, to save time.
    radii_m : sequence of float
        Half the sides of the neighbourhood.
    draws : Draws
        Of the bootstrap.

    Returns
    -------
    pd.DataFrame
        Column `radius_m`, then as from `median_errors`, score above 0.1.
    """
    by_radius: list[list[pd.DataFrame]] = [[] for _ in radii_m]
    for one, lifted in zip(registered, points, strict=True):
        rows = lifted[(lifted["person"] == 0) & (lifted["method"] == "paper")]
        rows = rows[rows["keypoint"].isin(TABLE_JOINTS)]
        reference = one.reference(joints=TABLE_JOINTS)
        reference = reference[reference["frame"].isin(lifted["frame"])]
        for errors, places_m in zip(by_radius, lift_pixels(one.recording, rows, radii_m), strict=True):
            at = rows.assign(**dict(zip(POSITION, places_m.T, strict=True)))
            errors.append(mocap_errors(at, reference))
    n_frames, tables = [len(one.recording) for one in registered], []
    for radius_m, errors in zip(radii_m, by_radius, strict=True):
        medians = median_errors(over_people(errors, n_frames), MIN_SCORES[-1:], draws)
        tables.append(labelled(medians, radius_m=radius_m))
    return pd.concat(tables, ignore_index=True)
