"""MoveNet MultiPose, bottom-up: up to six people of a whole image, without anyone looking for them first.

The image is fitted into a square, black below or beside it. The network decodes itself: six rows of y, x
(as fractions of the square) and score of COCO's 17 keypoints, then a box, and the person's score.
`tools/bake_tfjs.py` made its file.
"""

import cv2
import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.detectors.onnx.letterbox import letterbox
from hicp_lib.detectors.onnx.session import open_committed

_FILL = (0, 0, 0)


class MoveNetMultiPose:
    """MoveNet MultiPose Lightning: 17 body points of up to six people.

    Parameters
    ----------
    min_person_score : float
        People below are not given; the network always gives six rows.
    provider : str
    threads : int
        See `hicp_lib.detectors.onnx.session.open_model`.
    """

    name = "movenet-multipose"

    def __init__(self, min_person_score: float = 0.1, provider: str = "cpu", threads: int = 1) -> None:
        self._model = open_committed(f"{self.name}.onnx", provider, threads)
        self._side_px, self._min_person_score = self._model.side_px, min_person_score
        self.settings = {"min_person_score": min_person_score, "opencv": cv2.__version__}
        self.settings["model"] = self._model.settings

    def detect(self, image: np.ndarray) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8."""
        fitted = letterbox(image, (self._side_px, self._side_px), _FILL)
        (rows,) = self._model.run(cv2.dnn.blobFromImage(fitted.pixels))
        people = rows[0][rows[0, :, 55] >= self._min_person_score].astype(float)
        keypoints = people[:, :51].reshape(-1, 17, 3)
        positions_px = fitted.to_image_px(keypoints[..., 1::-1] * self._side_px)
        return Detections.of_parts(
            positions_px, np.clip(keypoints[..., 2], 0, 1), np.clip(people[:, 55], 0, 1), "coco17"
        )
