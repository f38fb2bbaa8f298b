"""A network in TensorFlow's frozen graph as ONNX, for ONNX Runtime, which runs it faster than OpenCV does.

A frozen graph is a protobuf message that holds a network with its weights. Of its message types only the
fields a convolutional network needs are declared here, with the numbers they have in TensorFlow's own
`graph.proto`, `node_def.proto`, `attr_value.proto`, `tensor.proto` and `tensor_shape.proto`. One operation
becomes one ONNX node. TensorFlow's arrays are (batch, height, width, channels), ONNX's (batch, channels,
height, width).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import onnx
from google.protobuf.message import DecodeError, Message
from onnx import helper, numpy_helper

from bake.messages import Messages, message_class
from hicp_lib.core.errors import InputError

_MESSAGES: Messages = {
    "Graph": {"node": (1, "[Node]")},
    "Node": {"name": (1, "string"), "op": (2, "string"), "input": (3, "[string]"), "attr": (5, "[Entry]")},
    "Entry": {"key": (1, "string"), "value": (2, "Value")},
    "Value": {"list": (1, "List"), "s": (2, "bytes"), "tensor": (8, "Tensor")},
    "List": {"i": (3, "[int64]")},
    "Tensor": {
        "dtype": (1, "int32"), "tensor_shape": (2, "Shape"), "tensor_content": (4, "bytes"),
        "float_val": (5, "[float]"), "int_val": (7, "[int32]"),
    },
    "Shape": {"dim": (2, "[Dim]")},
    "Dim": {"size": (1, "int64")},
}  # fmt: skip
_DTYPES = {1: (np.float32, "float_val"), 3: (np.int32, "int_val")}  # by TensorFlow's DataType
_PADDINGS = {b"SAME": "SAME_UPPER", b"VALID": "VALID"}
_ONNX_AXES = (0, 2, 3, 1)  # by TensorFlow's axis
_OPSET, _IR_VERSION = 17, 8


@cache
def graph_class() -> type[Message]:
    """The protobuf class of a frozen graph."""
    return message_class(_MESSAGES, "Graph")


def to_onnx(content: bytes, name: str) -> onnx.ModelProto:
    """Translate a frozen graph to an ONNX model.

    Parameters
    ----------
    content : the frozen graph
    name : what messages call it

    Returns
    -------
    The model. Its inputs are the graph's placeholders, its outputs what no operation takes; all of them
    float32, (batch, channels, height, width), of any size.

    Raises
    ------
    InputError
        If it is no frozen graph, or has an operation, or a setting of one, that is not known here.
    """
    graph = graph_class()()
    try:
        graph.ParseFromString(content)
    except DecodeError:
        raise InputError(f"{name}: is not a frozen graph or is cut off; get it again") from None
    try:
        translated = _translate(graph)
    except _Unknown as error:
        raise InputError(f"{name}: {error}; convert the network to ONNX by other means") from None
    opset = [helper.make_opsetid("", _OPSET)]
    return helper.make_model(translated, opset_imports=opset, ir_version=_IR_VERSION)


class _Unknown(ValueError):
    """A frozen graph holds what cannot be translated."""


def _translate(graph: Message) -> onnx.GraphProto:
    constants = {node.name: _array(node) for node in graph.node if node.op == "Const"}
    inputs = [node.name for node in graph.node if node.op == "Placeholder"]
    layers, weights = [], []
    for node in graph.node:
        if node.op not in ("Const", "Placeholder"):
            layer, values = _layer(node, constants)
            layers.append(layer)
            weights += values
    taken = {source for layer in layers for source in layer.input}
    outputs = [layer.name for layer in layers if layer.name not in taken]
    return helper.make_graph(layers, "graph", _ports(inputs), _ports(outputs), weights)


def _ports(names: list[str]) -> list[onnx.ValueInfoProto]:
    return [helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, [None] * 4) for name in names]


def _settings(node: Message) -> dict[str, Message]:
    return {entry.key: entry.value for entry in node.attr}


def _array(node: Message) -> np.ndarray:
    """The values of a constant."""
    value = _settings(node).get("value")
    if value is None or value.tensor.dtype not in _DTYPES:
        raise _Unknown(f"constant {node.name} is not of a known data type, float32 or int32")
    tensor = value.tensor
    dtype, field = _DTYPES[tensor.dtype]
    content = tensor.tensor_content
    values = np.frombuffer(content, dtype) if content else np.array(getattr(tensor, field), dtype)
    # Values that are all equal are written once.
    return np.resize(values, [dim.size for dim in tensor.tensor_shape.dim])


def _layer(node: Message, constants: dict[str, np.ndarray]) -> tuple[onnx.NodeProto, list[onnx.TensorProto]]:
    """The ONNX node of an operation, and its weights."""
    if node.op not in _RULES:
        raise _Unknown(f"operation {node.op} ({node.name}) is not known, only {', '.join(_RULES)}")
    try:
        kind, values, attributes = _RULES[node.op](_settings(node), constants.get(node.input[-1]))
    except (KeyError, IndexError, ValueError) as error:
        raise _Unknown(f"operation {node.op} ({node.name}) is not as known ({error})") from None
    inputs = [source for source in node.input if source not in constants]
    weights = []
    if values is not None:
        inputs.append(f"{node.name}/values")
        weights.append(numpy_helper.from_array(np.ascontiguousarray(values), inputs[-1]))
    return helper.make_node(kind, inputs, [node.name], node.name, **attributes), weights


# The rules: from an operation's settings and its last input, where that is a constant, to an ONNX node's
# kind, the values it takes, and its attributes.


def _convolution(settings: dict, weights: np.ndarray | None) -> tuple:
    return "Conv", _given(weights).transpose(3, 2, 0, 1), _sliding(settings)


def _depthwise(settings: dict, weights: np.ndarray | None) -> tuple:
    height, width, n_channels, n_each = _given(weights).shape
    values = weights.transpose(2, 3, 0, 1).reshape(n_channels * n_each, 1, height, width)
    return "Conv", values, {"group": n_channels, **_sliding(settings)}


def _bias(_: dict, bias: np.ndarray | None) -> tuple:
    return "Add", _given(bias)[:, None, None], {}


def _relu(*_: object) -> tuple:
    return "Relu", None, {}


def _max_pool(settings: dict, _: object) -> tuple:
    return "MaxPool", None, {"kernel_shape": _window(settings, "ksize"), **_sliding(settings)}


def _concatenation(_: dict, axis: np.ndarray | None) -> tuple:
    return "Concat", None, {"axis": _ONNX_AXES[int(_given(axis))]}


_RULES: dict[str, Callable[[dict, np.ndarray | None], tuple]] = {
    "Conv2D": _convolution, "DepthwiseConv2dNative": _depthwise, "BiasAdd": _bias, "Relu": _relu,
    "MaxPool": _max_pool, "ConcatV2": _concatenation,
}  # fmt: skip


def _given(constant: np.ndarray | None) -> np.ndarray:
    if constant is None:
        raise _Unknown("a computed input where others have a constant")
    return constant


def _sliding(settings: dict) -> dict:
    """How a window slides: strides and padding."""
    if "data_format" in settings and settings["data_format"].s != b"NHWC":
        raise _Unknown(f"data format {settings['data_format'].s.decode()}")
    if "dilations" in settings and set(settings["dilations"].list.i) > {1}:
        raise _Unknown(f"dilations {list(settings['dilations'].list.i)}")
    if settings["padding"].s not in _PADDINGS:
        raise _Unknown(f"padding {settings['padding'].s.decode()}")
    return {"strides": _window(settings, "strides"), "auto_pad": _PADDINGS[settings["padding"].s]}


def _window(settings: dict, key: str) -> list[int]:
    """Of a setting along all axes, the values along height and width; along the others it must be 1."""
    batch, height, width, channels = settings[key].list.i
    if (batch, channels) != (1, 1):
        raise _Unknown(f"{key} {list(settings[key].list.i)}")
    return [height, width]
