"""Person boxes by YOLOX and RTMDet, for networks that process one person at a time.

The image is fitted into the input's top-left corner, padded with 114, in BGR order: YOLOX takes values 0-255,
RTMDet normalised ones. Exports with non-maximum suppression inside return `dets` (x1, y1, x2, y2, score) and
usually `labels`; those without return one row per cell of the grids of stride 8, 16 and 32 (Ge et al.,
"YOLOX", 2021), decoded or not. As in YOLOX's own demonstration a box of any class suppresses overlapping
boxes with lower scores, and boxes may reach beyond the image.
"""

from pathlib import Path
from typing import Unpack

import numpy as np

from hicp_lib.core.errors import refuse_unknown
from hicp_lib.detectors.onnx.fitting import IMAGENET_BGR, blob, letterbox
from hicp_lib.detectors.onnx.session import Fact, RunOptions, facts, open_model

FILL = (114, 114, 114)
_NORMALISATIONS = {"yolox": ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), "rtmdet": IMAGENET_BGR}
_STRIDES = (8, 16, 32)
_PERSON = 0
# YOLOX begins by folding 2 x 2 pixels into channels.
_FOLDED_CHANNELS = 12
DEFAULT_SIDE_PX = 640
# exp() of more is not a plausible size of a box
_MAX_LOG_SIZE = 20
# x, y, size and score
N_BOX = 5


