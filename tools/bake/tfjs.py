"""Convert a TensorFlow.js graph model back to its TensorFlow graph, and that to an ONNX model.

The browser's format stores the graph as JSON and the weights separately. Recombined, they form a graph that
TensorFlow runs and tf2onnx translates, after replacing operations of the browser's program: fused
convolutions become a convolution, the addition of a bias and an activation.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence

import numpy as np
import onnx
import tensorflow as tf
import tf2onnx
from google.protobuf.json_format import ParseDict
from onnx import NodeProto, TensorProto, helper, numpy_helper

OPSET = 17
_FUSED = {"_FusedConv2D": "Conv2D", "FusedDepthwiseConv2dNative": "DepthwiseConv2dNative"}
_OWN_ATTRIBUTES = {
    "fused_ops",
    "epsilon",
    "num_args",
    "leakyrelu_alpha",
    "TArgs",
    "num_host_args",
    "host_args",
}
_Def = tf.compat.v1.NodeDef
GraphDef = tf.compat.v1.GraphDef
N_IMAGE_AXES = 4


def read_graph(content: bytes, weights: bytes) -> GraphDef:
    """The graph of a `model.json` and its weights, nothing fused in it.

    Parameters
    ----------
    content : bytes
        The JSON.
    weights : bytes
        What its weights manifest names, all files in order.

    Raises
    ------
    ValueError
        If the weights are longer or shorter than the manifest says.
    """
    model = json.loads(content)
    values = _weights(model, weights)
    graph = GraphDef()
    for row in model["modelTopology"]["node"]:
        for node in _plain(ParseDict(row, _Def())):
            if node.op == "Const":
                # The browser has no 64-bit integers; the graph says where there were some.
                value, kind = values[node.name], tf.as_dtype(node.attr["dtype"].type)
                node.attr["value"].tensor.CopyFrom(tf.make_tensor_proto(value, kind, value.shape))
            graph.node.append(node)
    return graph


def set_input(graph: GraphDef, name: str, shape: tuple[int, ...]) -> None:
    """Give the graph's input a fixed shape and floating-point values; whole numbers stay what they are."""
    (port,) = (node for node in graph.node if node.op == "Placeholder")
    port.attr["shape"].shape.CopyFrom(tf.TensorShape(shape).as_proto())
    old, new = port.attr["dtype"].type, tf.float32.as_datatype_enum
    port.attr["dtype"].type = new
    for node in graph.node:
        for key in ("SrcT", "T"):
            if name.partition(":")[0] in node.input and key in node.attr and node.attr[key].type == old:
                node.attr[key].type = new


def to_onnx(graph: GraphDef, source: str, outputs: dict[str, str]) -> onnx.ModelProto:
    """The graph as an ONNX model that takes and gives images with their channels first.

    Parameters
    ----------
    graph : GraphDef
    source : str
        Name of its input.
    outputs : dict of str to str
        TensorFlow's names by those the model's outputs get.
    """
    tf2onnx.utils.INTERNAL_NAME = 1  # a counter of this process that names new nodes
    images = [name for name in (source, *outputs.values()) if _is_image(_shape(graph, name))]
    model, _ = tf2onnx.convert.from_graph_def(
        graph,
        input_names=[source],
        output_names=list(outputs.values()),
        opset=OPSET,
        inputs_as_nchw=[name for name in images if name == source],
        outputs_as_nchw=[name for name in images if name != source],
    )
    names = {source: "image"} | {old: new for new, old in outputs.items()}
    return _in_order(model, names)


def channels_first(values: np.ndarray) -> np.ndarray:
    """An image (1, h, w, channels) of TensorFlow as the model takes and gives it; anything else as it is."""
    return np.ascontiguousarray(values.transpose(0, 3, 1, 2)) if _is_image(values.shape) else values


def halve_weights(model: onnx.ModelProto) -> None:
    """Keep the weights as 16-bit floats where these say them to the last bit; a cast makes 32 bits of them.

    ONNX Runtime casts once, when the model is opened.
    """
    casts = []
    for tensor in model.graph.initializer:
        values = numpy_helper.to_array(tensor)
        if values.dtype != np.float32 or values.size < 64:
            continue
        half = values.astype(np.float16)
        if np.array_equal(half.astype(np.float32), values):
            name = tensor.name
            tensor.CopyFrom(numpy_helper.from_array(half, f"{name}/half"))
            casts.append(helper.make_node("Cast", [tensor.name], [name], to=onnx.TensorProto.FLOAT))
    nodes = [*casts, *model.graph.node]
    del model.graph.node[:]
    model.graph.node.extend(nodes)


