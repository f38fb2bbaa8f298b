"""How much of the distance from motion capture is not the detector's.

Markers lie on the skin and joints below it, and depth sees the skin. So a detector without an error in the
image is still some centimetres off: the floor that detectors are compared with. It is no bound: errors in the
image that lean towards the skin in sight may bring a detector below it.
"""

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import BODY
from hicp_lib.evaluation.space.error_sources import true_detections
from hicp_lib.recordings.recording import Recording, read_truth
from hicp_lib.study.plots.palette import PERFECT


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
