"""Person boxes by YOLOX and RTMDet, for the networks that take one person at a time.

The image is fitted into the input's top-left corner, the rest filled with 114, in BGR order:
YOLOX takes it as it is (0-255), RTMDet normalised. Exports with non-maximum suppression inside
return `dets` (x1, y1, x2, y2, score) and mostly `labels`; those without return one row per cell
of the grids of stride 8, 16 and 32 (Ge et al., "YOLOX", 2021).
"""

from pathlib import Path

import cv2
import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.detectors.onnx.facts import Fact
from hicp_lib.detectors.onnx.letterbox import letterbox, planes
from hicp_lib.detectors.onnx.session import open_model

_FILL = (114, 114, 114)
_NORMALISATIONS = {
    "yolox": ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)),
    "rtmdet": ((103.53, 116.28, 123.675), (57.375, 57.12, 58.395)),
}
_STRIDES = (8, 16, 32)
_PERSON = 0
# YOLOX begins by folding 2 x 2 pixels into channels.
_FOLDED_CHANNELS = 12
_DEFAULT_SIDE_PX = 640
# Boxes that are kept; the overlap counts only where the export does no suppression itself.
_MIN_SCORE, _MAX_OVERLAP = 0.3, 0.45
# exp() of more is no size of a box
_MAX_LOG_SIZE = 20


class PersonBoxes:
    """A person (or hand) detector, YOLOX or RTMDet as its first convolution tells.

    Parameters
    ----------
    model : str or Path
        ONNX export.
    provider : str
    threads : int
        See `hicp_lib.detectors.onnx.session.open_model`.
    """

    def __init__(self, model: str | Path, provider: str = "cpu", threads: int = 1) -> None:
        self._model = open_model(model, provider, threads)
        folds = self._model.first_convolution_channels == _FOLDED_CHANNELS
        self._family = "yolox" if folds else "rtmdet"
        own = {"family": self._family, "min_score": _MIN_SCORE, "max_overlap": _MAX_OVERLAP}
        self.settings = own | self._model.settings
        height, width = self._model.image_size_px
        self._size_px = width or _DEFAULT_SIDE_PX, height or _DEFAULT_SIDE_PX

    def find(self, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """People in an RGB image (height, width, 3): boxes (n, 4: x, y, width, height) and scores (n,)."""
        fitted = letterbox(image, self._size_px, _FILL)
        feed = np.empty((1, 3, self._size_px[1], self._size_px[0]), np.float32)
        planes(fitted.pixels[..., ::-1], *_NORMALISATIONS[self._family], out=feed[0])
        corners, scores = self._read(self._model.run(feed))
        keep = (scores >= _MIN_SCORE) & np.isfinite(corners).all(axis=1)
        corners = (corners[keep] / np.tile(fitted.scale, 2)).clip(0, np.tile(image.shape[1::-1], 2))
        boxes = _boxes(corners)
        is_box = (boxes[:, 2:] > 0).all(axis=1)
        return boxes[is_box], scores[keep][is_box]

    def describe(self) -> list[Fact]:
        """What is taken for granted about the model."""
        width, height = self._size_px
        return [
            Fact("person detector", self._family, "read from the first convolution"),
            Fact("person input", f"{width} x {height}, BGR, top-left, filled with 114", "read from the file"),
            Fact("person score", f">= {_MIN_SCORE}",
                 f"overlaps above {_MAX_OVERLAP} are suppressed where the export does not do it"),
        ]  # fmt: skip

    def _read(self, outputs: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Corners (n, 4) and scores (n,) of people, in input pixels."""
        rows = next((output for output in outputs if output.ndim == 3 and len(output) == 1), None)
        if rows is not None and rows.shape[2] == 5:
            return _suppressed(rows[0], outputs)
        if rows is not None and rows.shape[2] > 5:
            return _suppress(*_from_grid(rows[0], self._size_px, self._model.path))
        expected = "(1, n, 5) boxes with scores, or YOLOX's (1, cells, 5 + classes)"
        raise self._model.unexpected(outputs, expected)


def _suppress(corners: np.ndarray, scores: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    corners, scores = corners[scores >= _MIN_SCORE], scores[scores >= _MIN_SCORE]
    rows = cv2.dnn.NMSBoxes(_boxes(corners).tolist(), scores.tolist(), _MIN_SCORE, _MAX_OVERLAP)
    keep = np.asarray(rows, int).reshape(-1)
    return corners[keep], scores[keep]


def _boxes(corners: np.ndarray) -> np.ndarray:
    """Boxes (n, 4: x, y, width, height) of corners (n, 4: left, top, right, bottom)."""
    return np.concatenate([corners[:, :2], corners[:, 2:] - corners[:, :2]], axis=1)


def _suppressed(rows: np.ndarray, outputs: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Rows x1, y1, x2, y2, score of an export that did its own suppression; people only, if labelled."""
    labels = next((output for output in outputs if output.shape == (1, len(rows))), None)
    people = rows if labels is None else rows[labels[0] == _PERSON]
    return people[:, :4].astype(float), people[:, 4].astype(float)


def _from_grid(rows: np.ndarray, size_px: tuple[int, int], path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Corners and scores from YOLOX's raw rows: offset in the cell, log size, object and class scores."""
    shapes = [(size_px[1] // stride, size_px[0] // stride) for stride in _STRIDES]
    cell = np.concatenate([np.argwhere(np.ones(shape))[:, ::-1] for shape in shapes])
    stride = np.repeat(_STRIDES, np.prod(shapes, axis=1))[:, None]
    if len(rows) != len(cell):
        raise InputError(
            f"{path}: gives {len(rows)} rows for an input of {size_px[0]} x {size_px[1]}; expected the "
            f"{len(cell)} of YOLOX's strides 8, 16 and 32"
        )
    rows = rows.astype(float)
    centre = (rows[:, :2] + cell) * stride
    half = np.exp(np.minimum(rows[:, 2:4], _MAX_LOG_SIZE)) * stride / 2
    scores = rows[:, 4] * rows[:, 5 + _PERSON]
    return np.concatenate([centre - half, centre + half], axis=1), np.where(np.isfinite(scores), scores, 0.0)
