"""Skeletons from tables as lines to draw."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from hicp_lib.core.keypoints import HANDS, INDEX, LIMBS, N_KEYPOINTS

BODY_LIMBS = [limb for limb in LIMBS if limb[0] not in HANDS]
HAND_LIMBS = [limb for limb in LIMBS if limb[0] in HANDS]


def limb_lines(
    rows: pd.DataFrame, columns: Sequence[str], limbs: Sequence[tuple[int, int]] = LIMBS
) -> np.ndarray:
    """Limbs whose both ends are known, as one line that is interrupted by NaN.

    Parameters
    ----------
    rows : pd.DataFrame
        With `keypoint` (Halpe names) and coordinates; of a table with many frames, the first counts.
    columns : sequence of str
        The d coordinates.
    limbs : sequence of (int, int)
        Keypoints of Halpe-136 that are joined.

    Returns
    -------
    array, shape (3 n, d)
        Start, end and NaN of every limb.

    Examples
    --------
    >>> elbow_and_wrist = pd.DataFrame({"keypoint": ["left_elbow", "left_wrist"], "x_m": [0.0, 0.3]})
    >>> limb_lines(elbow_and_wrist, ["x_m"]).ravel().tolist()
    [0.0, 0.3, nan]
    """
    points = np.full((N_KEYPOINTS, len(columns)), np.nan)
    rows = rows.drop_duplicates("keypoint")
    points[rows["keypoint"].map(INDEX)] = rows[list(columns)]
    ends = points[np.array(limbs)]
    ends = ends[np.isfinite(ends).all(axis=(1, 2))]
    return np.concatenate([ends, np.full_like(ends[:, :1], np.nan)], axis=1).reshape(-1, len(columns))
