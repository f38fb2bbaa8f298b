"""Sources of person boxes: the annotations, the whole image, or a person detector."""

from pathlib import Path
from typing import Any

import numpy as np

from hicp_lib.core.errors import InputError, refuse_unknown
from hicp_lib.detectors.onnx.facts import TEXTS, Fact
from hicp_lib.detectors.onnx.nanodet import NanoDet
from hicp_lib.detectors.onnx.person_boxes import PersonBoxes

_MEANINGS: dict[str, str] = TEXTS["boxes"]


class BoxSource:
    """A source of person boxes.

    Parameters
    ----------
    boxes : str or None
        "gt" (annotated boxes, passed to `detect`), "image" (one person, the whole image) or "detected"; by
        default detected if there is a person model, and otherwise the image.
    person_model : str or Path or None
        ONNX export of YOLOX or RTMDet; without it, NanoDet is used, which comes with the library.
    provider : str
    threads : int
    **own : object
        Further options of `hicp_lib.detectors.onnx.person_boxes.PersonBoxes`, or of NanoDet; None means the
        default.
    """

    def __init__(
        self, boxes: str | None, person_model: str | Path | None, provider: str, threads: int, **own: Any
    ) -> None:
        own = {name: value for name, value in own.items() if value is not None}
        self.kind = boxes or ("detected" if person_model else "image")
        refuse_unknown("boxes", self.kind, _MEANINGS)
        if person_model is not None and self.kind != "detected":
            raise InputError(
                f"boxes {self.kind!r}: do not use a person model; give boxes 'detected' together with "
                "person_model (--person-model FILE.onnx), or neither"
            )
        if own and (self.kind != "detected" or person_model is None and "family" in own):
            raise InputError(
                f"boxes {self.kind!r}: do not use person_{', person_'.join(own)}; leave them out, or give "
                "boxes 'detected' and, for person_family, a person_model"
            )
        self._finder: PersonBoxes | NanoDet | None = None
        self.settings: dict[str, Any] = {"boxes": self.kind}
        if self.kind == "detected":
            own |= {"provider": provider, "threads": threads}
            self._finder = NanoDet(**own) if person_model is None else PersonBoxes(person_model, **own)
            self.settings["person_model"] = self._finder.settings

    def find(self, image: np.ndarray, boxes_px: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Boxes (n, 4) and scores (n,) of an RGB image's people; `boxes_px` are the annotated ones."""
        if self._finder:
            return self._finder.find(image)
        if self.kind == "image":
            return np.array([[0.0, 0.0, image.shape[1], image.shape[0]]]), np.ones(1)
        if boxes_px is None:
            raise InputError(
                "boxes 'gt': need the annotated boxes of each image; give a dataset folder with annotations, "
                "or boxes 'image' or 'detected'"
            )
        boxes_px = np.asarray(boxes_px, dtype=float).reshape(-1, 4)
        return boxes_px, np.ones(len(boxes_px))

    def describe(self) -> list[Fact]:
        """What is assumed about the boxes."""
        row = Fact("boxes", self.kind, _MEANINGS[self.kind])
        return [row, *(self._finder.describe() if self._finder else [])]
