"""Keypoint R-CNN (He et al., "Mask R-CNN", ICCV 2017) exported from Detectron2 or torchvision.

One network finds people and their 17 COCO keypoints. The two programs differ in the input and in the meaning
of a keypoint's score:

- Detectron2 takes BGR 0-255 with the short side at 800 (the long one at most 1333), measures
  positions with pixel *corners* at integers (half a pixel is subtracted here), and scores a
  keypoint by the softmax mass of its peak over the 56 x 56 map: small numbers, clipped at 1.
- torchvision takes RGB 0-1 and scales it itself; the score is the raw logit of the peak, mapped to [0, 1]
  here by a logistic curve centred at 2, the value from which Detectron draws points.
"""

from pathlib import Path
from typing import Unpack

import cv2
import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import refuse_unknown
from hicp_lib.detectors.onnx.decode import decode_roi_maps, given
from hicp_lib.detectors.onnx.fitting import Letterbox, letterbox
from hicp_lib.detectors.onnx.session import Fact, Port, RunOptions, facts, open_model

_N_KEYPOINTS = 17
_LOGIT_MIDDLE = 2.0
_SHORT_PX, _LONG_PX = 800, 1333
_FAMILIES = ("detectron2", "torchvision")
_MAX_EXPONENT = 80.0  # exp() of more overflows
# What comes out of the network, by shape behind the number of people; None stands for any size.
_ROLES: dict[str, tuple[int | None, ...]] = {"boxes": (4,), "scores": (), "logits": (_N_KEYPOINTS,)}
_ROLES |= {"keypoints": (_N_KEYPOINTS, 3), "maps": (_N_KEYPOINTS, None, None)}
# Padding of a fixed input: the mean colour, which becomes 0 when the network normalises it.
_FILL = (124, 116, 104)


