"""The person finder that comes with the library: NanoDet-g, trained on COCO, of which only people are kept.

(R. Lyu, github.com/RangiLyu/nanodet.) The image is fitted into the centre of the input, in BGR, normalised.
Each cell of three grids gives the scores of 80 classes and, for each side of the box, the probabilities that
it is 0, 1, ... or 10 strides away (Li et al., "Generalized focal loss", NeurIPS 2020). `tools/bake_tfjs.py`
made its file.
"""

import numpy as np

from hicp_lib.detectors.onnx.affine import Regions
from hicp_lib.detectors.onnx.facts import Fact, facts
from hicp_lib.detectors.onnx.letterbox import IMAGENET_BGR, blob
from hicp_lib.detectors.onnx.person_boxes import unsuppressed
from hicp_lib.detectors.onnx.session import open_committed

FILE = "nanodet.onnx"
_STRIDES_PX = (8, 16, 32)
_PERSON, _N_BINS = 0, 11


class NanoDet:
    """A person finder that needs no user file.

    Parameters
    ----------
    min_score : float
        For development identities in 100 rendered scenes (seed 11), 0.3 finds 91 % of people (at an
        intersection over union of .5) with 7 % false boxes; 0.2 finds 95 % with 22 % false boxes.
    max_overlap : float
        Of two boxes that overlap more (intersection over union), the one with the higher score is kept.
    provider : str
    threads : int
        See `hicp_lib.detectors.onnx.session.open_model`.
    """

    def __init__(
        self, min_score: float = 0.3, max_overlap: float = 0.6, provider: str = "cpu", threads: int = 1
    ) -> None:
        self._model = open_committed(FILE, provider, threads)
        self._side_px = self._model.side_px
        self._min_score, self._max_overlap = min_score, max_overlap
        self.settings = {"min_score": min_score, "max_overlap": max_overlap} | self._model.settings

    def find(self, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """People in an RGB image (height, width, 3): boxes (n, 4: x, y, width, height) and scores (n,)."""
        size_px = self._side_px, self._side_px
        whole = Regions.whole(image, size_px)
        feed = blob(whole.crop(image, size_px), *IMAGENET_BGR, is_bgr=True)
        corners, scores = self._read(self._model.run_named(feed))
        ends_px = whole.to_image_px(corners.reshape(1, -1, 2), size_px)[0].clip(0, image.shape[1::-1])
        corners_px = ends_px.reshape(-1, 4)
        is_box = (corners_px[:, 2:] > corners_px[:, :2]).all(axis=1)
        corners_px, scores = corners_px[is_box], scores[is_box]
        rest = unsuppressed(corners_px, scores, self._max_overlap)
        corners_px, scores = corners_px[rest], scores[rest]
        return np.concatenate([corners_px[:, :2], corners_px[:, 2:] - corners_px[:, :2]], axis=1), scores

    def describe(self) -> list[Fact]:
        """What it is, and what it keeps."""
        return facts("nanodet", **self.settings)

    def _read(self, outputs: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Corners (n, 2, 2: left-top, right-bottom; x, y) and scores (n,), in input pixels."""
        corners, scores = [], []
        for stride_px in _STRIDES_PX:
            of_people = outputs[f"scores_{stride_px}"][0, :, _PERSON]
            cells = np.flatnonzero(of_people >= self._min_score)
            bins = outputs[f"sides_{stride_px}"][0][cells].astype(float).reshape(-1, 4, _N_BINS)
            likely = np.exp(bins - bins.max(axis=-1, keepdims=True))
            sides_px = stride_px * (likely @ np.arange(_N_BINS)) / likely.sum(axis=-1)
            columns = self._side_px // stride_px
            middle_px = (np.stack([cells % columns, cells // columns], axis=1) + 0.5) * stride_px
            corners.append(np.stack([middle_px - sides_px[:, :2], middle_px + sides_px[:, 2:]], axis=1))
            scores.append(of_people[cells].astype(float))
        return np.concatenate(corners), np.concatenate(scores)
