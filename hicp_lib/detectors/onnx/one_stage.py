"""Networks that find people and their keypoints in one pass, with the decoding inside the file.

RTMO (Lu et al., "RTMO", CVPR 2024) takes the image in the input's top-left corner, BGR 0-255, and gives boxes
with scores and keypoints. YOLO-pose (Maji et al., CVPR workshops 2022, as Ultralytics exports it) takes it
centred, RGB 0-1, and gives rows of box, score and keypoints, without suppression (centre and size, one column
per row) or after it (corners, and the class behind the score). The padding value is 114.
"""

from pathlib import Path
from typing import Unpack

import cv2
import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.detectors.onnx.decode import given
from hicp_lib.detectors.onnx.fitting import letterbox
from hicp_lib.detectors.onnx.person_boxes import DEFAULT_SIDE_PX, FILL, N_BOX, unsuppressed
from hicp_lib.detectors.onnx.session import Fact, RunOptions, facts, open_model
from hicp_lib.detectors.onnx.top_down import CONVENTIONS, convention_of

_N_COLUMNS = {N_BOX + 3 * n_keypoints for n_keypoints in CONVENTIONS}


class OneStage:
    """RTMO or YOLO-pose on the user's own weights.

    Parameters
    ----------
    model : str or Path
        ONNX export with the decoding inside.
    min_score : float
        Minimum score of a person.
    max_overlap : float
        Maximum intersection over union of two people's boxes.
    **run : object
        See `hicp_lib.detectors.onnx.session.RunOptions`.
    """

    name = "one-stage"

    def __init__(
        self, model: str | Path, min_score: float = 0.1, max_overlap: float = 0.65, **run: Unpack[RunOptions]
    ) -> None:
        self._model = open_model(model, **run)
        self._min_score, self._max_overlap = min_score, max_overlap
        width, height = self._model.size_px
        match self._model.told.metadata.get("imgsz"):  # Ultralytics' name of the exported task
            case [int(open_height), int(open_width)]:
                self._size_px = width or open_width, height or open_height
            case _:
                self._size_px = width or DEFAULT_SIDE_PX, height or DEFAULT_SIDE_PX
        outputs = self._model.response_to_zeros(*self._size_px[::-1])
        self._is_rtmo = len(outputs) > 1
        self._convention = convention_of(self._model, self._read(outputs)[1].shape[1], outputs)
        self.settings = {"model": self._model.settings, "min_score": min_score, "max_overlap": max_overlap}

    def detect(self, image: np.ndarray) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8."""
        fitted = letterbox(image, self._size_px, FILL, is_centred=not self._is_rtmo)
        feed = cv2.dnn.blobFromImage(fitted.pixels, 1 if self._is_rtmo else 1 / 255, swapRB=self._is_rtmo)
        boxes, keypoints = self._read(self._model.run(feed))
        keep = np.flatnonzero(boxes[:, 4] >= self._min_score)
        keep = keep[unsuppressed(boxes[keep, :4], boxes[keep, 4], self._max_overlap)]
        # Both families measure from the corners of the input and of the image, not from pixel centres.
        positions_px = fitted.to_image_px(keypoints[keep, :, :2] - 0.5) + 0.5
        positions_px, scores = given(positions_px, np.clip(np.nan_to_num(keypoints[keep, :, 2]), 0, 1))
        return Detections.of_parts(positions_px, scores, boxes[keep, 4], self._convention)

    def describe(self) -> list[Fact]:
        """What is assumed about the model."""
        family = "RTMO" if self._is_rtmo else "YOLO-pose"
        own = facts(family, size_px=self._size_px, convention=self._convention, **self.settings)
        return [*self._model.describe(), *own]

    def _read(self, outputs: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Corners and score (n, 5) and keypoints with scores (n, k, 3), in input pixels."""
        match [output.shape for output in outputs]:
            case [(1, n, 5), (1, m, _, 3)] if n == m:
                return outputs[0][0].astype(float), outputs[1][0].astype(float)
            case [(1, n_columns, _)] if n_columns in _N_COLUMNS:
                rows = outputs[0][0].T.astype(float)
                half = rows[:, 2:4] / 2
                corners = np.concatenate([rows[:, :2] - half, rows[:, :2] + half, rows[:, 4:5]], axis=1)
                return corners, rows[:, N_BOX:].reshape(len(rows), -1, 3)
            case [(1, _, n_columns)] if n_columns - 1 in _N_COLUMNS:
                rows = outputs[0][0].astype(float)
                return rows[:, :N_BOX], rows[:, N_BOX + 1 :].reshape(len(rows), -1, 3)
        raise self._model.refusal("expected RTMO's or YOLO-pose's outputs, of one class", outputs)
