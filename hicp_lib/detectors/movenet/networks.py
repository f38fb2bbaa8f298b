"""MoveNet's networks: Thunder and Lightning, top-down, one pose per box; MultiPose, bottom-up.

Each box (by default the whole image) is scaled to a square of the network's side, padded with black. The
network decodes itself: y, x (as fractions of the square) and score of COCO's 17 keypoints, of the person
nearest to the square's middle. `tools/bake_tfjs.py` made its files.

MultiPose finds up to six people in a whole image, without a person finder. The image is fitted into a square
padded with black; the network gives six rows of 17 keypoints in the same form, then a box, and the person's
score.
"""

from typing import Any, Unpack

import cv2
import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.detectors.onnx.box_source import BoxOptions, BoxSource
from hicp_lib.detectors.onnx.fitting import Regions, letterbox
from hicp_lib.detectors.onnx.session import RunOptions, open_committed

_FILL = (0, 0, 0)


class MoveNetThunder:
    """MoveNet Thunder: 17 body points of one person per box.

    Parameters
    ----------
    padding : float
        Factor by which boxes are enlarged before they become squares. Of 1.0, 1.1, 1.25 and 1.5, 1.0 was best
        on development identities (seed 11, 100 scenes), by .01 AP on Basic and .05 on Headless.
    **person_boxes : object
        See `hicp_lib.detectors.onnx.box_source.BoxOptions`.
    """

    name = "movenet-thunder"

    def __init__(self, padding: float = 1.0, **person_boxes: Unpack[BoxOptions]) -> None:
        self._boxes = BoxSource(**person_boxes)
        self._model = open_committed(f"{self.name}.onnx", **self._boxes.run)
        self._padding = padding
        self.takes_boxes = self._boxes.kind == "gt"
        self.settings: dict[str, Any] = {"padding": padding, "model": self._model.settings}
        self.settings |= {"opencv": cv2.__version__} | self._boxes.settings

    def detect(self, image: np.ndarray, boxes_px: np.ndarray | None = None) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8.

        `boxes_px`, shape (n, 4: x, y, width, height), are used when boxes are "gt".
        """
        boxes, box_scores = self._boxes.find(image, boxes_px)
        size_px = self._model.size_px
        regions = Regions.around(boxes, size_px, self._padding)
        rows = np.array([self.poses(crop) for crop in regions.crop(image, size_px)]).reshape(-1, 17, 3)
        positions_px, scores = regions.to_image_px(rows[..., 1::-1], (1, 1)), np.clip(rows[..., 2], 0, 1)
        return Detections.of_parts(positions_px, scores, box_scores * scores.mean(axis=1), "coco17")

    def poses(self, crop: np.ndarray) -> np.ndarray:
        """Run the network on one RGB square: y, x, score of 17 keypoints, shape (17, 3)."""
        (rows,) = self._model.run(cv2.dnn.blobFromImage(crop))
        return rows[0, 0]


class MoveNetLightning(MoveNetThunder):
    """MoveNet Lightning: smaller than Thunder, with the backbone of MoveNet MultiPose."""

    name = "movenet-lightning"


class MoveNetMultiPose:
    """MoveNet MultiPose Lightning: 17 body points of up to six people.

    Parameters
    ----------
    min_person_score : float
        People with a lower score are dropped; the network always gives six rows.
    **run : object
        See `hicp_lib.detectors.onnx.session.RunOptions`.
    """

    name = "movenet-multipose"

    def __init__(self, min_person_score: float = 0.1, **run: Unpack[RunOptions]) -> None:
        self._model = open_committed(f"{self.name}.onnx", **run)
        self._min_person_score = min_person_score
        self.settings = {"min_person_score": min_person_score, "opencv": cv2.__version__}
        self.settings["model"] = self._model.settings

    def detect(self, image: np.ndarray) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8."""
        fitted = letterbox(image, self._model.size_px, _FILL)
        (rows,) = self._model.run(cv2.dnn.blobFromImage(fitted.pixels))
        people = rows[0][rows[0, :, 55] >= self._min_person_score].astype(float)
        keypoints = people[:, :51].reshape(-1, 17, 3)
        positions_px = fitted.to_image_px(keypoints[..., 1::-1] * self._model.size_px)
        scores = np.clip(keypoints[..., 2], 0, 1)
        return Detections.of_parts(positions_px, scores, np.clip(people[:, 55], 0, 1), "coco17")
