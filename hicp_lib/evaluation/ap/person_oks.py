"""OKS person by person: how well each one who counts is found."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import SIGMAS
from hicp_lib.evaluation.ap.evaluate import check_detections, people_seen
from hicp_lib.evaluation.ap.options import choose
from hicp_lib.evaluation.matching import best_oks
from hicp_lib.formats.annotations import Annotations


def person_oks(
    annotations: Annotations, detections: Mapping[int, Detections], group: str = "body", **options: Any
) -> pd.DataFrame:
    """OKS of the best-fitting detection for each person who counts, 0 when nobody was found.

    Parameters
    ----------
    annotations : Annotations
        The truth.
    detections : mapping of int to Detections
        By image id.
    group : str
        A key of `OBJECTS`.
    **options : str
        Fields of `Options`.

    Returns
    -------
    DataFrame
        Columns `image_id, annotation_id, oks, n_labelled`.
    """
    objects, chosen = choose(group, options)
    check_detections(detections, annotations)
    people = people_seen(annotations, objects, chosen)
    rows = [
        (people.image_ids[i], people.ids[i], fit, int((people.visibility[i, keypoints] > 0).sum()))
        for keypoints in objects
        for i, fit in best_oks(people, detections, keypoints, SIGMAS[chosen.sigmas][keypoints])
    ]
    types = {"image_id": int, "annotation_id": int, "oks": float, "n_labelled": int}
    return pd.DataFrame(rows, columns=list(types)).astype(types)