def run_tensorflow(graph: GraphDef, feed: dict, outputs: list[str]) -> list[np.ndarray]:
    """The graph's outputs, by TensorFlow."""
    with tf.Graph().as_default() as whole:
        tf.import_graph_def(graph, name="")
        with tf.compat.v1.Session(graph=whole) as session:
            return session.run(outputs, feed)


def _is_image(shape: Sequence[int]) -> bool:
    """Whether this is (1, side, side, channels)."""
    return len(shape) == N_IMAGE_AXES and shape[1] == shape[2]


def _shape(graph: GraphDef, name: str) -> list[int]:
    with tf.Graph().as_default() as whole:
        tf.import_graph_def(graph, name="")
        return whole.get_tensor_by_name(name).shape.as_list()


def _weights(model: dict, content: bytes) -> dict[str, np.ndarray]:
    values, at = {}, 0
    for group in model["weightsManifest"]:
        for row in group["weights"]:
            stored = np.dtype(row.get("quantization", row)["dtype"])
            count = int(np.prod(row["shape"], dtype=np.int64))
            flat = np.frombuffer(content, stored, count, at)
            at += flat.nbytes
            values[row["name"]] = flat.astype(row["dtype"]).reshape(row["shape"])
    if at != len(content):
        raise ValueError(f"weights of {len(content)} bytes; the manifest says {at}")
    return values


def _plain(node: _Def) -> Iterator[_Def]:
    """A node in TensorFlow's words."""
    if node.op == "TopKV2" and "index_type" not in node.attr:
        node.attr["index_type"].type = tf.int32.as_datatype_enum
    if node.op not in _FUSED:
        yield node
        return
    steps = [name.decode() for name in node.attr["fused_ops"].list.s]
    if steps[:1] != ["BiasAdd"] or len(steps) > 2 or len(node.input) != 3:
        raise ValueError(f"{node.name}: a convolution fused with {steps} of {list(node.input)} is not known")
    ends = [*(f"{node.name}/{k}" for k in range(len(steps))), node.name]
    convolution = _Def(name=ends[0], op=_FUSED[node.op], input=node.input[:2])
    for key, value in node.attr.items():
        if key not in _OWN_ATTRIBUTES:
            convolution.attr[key].CopyFrom(value)
    yield convolution
    for k, step in enumerate(steps):
        follower = _Def(name=ends[k + 1], op=step, input=[ends[k], *([node.input[2]] if k == 0 else [])])
        follower.attr["T"].CopyFrom(node.attr["T"])
        yield follower


def _in_order(model: onnx.ModelProto, names: dict[str, str]) -> onnx.ModelProto:
    """The model with nodes, weights and names in the order the outputs need them.

    tf2onnx's own order and names differ from run to run.

    Parameters
    ----------
    model : onnx.ModelProto
    names : dict of str to str
        What inputs and outputs are to be called.
    """
    source = {name: node for node in model.graph.node for name in node.output}
    weights = {tensor.name: tensor for tensor in model.graph.initializer}
    new, nodes, kept = {"": "", **names}, [], []
    waiting = [port.name for port in model.graph.output][::-1]
    done: set[str] = set(new) - {port.name for port in model.graph.output}
    while waiting:
        name = waiting[-1]
        node = source.get(name)
        missing = [part for part in node.input if part not in done] if node else []
        if missing:
            waiting += missing[::-1]
            continue
        waiting.pop()
        if name in done:
            continue
        for k, output in enumerate(node.output if node else [name]):
            new.setdefault(output, f"{'weights' if node is None else node.op_type}_{len(done)}_{k}")
            done.add(output)
        if node is None:
            kept.append(TensorProto.FromString(weights[name].SerializeToString()))
            kept[-1].name = new[name]
        else:
            nodes.append(NodeProto.FromString(node.SerializeToString()))
            nodes[-1].name = ""
            nodes[-1].input[:] = [new[part] for part in node.input]
            nodes[-1].output[:] = [new[part] for part in node.output]
    ports = [*model.graph.input, *model.graph.output]
    for port in ports:
        port.name = new[port.name]
    graph = helper.make_graph(nodes, "network", model.graph.input, model.graph.output, kept)
    return helper.make_model(graph, opset_imports=model.opset_import, ir_version=model.ir_version)
