"""MoveNet Lightning's layers that stay as they are: what the decoder reads of them.

These are features at a quarter, an eighth and a sixteenth of the input's resolution, and its own maps of 17
body points: the logarithms of what it chooses the positions by, which is weighted for one person.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
from onnx import helper, numpy_helper

from hicp_lib.core.keypoints import N_KEYPOINTS, RIGHT_HAND

N_BODY, SIDE_PX, STRIDE = 17, 192, 4
GRID = SIDE_PX // STRIDE
FROZEN = {"quarter": "Add_51_0", "eighth": "Add_86_0", "sixteenth": "Add_133_0", "body": "Div_329_0"}
"""Tensors of MoveNet's file by the names they have here."""
SETS = {"people": np.arange(N_KEYPOINTS), "hands": RIGHT_HAND}
"""Keypoints of the two networks: of everything, and of a right hand."""
SHAPES = {"quarter": (24, GRID, GRID), "eighth": (32, GRID // 2, GRID // 2)}
SHAPES |= {"sixteenth": (64, GRID // 4, GRID // 4), "body": (N_BODY, GRID, GRID)}
LEAST = 1e-5
"""What body maps are raised to before the logarithm."""
_INPUT = "Reshape_15_0"


def frozen_layers(lightning: Path, names: list[str]) -> onnx.ModelProto:
    """MoveNet's layers as a network.

    Input `image`, RGB in 0 to 255, shape (1, 3, 192, 192); outputs `names`, of `FROZEN`.
    """
    model = onnx.load(str(lightning))
    nodes = {node.output[0]: node for node in model.graph.node}
    needed, waiting = set(), [FROZEN[name] for name in names]
    while waiting:
        name = waiting.pop()
        if name in nodes and name not in needed and name != _INPUT:
            needed.add(name)
            waiting.extend(nodes[name].input)
    kept = [node for node in model.graph.node if node.output[0] in needed]
    used = {name for node in kept for name in node.input}
    weights = [weight for weight in model.graph.initializer if weight.name in used]
    numbers = {"scale": 1 / 127.5, "one": 1} | ({"least": LEAST} if "body" in names else {})
    weights += [numpy_helper.from_array(np.float32(value), name) for name, value in numbers.items()]
    first = [("Mul", ["image", "scale"], "scaled", {}), ("Sub", ["scaled", "one"], _INPUT, {})]
    last = [("Identity", [FROZEN[name]], name, {}) for name in names if name != "body"]
    if "body" in names:
        last += [("Max", [FROZEN["body"], "least"], "some", {}), ("Log", ["some"], "logarithms", {})]
        last.append(("Reshape", ["logarithms", "maps"], "of_cells", {}))
        last.append(("Transpose", ["of_cells"], "body", {"perm": [0, 3, 1, 2]}))
        weights.append(numpy_helper.from_array(np.array([1, GRID, GRID, N_BODY]), "maps"))
    first, last = (
        [helper.make_node(k, i, [o], **more) for k, i, o, more in nodes] for nodes in (first, last)
    )
    image = helper.make_tensor_value_info("image", onnx.TensorProto.FLOAT, [1, 3, SIDE_PX, SIDE_PX])
    outputs = [helper.make_tensor_value_info(n, onnx.TensorProto.FLOAT, [1, *SHAPES[n]]) for n in names]
    graph = helper.make_graph([*first, *kept, *last], "frozen", [image], outputs, weights)
    return helper.make_model(graph, opset_imports=model.opset_import, ir_version=model.ir_version)


def inputs_of(squares: str) -> list[str]:
    """What the network of "people" or "hands" reads of `FROZEN`."""
    return [name for name in FROZEN if name != "body" or squares == "people"]
