"""The network: MoveNet Lightning, and a decoder for 136 keypoints on its features.

MoveNet's finer layers stay as they are, for photographs' sake: onnxruntime runs them, and what the decoder
needs of them is kept, so that training runs the rest only. These are features at a quarter, an eighth and a
sixteenth of the input's resolution, and its own maps of 17 body points, as logarithms. MoveNet's coarsest
layers are there twice: frozen, for these maps, and as the beginning of what is trained. The decoder adds up
four resolutions and gives per keypoint a map of logits at a quarter of the input's, for body points added
to MoveNet's, and the logits of two questions: is the keypoint in the picture, and is it visible?
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import helper, numpy_helper
from torch import nn
from torch.nn import functional

from hicp_lib.core.keypoints import SIGMAS

from .frozen import FROZEN, GRID, N_BODY, SETS, SHAPES, STRIDE

SCALES = {"people": 0.5, "hands": 1.8}
"""The square root of the area that OKS is measured by, in sides of a square, as it is for many."""
_REACH, _STEPS = 18, 3  # cells that smoothing reaches; steps of mean shift
_MIDDLE, _LAST = "Add_168_0", "Conv_214_0"
_MIDDLE_CHANNELS, _LAST_CHANNELS = 96, 320


class Convolutions(nn.Module):
    """A part of MoveNet's graph of convolutions, clips and sums; gives some of its tensors."""

    def __init__(self, lightning: Path, start: str, ends: list[str]) -> None:
        super().__init__()
        model = onnx.load(str(lightning))
        weights = {w.name.removesuffix("/half"): numpy_helper.to_array(w) for w in model.graph.initializer}
        nodes = {node.output[0]: node for node in model.graph.node}
        self._steps: list[tuple[str, list[str], str]] = []
        self.layers = nn.ModuleDict()
        self._start, self._ends = start, ends
        for end in ends:
            self._add(nodes, weights, end)

    def _add(self, nodes: dict, weights: dict, name: str) -> None:
        if name == self._start or any(step[2] == name for step in self._steps):
            return
        node = nodes[name]
        data = [i for i in node.input if i in nodes and nodes[i].op_type != "Cast"]
        for source in data:
            self._add(nodes, weights, source)
        if node.op_type == "Conv":
            self.layers[name] = _convolution(node, weights)
        self._steps.append((node.op_type, data, name))

    def forward(self, features: torch.Tensor) -> list[torch.Tensor]:
        values = {self._start: features}
        for kind, sources, name in self._steps:
            inputs = [values[source] for source in sources]
            if kind == "Conv":
                values[name] = self.layers[name](inputs[0])
            elif kind == "Clip":
                values[name] = functional.relu6(inputs[0])
            else:
                values[name] = inputs[0] + inputs[1]
        return [values[end] for end in self._ends]


def _convolution(node: onnx.NodeProto, weights: dict) -> nn.Module:
    about = {a.name: helper.get_attribute_value(a) for a in node.attribute}
    kernel = torch.tensor(weights[node.input[1]].astype(np.float32))
    top, left, bottom, right = about.get("pads", [0, 0, 0, 0])
    layer = nn.Conv2d(
        kernel.shape[1] * about.get("group", 1), kernel.shape[0], tuple(kernel.shape[2:]),
        stride=tuple(about.get("strides", (1, 1))), groups=about.get("group", 1), bias=len(node.input) > 2,
    )  # fmt: skip
    layer.weight.data = kernel
    if len(node.input) > 2:
        layer.bias.data = torch.tensor(weights[node.input[2]].astype(np.float32))
    if any((top, left, bottom, right)):
        return nn.Sequential(nn.ZeroPad2d((left, right, top, bottom)), layer)
    return layer


def _separable(n_in: int, n_out: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(n_in, n_in, 5, padding=2, groups=n_in, bias=False), nn.BatchNorm2d(n_in),
        nn.Conv2d(n_in, n_out, 1, bias=False), nn.BatchNorm2d(n_out), nn.ReLU(inplace=True),
    )  # fmt: skip


