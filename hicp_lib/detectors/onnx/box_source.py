"""Sources of person boxes: the annotations, the whole image, or a person detector.

NanoDet-g, which comes with the library, was trained on COCO, of which only people are kept (R. Lyu,
github.com/RangiLyu/nanodet). The image is fitted into the centre of the input, in BGR, normalised. Each cell
of three grids gives the scores of 80 classes and, for each side of the box, the probabilities that it is 0,
1, ... or 10 strides away (Li et al., "Generalized focal loss", NeurIPS 2020). `tools/bake_tfjs.py` made its
file.
"""

from pathlib import Path
from typing import Any, Unpack

import numpy as np

from hicp_lib.core.errors import InputError, refuse_unknown
from hicp_lib.detectors.onnx.fitting import IMAGENET_BGR, Regions, blob
from hicp_lib.detectors.onnx.person_boxes import PersonBoxes, are_boxes, unsuppressed, with_sizes
from hicp_lib.detectors.onnx.session import TEXTS, Fact, RunOptions, facts, open_committed

FILE = "nanodet.onnx"
_STRIDES_PX = (8, 16, 32)
_PERSON, _N_BINS = 0, 11
_MEANINGS: dict[str, str] = TEXTS["boxes"]
_THRESHOLDS = ("person_family", "person_min_score", "person_max_overlap")


class NanoDet:
    """A person finder that needs no user file.

    Parameters
    ----------
    min_score : float
        For development identities in 100 rendered scenes (seed 11), 0.3 finds 91 % of people (at an
        intersection over union of .5) with 7 % false boxes; 0.2 finds 95 % with 22 % false boxes.
    max_overlap : float
        Of two boxes that overlap more (intersection over union), the one with the higher score is kept.
    **run : object
        See `hicp_lib.detectors.onnx.session.RunOptions`.
    """

    def __init__(self, min_score: float = 0.3, max_overlap: float = 0.6, **run: Unpack[RunOptions]) -> None:
        self._model = open_committed(FILE, **run)
        self._min_score, self._max_overlap = min_score, max_overlap
        self.settings = {"min_score": min_score, "max_overlap": max_overlap} | self._model.settings

    def find(self, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """People in an RGB image (height, width, 3): boxes (n, 4: x, y, width, height) and scores (n,)."""
        size_px = self._model.size_px
        whole = Regions.whole(image, size_px)
        feed = blob(whole.crop(image, size_px), *IMAGENET_BGR, is_bgr=True)
        corners, scores = self._read(self._model.run_named(feed))
        ends_px = whole.to_image_px(corners.reshape(1, -1, 2), size_px)[0].clip(0, image.shape[1::-1])
        corners_px = ends_px.reshape(-1, 4)
        keep = np.flatnonzero(are_boxes(corners_px))
        keep = keep[unsuppressed(corners_px[keep], scores[keep], self._max_overlap)]
        return with_sizes(corners_px[keep]), scores[keep]

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
            columns = self._model.size_px[0] // stride_px
            middle_px = (np.stack([cells % columns, cells // columns], axis=1) + 0.5) * stride_px
            corners.append(np.stack([middle_px - sides_px[:, :2], middle_px + sides_px[:, 2:]], axis=1))
            scores.append(of_people[cells].astype(float))
        return np.concatenate(corners), np.concatenate(scores)


class BoxOptions(RunOptions, total=False):
    """Options of a detector that needs boxes, by the names that users type; None is the default.

    Attributes
    ----------
    boxes : str or None
        "gt" (annotated boxes, passed to `detect`), "image" (one person, the whole image) or "detected"; by
        default detected if there is a person model, and otherwise the image.
    person_model : str or Path or None
        ONNX export of YOLOX or RTMDet; without it, NanoDet is used, which comes with the library.
    person_family : str or None
    person_min_score, person_max_overlap : float or None
        Of `hicp_lib.detectors.onnx.person_boxes.PersonBoxes`, or of NanoDet.
    """

    boxes: str | None
    person_model: str | Path | None
    person_family: str | None
    person_min_score: float | None
    person_max_overlap: float | None


class BoxSource:
    """A source of person boxes.

    Parameters
    ----------
    **options : object
        See `BoxOptions`.

    Attributes
    ----------
    kind : str
        "gt", "image" or "detected".
    run : RunOptions
        Those of the options.
    """

    def __init__(self, **options: Unpack[BoxOptions]) -> None:
        boxes, person_model = options.get("boxes"), options.get("person_model")
        given = {name: of for name, of in options.items() if name in _THRESHOLDS and of is not None}
        own: dict[str, Any] = {name.removeprefix("person_"): of for name, of in given.items()}
        self.run = RunOptions(provider=options.get("provider", "cpu"), threads=options.get("threads", 1))
        self.kind = boxes or ("detected" if person_model else "image")
        refuse_unknown("boxes", self.kind, _MEANINGS)
        if person_model is not None and self.kind != "detected":
            raise InputError(
                f"boxes {self.kind!r}: do not use a person model; give boxes 'detected' together with "
                "person_model (--person-model FILE.onnx), or neither"
            )
        if own and (self.kind != "detected" or person_model is None and "family" in own):
            raise InputError(
                f"boxes {self.kind!r}: do not use {', '.join(given)}; leave them out, or give "
                "boxes 'detected' and, for person_family, a person_model"
            )
        self._finder: PersonBoxes | NanoDet | None = None
        self.settings: dict[str, Any] = {"boxes": self.kind}
        if self.kind == "detected":
            own |= self.run
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
