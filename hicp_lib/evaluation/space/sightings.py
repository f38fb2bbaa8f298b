"""In which images a part of a person is found, and found near: what detectors are compared by.

Parts are more than in `hicp_lib.evaluation.space.stability`: an arm is found with any of its joints.
Rows are per image, for `hicp_lib.evaluation.statistics.proportions`: shares with intervals, and differences
of detectors or of parts on the same images.
"""

import numpy as np
import pandas as pd

from hicp_lib.evaluation.space.stability import CASE, PARTS, LiftedViews, Parts, own_medians

WITHIN_M = 0.05
FOUND, NEAR_MEDIAN, NEAR_TRUTH = "found", "within 5 cm of the median", "within 5 cm of the truth"
ROW = [*CASE, "part", "measure"]

_ARMS = {f"{side} arm": (f"{side}_elbow", f"{side}_wrist") for side in ("left", "right")}
_ANY = {"any arm joint": sum(_ARMS.values(), ()), "any hand": (*PARTS["left hand"], *PARTS["right hand"])}
ALL_PARTS: Parts = {**PARTS, **_ARMS, **_ANY}
"""An arm is an elbow or a wrist, as in `hicp_lib.datasets.visibility`."""


def sightings(lifted: LiftedViews) -> pd.DataFrame:
    """Of every part in every image, whether it is found and what share of its keypoints is near.

    Parameters
    ----------
    lifted : LiftedViews

    Returns
    -------
    DataFrame
        Columns `view, detector, method, part, measure, subject, source_image` (the frame), `value`. `FOUND`
        is 1 where any of the part's keypoints is found; `NEAR_MEDIAN` and, with truth, `NEAR_TRUTH` are the
        share of them within `WITHIN_M` of the detector's median position over the subject's images, and of
        the truth.
    """
    tables = []
    for case, part, whose, found_m, true_m in lifted.cases(ALL_PARTS):
        seen = np.isfinite(found_m[..., 0])
        values = {FOUND: seen.any(axis=1).astype(float)}
        references = {NEAR_MEDIAN: own_medians(found_m, whose)}
        references |= {} if true_m is None else {NEAR_TRUTH: true_m}
        for name, reference_m in references.items():
            values[name] = (np.linalg.norm(found_m - reference_m, axis=-1) <= WITHIN_M).mean(axis=1)
        of_rows = (*case, part, whose, np.arange(len(seen)))
        labels = dict(zip([*CASE, "part", "subject", "source_image"], of_rows, strict=True))
        tables += [pd.DataFrame(labels | {"measure": name, "value": of}) for name, of in values.items()]
    return pd.concat(tables, ignore_index=True)[[*ROW, "subject", "source_image", "value"]]
