"""A person who sits still, found from many views with errors that are known."""

import numpy as np
import pandas as pd

from hicp_lib.evaluation.space.stability import PARTS

KEYPOINTS = [name for names in PARTS.values() for name in names]
TRUE_M = dict(zip(KEYPOINTS, np.random.default_rng(7).uniform(-0.5, 0.5, (len(KEYPOINTS), 3)), strict=True))


def make_truth(n_frames: int) -> pd.DataFrame:
    """The true positions, the same in every frame."""
    rows = [(frame, name, *TRUE_M[name]) for frame in range(n_frames) for name in KEYPOINTS]
    return pd.DataFrame(rows, columns=["frame", "keypoint", "x_m", "y_m", "z_m"])


def make_points(
    offsets_m, keypoints=KEYPOINTS, view="upper", detector="mediapipe", score=0.9
) -> pd.DataFrame:
    """Keypoints found at their true positions plus an offset per frame, (n_frames, 3); NaN = not lifted."""
    rows = [
        (view, detector, "robust", frame, 0, name, score, *(TRUE_M[name] + offset))
        for frame, offset in enumerate(np.asarray(offsets_m, float))
        for name in keypoints
    ]
    columns = ["view", "detector", "method", "frame", "person", "keypoint", "score", "x_m", "y_m", "z_m"]
    return pd.DataFrame(rows, columns=columns)