class KeypointRcnn:
    """Keypoint R-CNN on the user's own weights.

    Parameters
    ----------
    model : str or Path
        ONNX export of Detectron2's or torchvision's Keypoint R-CNN.
    family : str, optional
        "detectron2" or "torchvision"; detected from the outputs if None.
    min_score : float
        Minimum box score of a person.
    **run : object
        See `hicp_lib.detectors.onnx.session.RunOptions`.
    """

    name = "detectron2"

    def __init__(
        self, model: str | Path, family: str | None = None, min_score: float = 0.05, **run: Unpack[RunOptions]
    ) -> None:
        self._model = open_model(model, **run)
        shape = self._model.inputs[0].shape
        if shape[:-3] not in ((), (1,), (None,)) or shape[-3:-2] not in ((3,), (None,)):
            raise self._model.refusal("expected an input of one image, (3, h, w)")
        self._is_told = family is None
        self._family = family or _told_family(self._model.outputs)
        refuse_unknown(f"{model}: family", self._family, _FAMILIES)
        self._check([port.shape for port in self._model.outputs])
        self._min_score = min_score
        self.settings = {"model": self._model.settings, "family": self._family, "min_score": min_score}
        self.settings["opencv"] = cv2.__version__

    def detect(self, image: np.ndarray) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8."""
        fitted = self._fit(image)
        roles = self._roles(self._model.run(self._feed(fitted.pixels)))
        keep = (roles["scores"] >= self._min_score) & np.isfinite(roles["boxes"]).all(axis=1)
        people = {name: role[keep] for name, role in roles.items()}
        positions_px, scores = self._keypoints(people)
        positions_px = positions_px / fitted.scale - (0.5 if self._family == "detectron2" else 0.0)
        return Detections.of_parts(*given(positions_px, scores), people["scores"], "coco17")

    def describe(self) -> list[Fact]:
        """What is assumed about the model."""
        told = "from its outputs" if self._is_told else "given"
        height, width = (side or "any" for side in self._model.inputs[0].shape[-2:])
        size = {"width": width, "height": height}
        own = facts(self._family, told=told, logit_middle=_LOGIT_MIDDLE, **size, **self.settings)
        return [*self._model.describe(), *own]

    def _fit(self, image: np.ndarray) -> Letterbox:
        """The image at the size the network takes."""
        height, width = self._model.inputs[0].shape[-2:]
        if height and width:
            return letterbox(image, (width, height), _FILL)
        if self._family == "torchvision":
            return Letterbox(image, np.ones(2))
        sides = image.shape[1], image.shape[0]
        zoom = min(_SHORT_PX / min(sides), _LONG_PX / max(sides))
        size = tuple(max(1, int(side * zoom + 0.5)) for side in sides)
        kind = cv2.INTER_AREA if zoom < 1 else cv2.INTER_LINEAR
        return Letterbox(cv2.resize(image, size, interpolation=kind), np.array(size) / sides)

    def _feed(self, pixels: np.ndarray) -> np.ndarray:
        is_bgr = self._family == "detectron2"
        feed = cv2.dnn.blobFromImage(pixels, 1 if is_bgr else 1 / 255, swapRB=is_bgr)
        return feed if len(self._model.inputs[0].shape) == 4 else feed[0]

    def _roles(self, outputs: list[np.ndarray]) -> dict[str, np.ndarray]:
        """The outputs by `_ROLES`; exports differ in order and names, so ranks and sizes identify them."""
        floats = [output.astype(float) for output in outputs if output.dtype.kind == "f"]
        fitting = {name: [one for one in floats if _fits(one.shape, tail)] for name, tail in _ROLES.items()}
        roles = {name: found[0] for name, found in fitting.items() if found}
        self._check([role.shape for role in roles.values()], outputs)
        if len({len(role) for role in roles.values()}) != 1:
            raise self._model.refusal("its outputs are of different numbers of people", outputs)
        return roles

    def _check(self, shapes: list[tuple[int | None, ...]], outputs: list[np.ndarray] | None = None) -> None:
        """Refuse a network whose outputs cannot be those of its family; an open size matches any."""
        found = {name for name, tail in _ROLES.items() if any(_fits(shape, tail) for shape in shapes)}
        is_torch = self._family == "torchvision"
        wanted = [{"keypoints", "logits"}] if is_torch else [{"keypoints"}, {"maps"}]
        # A file may leave a port's rank open.
        if () not in shapes and not any(points | {"boxes", "scores"} <= found for points in wanted):
            expected = f"expected {self._family}'s boxes (n, 4), scores (n), keypoints (n, 17, 3)"
            raise self._model.refusal(expected + is_torch * " and keypoint scores (n, 17)", outputs)

    def _keypoints(self, people: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Positions (n, 17, 2) in input pixels and scores (n, 17) in [0, 1]."""
        if self._family == "torchvision":
            return people["keypoints"][..., :2], logistic_score(people["logits"])
        if "keypoints" not in people:
            positions_px, masses = decode_roi_maps(people["maps"], people["boxes"])
            return positions_px, np.clip(masses, 0, 1)
        return people["keypoints"][..., :2], np.clip(np.nan_to_num(people["keypoints"][..., 2]), 0, 1)


def logistic_score(logits: np.ndarray) -> np.ndarray:
    """Scores in [0, 1] for raw logits; 0.5 at 2. A logit that is not a number scores 0.

    Examples
    --------
    >>> logistic_score(np.array([-50, 2, 50, np.nan])).round(3).tolist()
    [0.0, 0.5, 1.0, 0.0]
    """
    return np.nan_to_num(1 / (1 + np.exp(np.clip(_LOGIT_MIDDLE - logits, -_MAX_EXPONENT, _MAX_EXPONENT))))


def _fits(shape: tuple[int | None, ...], tail: tuple[int | None, ...]) -> bool:
    """Whether a shape is (n, *tail), None standing for any size."""
    sizes = zip(shape[1:], tail, strict=False)
    return len(shape) == 1 + len(tail) and all(None in (size, want) or size == want for size, want in sizes)


def _told_family(outputs: list[Port]) -> str:
    """torchvision has two outputs of rank 2, the boxes and the logits; Detectron2 one."""
    return "torchvision" if sum(len(port.shape) == 2 for port in outputs) == 2 else "detectron2"
