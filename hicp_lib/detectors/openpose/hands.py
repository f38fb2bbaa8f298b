"""OpenPose's hand network on the user's weights, run at the arms of detected people.

A hand is searched for in a square around the point a third of the forearm beyond the wrist (Simon et al.,
"Hand keypoint detection in single images using multiview bootstrapping", CVPR 2017), mirrored for left hands,
since the network is trained on right hands.
"""

from pathlib import Path
from typing import Unpack

import cv2
import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.detectors.combined.hand_squares import HAND_POINTS, Arms, SquareRule
from hicp_lib.detectors.onnx.session import RunOptions, open_model
from hicp_lib.detectors.openpose.paf import STRIDE
from hicp_lib.detectors.openpose.released import enlarge, feed

_HAND_SIDE_PX, _N_HAND = 368, 21
# Position and size of a hand's square, in lengths of the forearm; smaller squares are skipped.
_SQUARES = SquareRule(side=1.5, forearms_per_shoulders=0.0, min_score=0.03)
_MIN_AREA_PX2 = 10.0


class OpenPoseHands:
    """OpenPose's hand network: 21 points of a right hand in a square crop."""

    def __init__(self, model: str | Path, **run: Unpack[RunOptions]) -> None:
        self._model = open_model(model, **run)
        width, height = self._model.size_px
        if height != width:
            raise self._model.refusal(f"takes images of {width} x {height}; expected squares, of hands")
        self._side_px = height or _HAND_SIDE_PX
        self.settings = self._model.settings
        self._maps(self._model.response_to_zeros(self._side_px, self._side_px))

    def complete(self, image: np.ndarray, people: Detections) -> Detections:
        """The people with the hands found at their arms; arms without shoulder, elbow or wrist get none."""
        keypoints_px, scores = people.keypoints_px.copy(), people.scores.copy()
        arms = Arms.of(people, _SQUARES)
        sides_px = _SQUARES.side * np.where(arms.are_whole, arms.scales_px, 0)
        corners_px = arms.hands_px(_SQUARES) - sides_px[..., None] / 2
        for person, side in np.argwhere(sides_px**2 > _MIN_AREA_PX2):
            square = corners_px[person, side], sides_px[person, side]
            points_px, found = self.find(image, *square, is_left=side == 0)
            keypoints_px[person, HAND_POINTS[side]], scores[person, HAND_POINTS[side]] = points_px, found
        return Detections(keypoints_px, scores, people.person_scores)

    def find(
        self, image: np.ndarray, corner_px: np.ndarray, side_px: float, is_left: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """The points of the hand in a square.

        Parameters
        ----------
        image : array, shape (height, width, 3), dtype uint8
            RGB.
        corner_px : array, shape (2,)
            Top left of the square.
        side_px : float
        is_left : bool
            Whether to mirror it.

        Returns
        -------
        points_px : array, shape (21, 2)
            In the image; NaN where not found.
        scores : array, shape (21,)
        """
        zoom = side_px / self._side_px
        x0, step = (corner_px[0] + side_px, -zoom) if is_left else (corner_px[0], zoom)
        to_image = np.array([[step, 0, x0], [0, zoom, corner_px[1]]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        crop = cv2.warpAffine(image, to_image, (self._side_px, self._side_px), flags=flags)
        maps = self._maps(self._model.run(feed(crop)))
        large = enlarge(maps[:_N_HAND], STRIDE).reshape(_N_HAND, -1)
        y, x = np.divmod(large.argmax(axis=1), self._side_px)
        scores = np.clip(np.nan_to_num(large.max(axis=1).astype(float)), 0, 1)
        points = np.stack([x, y], axis=1) @ to_image[:, :2].T + to_image[:, 2]
        return np.where(scores[:, None] > 0, points, np.nan), scores

    def _maps(self, outputs: list[np.ndarray]) -> np.ndarray:
        cells, maps = self._side_px // STRIDE, outputs[0]
        if maps.ndim != 4 or maps.shape[1] < _N_HAND or maps.shape[2:] != (cells, cells):
            raise self._model.refusal(f"expected hands' (1, {_N_HAND + 1}, {cells}, {cells})", outputs)
        return maps[0]
