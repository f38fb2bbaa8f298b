"""A detector that keeps what it found in every array of pixels, so that others made of it share the work."""

from __future__ import annotations

import numpy as np

from hicp_lib.detectors.base import Detections, Detector
from hicp_lib.detectors.cache import Timed, cache_folder, read_result, result_path_of_pixels, write_result


class Kept:
    """Another detector's results, from disk where the same pixels were looked at before.

    Variants of a combination look at mostly the same squares of the same images; each is looked at once.
    What a call took then says nothing about the detector.
    """

    def __init__(self, detector: Detector) -> None:
        self._detector, self._folder = detector, cache_folder(detector)
        self.name, self.settings = detector.name, detector.settings
        self.takes_boxes = getattr(detector, "takes_boxes", False)

    def detect(self, image: np.ndarray, *boxes_px: np.ndarray) -> Detections:
        """As the detector's own."""
        path = result_path_of_pixels(self._folder, image, *boxes_px)
        result = read_result(path)
        if result is None:
            result = Timed(self._detector.detect(image, *boxes_px), 0.0, 1)
            write_result(path, result)
        return result.detections
