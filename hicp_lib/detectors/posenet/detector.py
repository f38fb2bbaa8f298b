"""PoseNet on MobileNetV1, bottom-up: everybody in a whole image (Papandreou et al., "PersonLab", ECCV 2018).

The image is fitted into the middle of the network's square input. `tools/bake_tfjs.py` made its file.
"""

from dataclasses import asdict

import cv2
import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.detectors.onnx.affine import Regions
from hicp_lib.detectors.onnx.session import open_committed
from hicp_lib.detectors.posenet.decoding import DecodingRule, Maps, decode

STRIDE_PX = 16


class PoseNetMobileNet:
    """PoseNet (MobileNetV1): 17 body points of everybody in the image.

    Parameters
    ----------
    max_people : int
    min_root_score : float
        See `hicp_lib.detectors.posenet.decoding.DecodingRule`.
    provider : str
    threads : int
        See `hicp_lib.detectors.onnx.session.open_model`.
    """

    name = "posenet"

    def __init__(
        self, max_people: int = 5, min_root_score: float = 0.5, provider: str = "cpu", threads: int = 1
    ) -> None:
        self._model = open_committed(f"{self.name}.onnx", provider, threads)
        self._side_px = self._model.side_px
        self._rule = DecodingRule(max_people, min_root_score)
        self.settings = {**asdict(self._rule), "opencv": cv2.__version__, "model": self._model.settings}

    def detect(self, image: np.ndarray) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8."""
        size_px = self._side_px, self._side_px
        whole = Regions.whole(image, size_px)
        (square,) = whole.crop(image, size_px)
        positions_px, scores, person_scores = decode(self.maps(square), self._rule)
        in_image_px = whole.to_image_px(positions_px.reshape(1, -1, 2), size_px).reshape(positions_px.shape)
        return Detections.of_parts(in_image_px, scores, person_scores, "coco17")

    def maps(self, square: np.ndarray) -> Maps:
        """Run the network on an RGB square of its input's side."""
        blob = cv2.dnn.blobFromImage(square, 1 / 127.5, mean=(127.5, 127.5, 127.5))
        outputs = self._model.run_named(blob)
        # Of each vector all y come first, then all x.
        to_child, to_parent, offsets = (
            np.moveaxis(outputs[name].reshape(2, -1, *outputs[name].shape[2:])[::-1], 0, -1)
            for name in ("displacement_fwd", "displacement_bwd", "offset")
        )
        heat = 1 / (1 + np.exp(-outputs["heatmap"][0]))
        return Maps(heat, offsets, to_child, to_parent, STRIDE_PX)
