"""The network for close range: 136 keypoints of one person per box, each with whether it is in the picture.

MoveNet Lightning's layers, and a decoder trained on rendered people of development identities, near, cut off
and without heads (`tools/closerange`, which made the file). Each box (by default the whole image) is scaled
to a square, padded with black. The network gives for each keypoint its position in the square, the term of
OKS to expect there, and the probabilities that it is in the picture and that it is visible.

Hands are small in such a square, so a second network of the same kind looks at each of them again, in a
square of its own. It knows right hands; left ones are mirrored.
"""

from pathlib import Path
from typing import Any, Unpack

import cv2
import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import COCO_17, N_KEYPOINTS
from hicp_lib.detectors.combined.hand_squares import HAND_POINTS
from hicp_lib.detectors.onnx.box_source import BoxOptions, BoxSource
from hicp_lib.detectors.onnx.fitting import Regions
from hicp_lib.detectors.onnx.session import open_committed, open_model

_PRESENT = 0.5
_HAND_SIDE = 2.4  # of a hand's square, in extents of its points; those trained on are 1.3 to 3
_LEAST_PX = 12  # extent of a hand that is looked at again


class CloseRange:
    """The network for close range, on whole people and again on their hands.

    Parameters
    ----------
    model, hand_model : str or Path, optional
        Other files that `tools/closerange/export.py` wrote.
    padding : float
        Factor by which boxes are enlarged before they become squares.
    look_again : bool
        Whether hands are looked at again.
    presence : bool
        Whether scores contain the probability that the point is in the picture, or only how sure its place
        is.
    **person_boxes : object
        See `hicp_lib.detectors.onnx.box_source.BoxOptions`.

    Raises
    ------
    InputError
        If a file holds another network, or that of hands is given for whole people or the other way round.
    """

    name = "closerange"

    def __init__(
        self, model: str | Path | None = None, hand_model: str | Path | None = None, padding: float = 1.0,
        look_again: bool = True, presence: bool = True, **person_boxes: Unpack[BoxOptions],
    ) -> None:  # fmt: skip
        self._boxes = BoxSource(**person_boxes)
        run, ours = self._boxes.run, {f"{self.name}.onnx": model, f"{self.name}-hands.onnx": hand_model}
        self._model, self._hand_model = (
            open_model(of, **run) if of else open_committed(file, **run) for file, of in ours.items()
        )
        for opened, n_points in ((self._model, N_KEYPOINTS), (self._hand_model, len(HAND_POINTS[0]))):
            shape = (1, n_points, 5)
            if [(port.name, port.shape) for port in opened.outputs] != [("keypoints", shape)]:
                raise opened.refusal(f"expected what tools/closerange/export.py writes: keypoints {shape}")
        self._padding, self._looks_again, self._presence = padding, look_again, presence
        self.takes_boxes = self._boxes.kind == "gt"
        self.settings: dict[str, Any] = {"padding": padding, "look_again": look_again, "presence": presence}
        self.settings |= {"model": self._model.settings, "hand_model": self._hand_model.settings}
        self.settings |= {"opencv": cv2.__version__} | self._boxes.settings

    def detect(self, image: np.ndarray, boxes_px: np.ndarray | None = None) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8.

        `boxes_px`, shape (n, 4: x, y, width, height), are used when boxes are "gt".
        """
        boxes, box_scores = self._boxes.find(image, boxes_px)
        found = self._look(image, Regions.around(boxes, self._model.size_px, self._padding))
        if self._looks_again:
            for person in found:
                self._refine_hands(image, person)
        term = found[..., 2]
        present = found[..., 3] if self._presence else np.ones_like(term)
        # At least a half for what is in the picture; beyond, by how sure its position is.
        scores = np.where(present < _PRESENT, present, _PRESENT + (present - _PRESENT) * term)
        expected = np.average(term[:, COCO_17], axis=1, weights=present[:, COCO_17] + 1e-6)
        return Detections.of_parts(found[..., :2], scores, box_scores * expected, "halpe136")

    def _look(self, image: np.ndarray, regions: Regions) -> np.ndarray:
        """Per region and keypoint x, y in the image, expected term, in the picture, visible; (n, 136, 5)."""
        size_px = self._model.size_px
        runs = [self._model.run(cv2.dnn.blobFromImage(crop))[0] for crop in regions.crop(image, size_px)]
        found = np.concatenate([np.zeros((0, N_KEYPOINTS, 5)), *runs])
        found[..., :2] = regions.to_image_px(found[..., :2], size_px)
        return found

    def _refine_hands(self, image: np.ndarray, person: np.ndarray) -> None:
        """Replace the points of a person's hands (136, 5) by those of a closer look."""
        for points, is_left in zip(HAND_POINTS, (True, False), strict=True):
            hand = person[points]
            low, high = hand[:, :2].min(axis=0), hand[:, :2].max(axis=0)
            extent_px = (high - low).max()
            if (hand[:, 3] >= _PRESENT).mean() >= _PRESENT and extent_px >= _LEAST_PX:
                side_px = _HAND_SIDE * extent_px
                box = np.array([[*((low + high - side_px) / 2), side_px, side_px]])
                person[points, :3] = self._look_at_hand(image, box, is_left)[:, :3]

    def _look_at_hand(self, image: np.ndarray, box_px: np.ndarray, is_left: bool) -> np.ndarray:
        """As `_look`, of one hand (21, 5)."""
        size_px = self._hand_model.size_px
        region = Regions.around(box_px, size_px, 1.0)
        (crop,) = region.crop(image, size_px)
        crop = np.ascontiguousarray(crop[:, ::-1]) if is_left else crop
        found = self._hand_model.run(cv2.dnn.blobFromImage(crop))[0].astype(float)
        if is_left:
            found[..., 0] = size_px[0] - 1 - found[..., 0]
        found[..., :2] = region.to_image_px(found[..., :2], size_px)
        return found[0]