class CloseRange(nn.Module):
    """What is trained: from MoveNet's kept tensors to maps and answers.

    Parameters
    ----------
    lightning : Path
        MoveNet Lightning's file.
    squares : str
        "people" or "hands"; the network of hands has 21 maps, and no maps of MoveNet's.
    width : int
        Channels of the decoder at its finest.
    """

    def __init__(self, lightning: Path, squares: str = "people", width: int = 96) -> None:
        super().__init__()
        n, self.n_body = len(SETS[squares]), N_BODY if squares == "people" else 0
        self.tail = Convolutions(lightning, FROZEN["sixteenth"], [_MIDDLE, _LAST])
        wide = 2 * width
        self.lateral = nn.ModuleDict({
            "last": nn.Conv2d(_LAST_CHANNELS, wide, 1),
            "sixteenth": nn.Conv2d(SHAPES["sixteenth"][0] + _MIDDLE_CHANNELS, wide, 1),
            "eighth": nn.Conv2d(SHAPES["eighth"][0], width, 1),
            "quarter": nn.Conv2d(SHAPES["quarter"][0] + self.n_body, width, 1),
        })  # fmt: skip
        self.merge = nn.ModuleDict({
            "last": _separable(wide, wide),
            "sixteenth": _separable(wide, width),
            "eighth": _separable(width, width),
            "quarter": nn.Sequential(_separable(width, width), _separable(width, width)),
        })  # fmt: skip
        self.maps = nn.Conv2d(width, n, 1)
        self.body_gain = nn.Parameter(torch.full((self.n_body, 1, 1), 1.5))
        self.pooled = nn.Sequential(nn.Linear(wide + width, 256), nn.ReLU(), nn.Linear(256, 2 * n))
        self.peak = nn.Parameter(torch.tensor([[0.5, 0.2], [0.5, 0.2]])[..., None].repeat(1, 1, n))

    def forward(self, quarter, eighth, sixteenth, *body) -> tuple[torch.Tensor, torch.Tensor]:
        """Maps (n, 136 or 21, 48, 48) and answers (n, 2, 136 or 21), all logits."""
        middle, last = self.tail(sixteenth)
        coarse = self.merge["last"](functional.relu(self.lateral["last"](last)))
        sides = self.lateral["sixteenth"](torch.cat([sixteenth, middle], dim=1))
        fine = self.merge["sixteenth"](functional.relu(sides + _doubled(coarse)))
        finer = self.merge["eighth"](functional.relu(self.lateral["eighth"](eighth) + _doubled(fine)))
        sides = self.lateral["quarter"](torch.cat([quarter, *(of / 8 for of in body)], dim=1))
        maps = self.maps(self.merge["quarter"](functional.relu(sides + _doubled(finer))))
        for of in body:
            maps = torch.cat([maps[:, :N_BODY] + self.body_gain * of, maps[:, N_BODY:]], dim=1)
        flat = maps.detach().flatten(2)
        highest, spread = flat.amax(dim=2), flat.logsumexp(dim=2)
        evidence = torch.stack([highest, highest - spread], dim=1)
        context = torch.cat([coarse.mean(dim=(2, 3)), fine.amax(dim=(2, 3))], dim=1)
        answers = self.pooled(context).unflatten(1, (2, -1))
        return maps, answers + (self.peak * evidence[:, None]).sum(dim=2)


def _doubled(features: torch.Tensor) -> torch.Tensor:
    return functional.interpolate(features, scale_factor=2, mode="bilinear", align_corners=False)


class Decoded(nn.Module):
    """The network with its decoding: positions in pixels of the square, and probabilities.

    A position is where the expected term of OKS is highest, given the map as probabilities: a hidden hand
    that could be in one of two places near each other is put between them. The highest cell of the map,
    smoothed with OKS's own bell, is the start of a few steps of mean shift.

    Parameters
    ----------
    network : CloseRange
    squares : str
        "people" or "hands".
    """

    def __init__(self, network: CloseRange, squares: str = "people") -> None:
        super().__init__()
        self.network = network
        self.register_buffer("cells", torch.arange(GRID, dtype=torch.float32))
        sigmas = 2 * SIGMAS["halpe"][SETS[squares]] * SCALES[squares] * GRID
        self.register_buffer("sigmas", torch.tensor(sigmas, dtype=torch.float32)[:, None])
        offsets = torch.arange(-_REACH, _REACH + 1, dtype=torch.float32)
        self.register_buffer("bells", self._bell(offsets))

    def _bell(self, offsets_cells: torch.Tensor) -> torch.Tensor:
        return torch.exp(-0.5 * (offsets_cells / self.sigmas) ** 2)

    def forward(self, *features: torch.Tensor) -> torch.Tensor:
        """Shape (n, 136 or 21, 5): x, y, expected term of OKS there, in the picture, visible."""
        maps, answers = self.network(*features)
        likely = maps.flatten(2).softmax(dim=2).unflatten(2, (GRID, GRID))
        smooth, n = likely, len(self.sigmas)
        for shape, padding in (((n, 1, -1, 1), (_REACH, 0)), ((n, 1, 1, -1), (0, _REACH))):
            smooth = functional.conv2d(smooth, self.bells.reshape(shape), padding=padding, groups=n)
        best = smooth.flatten(2).argmax(dim=2)
        y, x = torch.div(best, GRID, rounding_mode="floor").float(), (best % GRID).float()
        for _ in range(_STEPS):
            rows, columns = (self._bell(self.cells - v[..., None]) for v in (y, x))
            by_row = (likely * columns[..., None, :]).sum(dim=3) * rows
            by_column = (likely * rows[..., :, None]).sum(dim=2) * columns
            expected = by_row.sum(dim=2).clamp_min(1e-6)
            y, x = ((of * self.cells).sum(dim=2) / expected for of in (by_row, by_column))
        place = [v * STRIDE + (STRIDE - 1) / 2 for v in (x, y)]
        return torch.stack([*place, expected, *answers.sigmoid().unbind(dim=1)], dim=2)
