"""Top-down detectors: boxes, then a network that takes crops of people and gives their keypoints.

The size of the input, the number of keypoints, and whether outputs are heat maps or SimCC are read from the
file; the rest (colours, decoding) has to be given. Metadata (`input_w`, `input_h`, `split_ratio`, alone or in
a `cigpose_meta`) are used, and must agree with the network.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import mirror
from hicp_lib.detectors.onnx.box_source import BoxOptions, BoxSource
from hicp_lib.detectors.onnx.decode import Decoded, decode_simcc
from hicp_lib.detectors.onnx.fitting import PADDING, Regions, blob
from hicp_lib.detectors.onnx.session import Fact, OnnxModel, facts, open_model

CONVENTIONS = {14: "crowdpose14", 17: "coco17", 21: "right_hand21", 26: "halpe26", 68: "halpe68_noface"}
CONVENTIONS |= {133: "wholebody133", 136: "halpe136"}
# Keypoint sets of published networks that have no counterpart in Halpe.
_STRANGERS = {15: "MPI's body", 16: "MPII's body", 98: "WFLW's face", 106: "LaPa's face", 308: "Goliath"}
_MAX_BATCH = 16
Colour = tuple[float, float, float]


class TopDownOptions(BoxOptions, total=False):
    """Options of every top-down network.

    Attributes
    ----------
    flip_test : bool
        Also run the mirrored crops, and average; by default not.
    input_size_px : list of int or None
        Width and height of the crops, if neither the file's input nor its metadata states them.
    """

    flip_test: bool
    input_size_px: list | None


class TopDown:
    """A detector that runs a network on each person's box; a subclass says how it decodes, and what remains.

    Parameters
    ----------
    model : str or Path
        ONNX export.
    mean, std : Colour
        Of the R, G and B values 0-255: subtracted, and divided by.
    flip_test : bool
    input_size_px : list of int, optional
    **person_boxes : object
        See `TopDownOptions`.

    Attributes
    ----------
    takes_boxes : bool
    settings : dict
        As of every detector.
    input_size_px : tuple of int
        Width and height of the crops.
    convention : str
        The convention of its keypoints, a key of `hicp_lib.core.keypoints.TO_HALPE`.
    is_simcc : bool
        A vector per axis in place of a heat map.
    answer : list of array
        The outputs for zeros.
    batch : int or None
        Crops per run; None if the file leaves it open.
    grid_size : tuple of int
        Width and height of the grid that the outputs' positions are on.
    udp : bool
        Whether the network was trained with unbiased data processing.

    Raises
    ------
    InputError
        If the file's input or outputs are not those of a top-down pose network.
    """

    udp = False

    def __init__(
        self, model: str | Path, mean: Colour, std: Colour, flip_test: bool = False,
        input_size_px: list | None = None, **person_boxes: Unpack[BoxOptions],
    ) -> None:  # fmt: skip
        self._boxes = BoxSource(**person_boxes)
        self.takes_boxes = self._boxes.kind == "gt"
        self.model = opened = open_model(model, **self._boxes.run)
        self._mean, self._std, self._flip_test = mean, std, flip_test
        self.batch = opened.inputs[0].shape[0] if opened.inputs[0].shape else None
        self.input_size_px, self._size_from = _input_size(opened, input_size_px)
        answer = opened.response_to_zeros(*self.input_size_px[::-1])
        self.answer = outputs = self._ordered(answer)
        self.is_simcc = len(outputs) == 2
        self.convention = convention_of(opened, outputs[0].shape[1], answer)
        self._mirror = mirror(self.convention)
        first, last = outputs[0], outputs[-1]
        self.grid_size = (first.shape[-1], last.shape[-1] if self.is_simcc else last.shape[-2])
        ratio = opened.told.metadata.get("split_ratio")
        if self.is_simcc and ratio and self.grid_size != tuple(side * ratio for side in self.input_size_px):
            size = "{} x {}".format(*self.input_size_px)
            raise opened.refusal(f"its metadata say {ratio} bins per pixel of its {size}", answer)
        self.settings = {"model": opened.settings, "flip_test": flip_test} | self._boxes.settings

    def _decode_maps(self, maps: np.ndarray) -> Decoded:
        """Heat maps, shape (n, k, h, w), to positions in cells, shape (n, k, 2), and scores, shape (n, k)."""
        raise NotImplementedError

    def _people(
        self, found: Decoded, box_scores: np.ndarray, boxes: np.ndarray, regions: Regions
    ) -> Detections:
        """The people that remain of n poses.

        Parameters
        ----------
        found : tuple of array, shapes (n, k, 2) and (n, k)
            Positions in the image, NaN where the score is not positive, and scores as the network gives them.
        box_scores : array, shape (n,)
        boxes : array, shape (n, 4: x, y, width, height)
        regions : Regions
            What the network saw of each.
        """
        raise NotImplementedError

    def detect(self, image: np.ndarray, boxes_px: np.ndarray | None = None) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8.

        `boxes_px`, shape (n, 4: x, y, width, height), are used when boxes are "gt".
        """
        boxes, box_scores = self._boxes.find(image, boxes_px)
        if not len(boxes):
            return Detections.none()
        regions = Regions.around(boxes, self.input_size_px, udp=self.udp)
        outputs = self._respond(regions.crop(image, self.input_size_px))
        cells, scores = decode_simcc(*outputs) if self.is_simcc else self._decode_maps(outputs[0])
        return self._people((regions.to_image_px(cells, self.grid_size), scores), box_scores, boxes, regions)

    def described(self, own: list[Fact]) -> list[Fact]:
        """What the file tells and how crops are made, what a subclass assumes, and where boxes come from."""
        size = {"size_px": self.input_size_px, "size_from": self._size_from, "batch": self.batch or "any"}
        grid = "x".join(map(str, self.grid_size)) + (" bins" if self.is_simcc else " cells")
        output = {"grid": grid, "convention": self.convention, "padding": PADDING}
        crops = facts("top-down", flip_test="yes" if self._flip_test else "no", **size, **output)
        return [*self.model.describe(), *crops, *own, *self._boxes.describe()]

    def _respond(self, crops: list[np.ndarray]) -> list[np.ndarray]:
        """The outputs for n crops, including the flip test."""
        n = len(crops)
        if self._flip_test:
            crops = crops + [crop[:, ::-1] for crop in crops]
        batch = self.batch or _MAX_BATCH
        parts = [self._run(crops[start : start + batch]) for start in range(0, len(crops), batch)]
        outputs = [np.concatenate(part) for part in zip(*parts, strict=True)]
        if not self._flip_test:
            return outputs
        shifts = not (self.is_simcc or self.udp)
        return [self._average(out[:n], out[n:], axis, shifts) for axis, out in enumerate(outputs)]

    def _run(self, crops: list[np.ndarray]) -> list[np.ndarray]:
        width, height = self.input_size_px
        feed = np.zeros((self.batch or len(crops), 3, height, width), np.float32)
        feed[: len(crops)] = blob(crops, self._mean, self._std)
        return [output[: len(crops)] for output in self._ordered(self.model.run(feed), len(feed))]

    def _average(self, straight: np.ndarray, flipped: np.ndarray, axis: int, shifts: bool) -> np.ndarray:
        """Mean of an output and the one for mirrored crops, with sides swapped back."""
        back = flipped[:, self._mirror]
        if axis == 0:
            back = back[..., ::-1]
        if shifts:
            # A strided map is off by half a stride when mirrored; the original programs shift it by a cell.
            back = np.concatenate([back[..., :1], back[..., :-1]], axis=-1)
        return (straight + back) / 2

    def _ordered(self, outputs: list[np.ndarray], n: int | None = None) -> list[np.ndarray]:
        """[heat maps (n, k, h, w)], or [SimCC x, SimCC y], each (n, k, bins); anything else is refused."""
        n = n or self.batch or 1
        maps = [output for output in outputs if output.ndim == 4]
        vectors = [output for output in outputs if output.ndim == 3]
        width, height = self.input_size_px
        is_fine = all(output.shape[0] == n and 0 not in output.shape for output in maps + vectors)
        if is_fine and len(maps) == 1 and not vectors:
            return maps
        if is_fine and len(vectors) in (2, 3) and not maps and len({v.shape[1] for v in vectors}) == 1:
            # Of three outputs the last is the depth (RTMW3D), which is not used.
            x, y = vectors[:2]
            if x.shape[2] * height == y.shape[2] * width:
                return [x, y]
            if len(vectors) == 2 and y.shape[2] * height == x.shape[2] * width:
                return [y, x]
        raise self.model.refusal(
            f"expected heat maps ({n}, keypoints, h, w), or SimCC of {width}s and {height}s, "
            f"({n}, keypoints, bins)", outputs
        )  # fmt: skip


