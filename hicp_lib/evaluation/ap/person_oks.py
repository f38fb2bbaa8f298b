"""How well each person is found: the OKS of the best detection."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import SIGMAS
from hicp_lib.core.oks import oks
from hicp_lib.evaluation.ap.evaluate import in_parts, people_seen
from hicp_lib.evaluation.ap.options import choose
from hicp_lib.formats.annotations import Annotations, rows_by_image


class PersonOks:
    """The best OKS of each person, of detections that come some at a time.

    Parameters
    ----------
    annotations : Annotations
        The truth.
    group : str
        A key of `OBJECTS`.
    **options : str
        Fields of `Options`.
    """

    def __init__(self, annotations: Annotations, group: str = "body", **options: Any) -> None:
        self._objects, chosen = choose(group, options)
        self._annotations, self._sigmas = annotations, SIGMAS[chosen.sigmas]
        self._rows, flags, self._areas_px2 = people_seen(annotations, self._objects, chosen)
        self._labelled = flags > 0
        self._counts = self._labelled.any(axis=-1) & ~annotations.is_crowd[self._rows, None]
        self._best = np.zeros(self._counts.shape)  # of each object of a person
        self._of_image = rows_by_image(annotations.image_ids[self._rows])

    def add(self, image_ids: np.ndarray, found: Detections) -> None:
        """Add detections, as to `evaluate.Evaluator`."""
        people = self._annotations
        for image_id, chosen in rows_by_image(image_ids).items():
            points_px = found.keypoints_px[chosen]
            for i in self._of_image.get(image_id, ()):
                row = self._rows[i]
                for k in np.flatnonzero(self._counts[i]):
                    keypoints = self._objects[k]
                    fits = oks(
                        people.keypoints_px[row, keypoints], self._labelled[i, k], people.boxes_px[row],
                        self._areas_px2[i], points_px[:, keypoints], self._sigmas[keypoints],
                    )  # fmt: skip
                    self._best[i, k] = fits.max(initial=self._best[i, k])

    def table(self) -> pd.DataFrame:
        """What `person_oks` returns."""
        k, i = np.nonzero(self._counts.T)
        row, people = self._rows[i], self._annotations
        columns = {"image_id": people.image_ids[row], "annotation_id": people.ids[row]}
        n_labelled = self._labelled[i, k].sum(axis=-1)
        return pd.DataFrame(columns | {"oks": self._best[i, k], "n_labelled": n_labelled})


def person_oks(
    annotations: Annotations, detections: Mapping[int, Detections], group: str = "body", **options: Any
) -> pd.DataFrame:
    """OKS of the best detection of each evaluated person, 0 if there is none.

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
        Columns `image_id, annotation_id, oks, n_labelled`; of single hands, the left ones first.
    """
    best = PersonOks(annotations, group, **options)
    for image_ids, found in in_parts(detections, annotations):
        best.add(image_ids, found)
    return best.table()