class PersonBoxes:
    """A person (or hand) detector, YOLOX or RTMDet.

    Parameters
    ----------
    model : str or Path
        ONNX export.
    family : str, optional
        "yolox" or "rtmdet"; detected from the first convolution if None.
    min_score : float
        Minimum score of a box.
    max_overlap : float
        Maximum intersection over union of two boxes, if the export does no suppression itself.
    **run : object
        See `hicp_lib.detectors.onnx.session.RunOptions`.
    """

    def __init__(
        self,
        model: str | Path,
        family: str | None = None,
        min_score: float = 0.3,
        max_overlap: float = 0.45,
        **run: Unpack[RunOptions],
    ) -> None:
        self._model = open_model(model, **run)
        folds = self._model.told.first_convolution[1:2] == (_FOLDED_CHANNELS,)
        self._is_told = family is None
        self._family = family or ("yolox" if folds else "rtmdet")
        refuse_unknown("person_family", self._family, _NORMALISATIONS)
        self._min_score, self._max_overlap = min_score, max_overlap
        width, height = self._model.size_px
        self._size_px = width or DEFAULT_SIDE_PX, height or DEFAULT_SIDE_PX
        self._cells = _cells(self._size_px)
        rows = self._rows(self._model.response_to_zeros(*self._size_px[::-1]))
        self._is_decoded = rows.shape[1] > N_BOX and _is_decoded(rows, self._cells)
        own = {"family": self._family, "min_score": min_score, "max_overlap": max_overlap}
        self.settings = own | {"decoded": self._is_decoded} | self._model.settings

    def find(self, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """People in an RGB image (height, width, 3): boxes (n, 4: x, y, width, height) and scores (n,)."""
        fitted = letterbox(image, self._size_px, FILL)
        outputs = self._model.run(blob([fitted.pixels], *_NORMALISATIONS[self._family], is_bgr=True))
        rows = self._rows(outputs)
        is_suppressed = rows.shape[1] == N_BOX
        corners, scores, labels = _listed(rows, outputs) if is_suppressed else self._from_grid(rows)
        keep = np.flatnonzero((scores >= self._min_score) & are_boxes(corners))
        corners = corners / np.tile(fitted.scale, 2)
        if not is_suppressed:
            keep = keep[unsuppressed(corners[keep], scores[keep], self._max_overlap, side_px=1.0)]
        keep = keep[labels[keep] == _PERSON]
        return with_sizes(corners[keep]), scores[keep]

    def describe(self) -> list[Fact]:
        """What is assumed about the model."""
        told = "read from the first convolution" if self._is_told else "given"
        boxes = "decoded" if self._is_decoded else "as the network gives them"
        return facts("person models", told=told, size_px=self._size_px, boxes=boxes, **self.settings)

    def _rows(self, outputs: list[np.ndarray]) -> np.ndarray:
        """Rows (n, 5) of an export that does its own suppression, or YOLOX's (cells, 5 + classes)."""
        tables = [output for output in outputs if output.ndim == 3]
        rows = tables[0][0] if len(tables) == 1 and len(tables[0]) == 1 else np.empty((0, 0))
        n_columns = rows.shape[1]
        if n_columns < N_BOX or n_columns > N_BOX and len(rows) != len(self._cells):
            size = "{} x {}".format(*self._size_px)
            raise self._model.refusal(
                f"expected (1, n, 5) boxes with scores, or (1, {len(self._cells)}, 5 + classes) of YOLOX's "
                f"strides 8, 16 and 32 in {size}", outputs
            )  # fmt: skip
        return rows

    def _from_grid(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Corners, scores and classes of YOLOX's rows: centre, size, object and class scores."""
        centre, size = rows[:, :2].astype(float), rows[:, 2:4].astype(float)
        if not self._is_decoded:
            stride = self._cells[:, 2:]
            centre = (centre + self._cells[:, :2]) * stride
            size = np.exp(np.minimum(size, _MAX_LOG_SIZE)) * stride
        labels = rows[:, N_BOX:].argmax(axis=1)
        scores = rows[:, 4].astype(float) * rows[:, N_BOX:].max(axis=1)
        scores = np.where(np.isfinite(scores), scores, 0.0)
        return np.concatenate([centre - size / 2, centre + size / 2], axis=1), scores, labels


def are_boxes(corners: np.ndarray) -> np.ndarray:
    """Whether corners (n, 4: left, top, right, bottom) are finite and in this order, shape (n,)."""
    return np.isfinite(corners).all(axis=1) & (corners[:, 2:] > corners[:, :2]).all(axis=1)


def with_sizes(corners: np.ndarray) -> np.ndarray:
    """Boxes (n, 4: x, y, width, height) from their corners (n, 4: left, top, right, bottom)."""
    return np.concatenate([corners[:, :2], corners[:, 2:] - corners[:, :2]], axis=1)


def unsuppressed(
    corners: np.ndarray, scores: np.ndarray, max_overlap: float, side_px: float = 0.0
) -> np.ndarray:
    """Rows of the boxes that remain after non-maximum suppression, best first.

    Parameters
    ----------
    corners : array, shape (n, 4: left, top, right, bottom)
    scores : array, shape (n,)
    max_overlap : float
        Maximum intersection over union of two boxes.
    side_px : float
        Added to the difference of the corners for a box's width and height.

    Returns
    -------
    array of int, shape (m,)

    Examples
    --------
    >>> boxes = np.array([[0, 0, 10, 10], [0, 0, 10, 11], [20, 0, 30, 10]])
    >>> unsuppressed(boxes, np.array([0.8, 0.9, 0.1]), 0.5).tolist()
    [1, 2]
    """
    areas = np.prod(corners[:, 2:] - corners[:, :2] + side_px, axis=1)
    left, keep = np.argsort(-scores, kind="stable"), []
    while len(left):
        best, left = left[0], left[1:]
        keep.append(best)
        low = np.maximum(corners[best, :2], corners[left, :2])
        high = np.minimum(corners[best, 2:], corners[left, 2:])
        common = np.maximum(high - low + side_px, 0).prod(axis=1)
        left = left[common <= max_overlap * (areas[best] + areas[left] - common)]
    return np.array(keep, int)


def _listed(rows: np.ndarray, outputs: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners, scores and classes of an export with its own suppression; people, if unlabelled."""
    none = np.full((1, len(rows)), _PERSON)
    labels = next((output for output in outputs if output.shape == (1, len(rows))), none)
    return rows[:, :4].astype(float), rows[:, 4].astype(float), labels[0]


def _cells(size_px: tuple[int, int]) -> np.ndarray:
    """Column, row and stride (n, 3) of the grids' cells, in the order of YOLOX's rows."""
    grids = [
        np.pad(np.argwhere(np.ones((size_px[1] // stride, size_px[0] // stride)))[:, ::-1], ((0, 0), (0, 1)),
               constant_values=stride)
        for stride in _STRIDES
    ]  # fmt: skip
    return np.concatenate(grids)


def _is_decoded(rows: np.ndarray, cells: np.ndarray) -> bool:
    """Whether centres lie near their cells in pixels; those not decoded yet lie near 0, in cells."""
    decoded = np.abs(rows[:, :2] / cells[:, 2:] - cells[:, :2] - 0.5)
    return bool(np.median(decoded) < np.median(np.abs(rows[:, :2] - 0.5)))
