"""MoveNet Lightning's layers that stay as they are: what the decoder reads of them.

These are features at a quarter, an eighth and a sixteenth of the input's resolution, and its own maps of 17
body points, as logits.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
from onnx import helper, numpy_helper

N_KEYPOINTS, N_BODY, SIDE_PX, STRIDE = 136, 17, 192, 4
GRID = SIDE_PX // STRIDE
FROZEN = {"quarter": "Add_51_0", "eighth": "Add_86_0", "sixteenth": "Add_133_0", "body": "Conv_265_0"}
"""Tensors of MoveNet's file by the names they have here."""
SHAPES = {"quarter": (24, GRID, GRID), "eighth": (32, GRID // 2, GRID // 2)}
SHAPES |= {"sixteenth": (64, GRID // 4, GRID // 4), "body": (N_BODY, GRID, GRID)}
_INPUT = "Reshape_15_0"


def frozen_layers(lightning: Path) -> onnx.ModelProto:
    """MoveNet's layers as a network of any number of squares.

    Input `image`, RGB in 0 to 255, shape (n, 3, 192, 192); outputs the keys of `FROZEN`.
    """
    model = onnx.load(str(lightning))
    nodes = {node.output[0]: node for node in model.graph.node}
    needed, waiting = set(), list(FROZEN.values())
    while waiting:
        name = waiting.pop()
        if name in nodes and name not in needed and name != _INPUT:
            needed.add(name)
            waiting.extend(nodes[name].input)
    kept = [node for node in model.graph.node if node.output[0] in needed]
    used = {name for node in kept for name in node.input}
    weights = [weight for weight in model.graph.initializer if weight.name in used]
    scale, one = (
        numpy_helper.from_array(np.float32(v), name) for v, name in ((1 / 127.5, "scale"), (1, "one"))
    )
    first = [
        helper.make_node("Mul", ["image", "scale"], ["scaled"]),
        helper.make_node("Sub", ["scaled", "one"], [_INPUT]),
    ]
    last = [helper.make_node("Identity", [name], [ours]) for ours, name in FROZEN.items()]
    image = helper.make_tensor_value_info("image", onnx.TensorProto.FLOAT, ["n", 3, SIDE_PX, SIDE_PX])
    outputs = [helper.make_tensor_value_info(n, onnx.TensorProto.FLOAT, ["n", *SHAPES[n]]) for n in FROZEN]
    graph = helper.make_graph([*first, *kept, *last], "frozen", [image], outputs, [*weights, scale, one])
    return helper.make_model(graph, opset_imports=model.opset_import, ir_version=model.ir_version)
