"""The network for close range: 136 keypoints of one person per box, each with whether it is in the picture.

MoveNet Lightning's layers, and a decoder trained on rendered people of development identities, near, cut off
and without heads (`tools/closerange`, which made the file). Each box (by default the whole image) is scaled
to a square, padded with black. The network gives for each keypoint its position in the square, the share of
its map near that position, and the probabilities that it is in the picture and that it is visible.

Hands are small in such a square, so the same network looks at each of them again, in a square of its own.
"""

from pathlib import Path
from typing import Any, Unpack

import cv2
import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import COCO_17
from hicp_lib.detectors.combined.hand_squares import HAND_POINTS
from hicp_lib.detectors.onnx.box_source import BoxOptions, BoxSource
from hicp_lib.detectors.onnx.fitting import Regions
from hicp_lib.detectors.onnx.session import open_committed, open_model

_PRESENT = 0.5
_HAND_SIDE = 2.0  # of a hand's square, in extents of its points; those trained on are 1.3 to 3
_LEAST_PX = 12  # extent of a hand that is looked at again


class CloseRange:
    """The network for close range, on whole people and again on their hands.

    Parameters
    ----------
    model : str or Path, optional
        Another file that `tools/closerange/export.py` wrote.
    padding : float
        Factor by which boxes are enlarged before they become squares.
    look_again : bool
        Whether hands are looked at again.
    **person_boxes : object
        See `hicp_lib.detectors.onnx.box_source.BoxOptions`.
    """

    name = "closerange"

    def __init__(
        self, model: str | Path | None = None, padding: float = 1.0, look_again: bool = True,
        **person_boxes: Unpack[BoxOptions],
    ) -> None:  # fmt: skip
        self._boxes = BoxSource(**person_boxes)
        run = self._boxes.run
        self._model = open_model(model, **run) if model else open_committed(f"{self.name}.onnx", **run)
        self._padding, self._looks_again = padding, look_again
        self.takes_boxes = self._boxes.kind == "gt"
        self.settings: dict[str, Any] = {"padding": padding, "look_again": look_again}
        self.settings |= {"model": self._model.settings, "opencv": cv2.__version__} | self._boxes.settings

    def detect(self, image: np.ndarray, boxes_px: np.ndarray | None = None) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8.

        `boxes_px`, shape (n, 4: x, y, width, height), are used when boxes are "gt".
        """
        boxes, box_scores = self._boxes.find(image, boxes_px)
        found = self._look(image, Regions.around(boxes, self._model.size_px, self._padding))
        there = (found[..., 3] >= _PRESENT).any(axis=1)
        found, box_scores = found[there], box_scores[there]
        if self._looks_again:
            for person in found:
                self._refine_hands(image, person)
        present, near = found[..., 3], found[..., 2]
        # At least a half for what is in the picture; beyond, by how sure its position is.
        scores = np.where(present < _PRESENT, present, _PRESENT + (present - _PRESENT) * near)
        expected = (present * near)[:, COCO_17].sum(axis=1) / present[:, COCO_17].sum(axis=1)
        return Detections.of_parts(found[..., :2], scores, box_scores * expected, "halpe136")

    def _look(self, image: np.ndarray, regions: Regions) -> np.ndarray:
        """Per region and keypoint x, y in the image, share near it, in the picture, visible; (n, 136, 5)."""
        size_px = self._model.size_px
        runs = [self._model.run(cv2.dnn.blobFromImage(crop))[0] for crop in regions.crop(image, size_px)]
        found = np.concatenate([np.zeros((0, 136, 5)), *runs])
        found[..., :2] = regions.to_image_px(found[..., :2], size_px)
        return found

    def _refine_hands(self, image: np.ndarray, person: np.ndarray) -> None:
        """Replace the points of a person's hands (136, 5) by those of a closer look."""
        for points in HAND_POINTS:
            hand = person[points]
            if (hand[:, 3] >= _PRESENT).mean() < _PRESENT:
                continue
            low, high = hand[:, :2].min(axis=0), hand[:, :2].max(axis=0)
            side_px = _HAND_SIDE * (high - low).max()
            if side_px < _HAND_SIDE * _LEAST_PX:
                continue
            centre = (low + high) / 2
            box = np.array([[*(centre - side_px / 2), side_px, side_px]])
            again = self._look(image, Regions.around(box, self._model.size_px, 1.0))[0]
            person[points, :3] = again[points, :3]
