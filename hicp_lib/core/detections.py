"""The interface of every detector: an image in, people in the Halpe-136 layout out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hicp_lib.core.keypoints import N_KEYPOINTS, to_halpe


@dataclass(frozen=True)
class Detections:
    """The people found in one image.

    Attributes
    ----------
    keypoints_px : array, shape (n_persons, 136, 2)
        (u, v) in pixels, pixel centres at integers, origin top-left; NaN where the
        detector gives no such keypoint. Points may lie outside the image.
    scores : array, shape (n_persons, 136)
        Keypoint confidence in [0, 1]; 0 where the keypoint is NaN.
    person_scores : array, shape (n_persons,)
        What people are ranked by in AP.

    Examples
    --------
    >>> nobody = Detections.none()
    >>> len(nobody), nobody.keypoints_px.shape
    (0, (0, 136, 2))
    """

    keypoints_px: np.ndarray
    scores: np.ndarray
    person_scores: np.ndarray

    def __post_init__(self) -> None:
        for name, value in vars(self).items():  # as files have it: new and cached results are equal
            object.__setattr__(self, name, np.asarray(value, float))

    @classmethod
    def none(cls) -> Detections:
        """The result if nobody was found."""
        return cls(np.full((0, N_KEYPOINTS, 2), np.nan), np.zeros((0, N_KEYPOINTS)), np.zeros(0))

    @classmethod
    def of_parts(
        cls, positions_px: np.ndarray, scores: np.ndarray, person_scores: np.ndarray, convention: str
    ) -> Detections:
        """People from the keypoints of a network; those without any keypoint are dropped.

        Parameters
        ----------
        positions_px : array, shape (n, k, 2)
            NaN where not given; the score then becomes 0.
        scores : array, shape (n, k)
            In [0, 1].
        person_scores : array, shape (n,)
            What people are ranked by.
        convention : str
            A key of `hicp_lib.core.keypoints.TO_HALPE`.

        Returns
        -------
        Detections
        """
        scores = np.where(np.isnan(positions_px).any(axis=-1), 0.0, scores)
        given_px, given = to_halpe(positions_px, convention, axis=-2), to_halpe(scores, convention, -1, 0.0)
        is_somebody = np.isfinite(given_px).all(axis=-1).any(axis=-1)
        return cls(given_px[is_somebody], given[is_somebody], np.asarray(person_scores)[is_somebody])

    def concatenate(self, more: Detections) -> Detections:
        """These people, then others in the same image."""
        pairs = zip(vars(self).values(), vars(more).values(), strict=True)
        return Detections(*map(np.concatenate, pairs))

    def take(self, rows: np.ndarray | slice) -> Detections:
        """The people of some rows."""
        return Detections(*(of[rows] for of in vars(self).values()))

    def __len__(self) -> int:
        return len(self.person_scores)


class Detector(Protocol):
    """A keypoint detector, ready to run.

    A detector with a true attribute `takes_boxes` gets the people's boxes, `detect(image, boxes_px)`. A
    detector composed of others has them in a dictionary `parts` and calls them there, so that their results
    can be cached (see `hicp_lib.detectors.runtime.results`). A detector whose first call has to start
    something may offer a method `start()`, which does so in advance.

    Attributes
    ----------
    name : str
        Name of its results.
    settings : dict
        JSON-able (weights' SHA-256, thresholds, versions that matter); identifies its results: two detectors
        with equal name and settings give equal detections.
    """

    name: str
    settings: dict

    def detect(self, image: np.ndarray) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8."""
        ...
