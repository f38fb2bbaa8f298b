"""Make an ONNX file of a network of OpenPose's: its Caffe description (.prototxt) and weights (.caffemodel).

    python tools/export_openpose.py pose_deploy.prototxt pose_iter_584000.caffemodel body_25.onnx

needs the package onnx. Bodies (COCO, BODY_25) and hands; height and width are dynamic, and the weights are
inside the file.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from bake.messages import Messages, message_class
from google.protobuf import text_format
from google.protobuf.message import DecodeError, Message
from onnx import ModelProto, NodeProto, TensorProto, helper, numpy_helper

from hicp_lib.core.files import write_bytes

# Of Caffe's own `caffe.proto`, what these networks use; `layers` is how files of before 2014 call `layer`.
MESSAGES: Messages = {
    "Net": {"input": (3, "[string]"), "layer": (100, "[Layer]"), "layers": (2, "[OldLayer]")},
    "Layer": {
        "name": (1, "string"),
        "type": (2, "string"),
        "bottom": (3, "[string]"),
        "top": (4, "[string]"),
        "blobs": (7, "[Blob]"),
        "convolution_param": (106, "Convolution"),
        "pooling_param": (121, "Pooling"),
    },
    "OldLayer": {"name": (4, "string"), "blobs": (6, "[Blob]")},
    "Blob": {"data": (5, "[float]")},
    "Convolution": {
        "num_output": (1, "uint32"),
        "pad": (3, "[uint32]"),
        "kernel_size": (4, "[uint32]"),
        "stride": (6, "[uint32]"),
        "dilation": (18, "[uint32]"),
    },
    "Pooling": {"kernel_size": (2, "uint32"), "stride": (3, "uint32")},
}
_OPSET, _IR_VERSION = 17, 8


def to_onnx(description: str, weights: bytes) -> ModelProto:
    """The ONNX network of a Caffe description with Caffe weights.

    Raises
    ------
    SystemExit
        If either is no Caffe file, the weights lack a layer's or are of another size, or a layer is of a
        kind these networks do not have.
    """
    net_class = message_class(MESSAGES, "Net")
    try:
        net = text_format.Parse(description, net_class(), allow_unknown_field=True)
        trained = net_class.FromString(weights)
    except text_format.ParseError as error:
        raise SystemExit(f"the description is not a .prototxt file ({error})") from None
    except DecodeError:
        raise SystemExit("the weights are not a .caffemodel file, or it is cut off") from None
    blobs = {layer.name: layer.blobs for layer in (*trained.layers, *trained.layer) if layer.blobs}
    nodes, constants = [], []
    newest = {name: name for name in net.input}  # layers that work in place give their values a new name
    for layer in net.layer:
        inputs, parameters = [newest[name] for name in layer.bottom], _parameters(layer, blobs)
        newest[layer.top[0]] = layer.name
        constants += [numpy_helper.from_array(value, name) for name, value in parameters.items()]
        nodes.append(_node(layer, [*inputs, *parameters]))
    used = {name for layer in net.layer for name in layer.bottom}
    outputs = [newest[name] for name in newest if name not in used]
    image = helper.make_tensor_value_info(net.input[0], TensorProto.FLOAT, [1, 3, "height", "width"])
    maps = [helper.make_tensor_value_info(name, TensorProto.FLOAT, None) for name in outputs]
    graph = helper.make_graph(nodes, "openpose", [image], maps, constants)
    opset = helper.make_opsetid("", _OPSET)
    return helper.make_model(graph, opset_imports=[opset], ir_version=_IR_VERSION)


def _parameters(layer: Message, blobs: dict) -> dict[str, np.ndarray]:
    if layer.type not in ("Convolution", "PReLU"):
        return {}
    if layer.name not in blobs:
        raise SystemExit(f"layer {layer.name!r} has no weights; give the .caffemodel of this .prototxt")
    values = [np.array(blob.data, np.float32) for blob in blobs[layer.name]]
    if layer.type == "PReLU":
        return {f"{layer.name}_slope": values[0].reshape(-1, 1, 1)}
    convolution = layer.convolution_param
    side = convolution.kernel_size[0]
    if (
        len(values) != 2
        or len(values[1]) != convolution.num_output
        or len(values[0]) % (len(values[1]) * side**2)
    ):
        raise SystemExit(
            f"layer {layer.name!r} has weights of another size; give the .caffemodel of this .prototxt"
        )
    weights = values[0].reshape(len(values[1]), -1, side, side)
    return {f"{layer.name}_weights": weights, f"{layer.name}_bias": values[1]}


def _node(layer: Message, inputs: list[str]) -> NodeProto:
    convolution, pool = layer.convolution_param, layer.pooling_param
    kinds: dict[str, tuple[str, dict]] = {
        "Convolution": ("Conv", {"pads": 4 * [*convolution.pad, 0][:1],
                                 "strides": 2 * [*convolution.stride, 1][:1],
                                 "dilations": 2 * [*convolution.dilation, 1][:1]}),
        "Pooling": ("MaxPool", {"kernel_shape": 2 * [pool.kernel_size], "strides": 2 * [pool.stride],
                                "ceil_mode": 1}),
        "Concat": ("Concat", {"axis": 1}),
        "ReLU": ("Relu", {}),
        "PReLU": ("PRelu", {}),
    }  # fmt: skip
    if layer.type not in kinds:
        raise SystemExit(f"layer {layer.name!r} is a {layer.type}; expected one of {', '.join(kinds)}")
    operator, attributes = kinds[layer.type]
    return helper.make_node(operator, inputs, [layer.name], layer.name, **attributes)


def main() -> None:
    """Read the Caffe files, write the ONNX file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ("description", "weights", "out"):
        parser.add_argument(name, type=Path)
    arguments = parser.parse_args()
    model = to_onnx(arguments.description.read_text(), arguments.weights.read_bytes())
    write_bytes(arguments.out, model.SerializeToString(deterministic=True))


if __name__ == "__main__":
    main()