def convention_of(model: OnnxModel, n_keypoints: int, outputs: list[np.ndarray] | None = None) -> str:
    """The keypoint convention of a network, by the number of its keypoints.

    Parameters
    ----------
    model : OnnxModel
    n_keypoints : int
    outputs : list of array, optional
        What it gave.

    Raises
    ------
    InputError
        If it is not a convention with a mapping to Halpe.
    """
    if n_keypoints not in CONVENTIONS:
        name = f" ({_STRANGERS[n_keypoints]})" if n_keypoints in _STRANGERS else ""
        raise model.refusal(f"{n_keypoints} keypoints{name} are not a set known here", outputs)
    return CONVENTIONS[n_keypoints]


def _input_size(model: OnnxModel, given: list[int] | None) -> tuple[tuple[int, int], str]:
    """Width and height of a network's crops, and where they come from."""
    shape = model.inputs[0].shape
    if len(shape) != 4 or shape[1] not in (None, 3):
        raise model.refusal("expected crops of a fixed size, (n, 3, h, w)")
    read, metadata = (shape[3], shape[2]), model.told.metadata
    told = [metadata.get("input_w"), metadata.get("input_h")]
    sizes = {"read from the file": read, "from its metadata": told, "option input_size_px": given or []}
    whole = {why: size for why, sides in sizes.items() if (size := _size(sides)) is not None}
    if given is not None and "option input_size_px" not in whole:
        raise InputError(f"input_size_px {given}: expected width and height in pixels, as in [192, 256]")
    if not whole:
        raise model.refusal(
            "expected crops of a fixed size, (n, 3, h, w); or say which: -o input_size_px '[192, 256]'"
        )
    why, size = next(iter(whole.items()))
    for other in (*whole.values(), read):
        if any(side not in (None, known) for side, known in zip(other, size, strict=True)):
            raise model.refusal(f"its input is {size[0]} x {size[1]} ({why}), not {other[0]} x {other[1]}")
    return size, why


def _size(sides: Sequence[Any]) -> tuple[int, int] | None:
    """Width and height, if the value is valid."""
    match sides:
        case [int(width), int(height)] if min(width, height) > 0:
            return width, height
    return None
