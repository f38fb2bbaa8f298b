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


def alone(**n_frames: int) -> dict[str, np.ndarray]:
    """All frames of a view are of one person."""
    return {view: np.zeros(n, dtype=int) for view, n in n_frames.items()}


def make_points(
    offsets_m, keypoints=KEYPOINTS, view="upper", detector="mediapipe", score=0.9, subjects=None
) -> pd.DataFrame:
    """Keypoints found at their true positions plus an offset per frame, (n_frames, 3); NaN = not lifted."""
    whose = np.zeros(len(offsets_m), dtype=int) if subjects is None else subjects
    rows = [
        (view, whose[frame], detector, "robust", frame, 0, name, score, *(TRUE_M[name] + offset))
        for frame, offset in enumerate(np.asarray(offsets_m, float))
        for name in keypoints
    ]
    columns = ["view", "subject", "detector", "method", "frame", "person", "keypoint", "score"]
    columns += ["x_m", "y_m", "z_m"]
    return pd.DataFrame(rows, columns=columns)
