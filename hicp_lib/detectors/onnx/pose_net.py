"""A top-down network: crops of people in, keypoints in the image out.

The size of the input, the number of keypoints and heat maps against SimCC are read from
the file; what the file cannot tell (colours, decoding) is given.
"""

from collections.abc import Callable

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import mirror
from hicp_lib.detectors.onnx.affine import PADDING, Regions
from hicp_lib.detectors.onnx.decode import Decoded, decode_simcc
from hicp_lib.detectors.onnx.facts import Fact
from hicp_lib.detectors.onnx.letterbox import planes
from hicp_lib.detectors.onnx.session import OnnxModel

CONVENTIONS = {
    17: "coco17",
    21: "right_hand21",
    26: "halpe26",
    68: "halpe68_noface",
    133: "wholebody133",
    136: "halpe136",
}
_MAX_BATCH = 16
Colour = tuple[float, float, float]
Decoder = Callable[[np.ndarray], Decoded]


class PoseNet:
    """A top-down network, and what its file does not tell about it.

    Parameters
    ----------
    model : OnnxModel
    mean, std : Colour
        Of the R, G and B values 0-255, taken off and divided by.
    decode_maps : callable
        Heat maps, shape (n, k, h, w), to positions in cells, shape (n, k, 2), and scores, shape (n, k).
    flip_test : bool
        Also run the mirrored crops, and average.

    Attributes
    ----------
    input_size_px : tuple of int
        Width and height of the crops.
    convention : str
        What its keypoints are, a key of `hicp_lib.core.keypoints.TO_HALPE`.
    is_simcc : bool
        A vector per axis in place of a heat map.
    batch : int or None
        Crops per run; None if the file leaves it open.
    grid_size : tuple of int
        Width and height of the grid that the outputs' positions are on.

    Raises
    ------
    InputError
        If the file's input or outputs are not those of a top-down pose network.
    """

    def __init__(
        self, model: OnnxModel, mean: Colour, std: Colour, decode_maps: Decoder, flip_test: bool
    ) -> None:
        self.model, self._mean, self._std = model, mean, std
        self._decode_maps, self._flip_test = decode_maps, flip_test
        shape = model.inputs[0].shape
        match shape:
            case (batch, 3, int(height), int(width)):
                self.batch, self.input_size_px = batch, (width, height)
            case _:
                raise InputError(
                    f"{model.path}: takes an input of shape {shape}; "
                    "expected crops of a fixed size, (n, 3, h, w)"
                )
        outputs = self._ordered(model.response_to_zeros)
        self.is_simcc = len(outputs) == 2
        n_keypoints = outputs[0].shape[1]
        if n_keypoints not in CONVENTIONS:
            raise InputError(
                f"{model.path}: gives {n_keypoints} keypoints; expected one of "
                f"{', '.join(map(str, CONVENTIONS))} (COCO, hand, Halpe, COCO-WholeBody)"
            )
        self.convention = CONVENTIONS[n_keypoints]
        self._mirror = mirror(self.convention)
        first, last = outputs[0], outputs[-1]
        self.grid_size = (first.shape[-1], last.shape[-1] if self.is_simcc else last.shape[-2])

    def find(self, image: np.ndarray, regions: Regions) -> Decoded:
        """Keypoints of the people in some regions of an RGB image.

        Returns
        -------
        positions_px : array, shape (n, k, 2)
            In the image; NaN where the score is not positive.
        scores : array, shape (n, k)
        """
        outputs = self._respond(regions.crop(image, self.input_size_px))
        cells, scores = decode_simcc(*outputs) if self.is_simcc else self._decode_maps(outputs[0])
        return regions.to_image_px(cells, self.grid_size), scores

    def describe(self) -> list[Fact]:
        """What the file tells, and how crops are made."""
        width, height = self.input_size_px
        return [
            *self.model.describe(),
            Fact("input", f"{width} wide, {height} high", "read from the file"),
            Fact("batch", str(self.batch or "any"), "read from the file"),
            Fact("output", f"{'x'.join(map(str, self.grid_size))} {'bins' if self.is_simcc else 'cells'}",
                 "read from the file"),
            Fact("keypoints", self.convention, "told by their number"),
            Fact("crop", f"box x {PADDING}, grown to the input's shape, black outside the image",
                 "as the originals"),
            Fact("flip test", "yes" if self._flip_test else "no", "option flip_test"),
        ]  # fmt: skip

    def _respond(self, crops: list[np.ndarray]) -> list[np.ndarray]:
        """The outputs for n crops, flip test included; n of each."""
        n = len(crops)
        if self._flip_test:
            crops = crops + [crop[:, ::-1] for crop in crops]
        batch = self.batch or _MAX_BATCH
        parts = [self._run(crops[start : start + batch]) for start in range(0, len(crops), batch)]
        outputs = [np.concatenate(part) for part in zip(*parts, strict=True)]
        if not self._flip_test:
            return outputs
        return [self._average(output[:n], output[n:], axis) for axis, output in enumerate(outputs)]

    def _run(self, crops: list[np.ndarray]) -> list[np.ndarray]:
        width, height = self.input_size_px
        feed = np.zeros((self.batch or len(crops), 3, height, width), np.float32)
        for crop, out in zip(crops, feed, strict=False):
            planes(crop, self._mean, self._std, out)
        return [output[: len(crops)] for output in self._ordered(self.model.run(feed), len(feed))]

    def _average(self, straight: np.ndarray, flipped: np.ndarray, axis: int) -> np.ndarray:
        """Mean of an output and the one for mirrored crops, with its sides put right."""
        back = flipped[:, self._mirror]
        if axis == 0:
            back = back[..., ::-1]
        if not self.is_simcc:
            # A strided map lies half a stride off when mirrored; the originals shift it by a cell.
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
        if is_fine and len(vectors) == 2 and not maps and vectors[0].shape[1] == vectors[1].shape[1]:
            ratios = [vector.shape[2] / side for vector, side in zip(vectors, (width, height), strict=True)]
            if ratios[0] == ratios[1]:
                return vectors
            if vectors[1].shape[2] * height == vectors[0].shape[2] * width:
                return vectors[::-1]
        expected = (
            f"heat maps ({n}, keypoints, h, w), or SimCC of {width}s and {height}s, ({n}, keypoints, bins)"
        )
        raise self.model.unexpected(outputs, expected)
