"""Small ONNX models that the tests build: networks whose answers are known."""

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

# What the two systems take off and divide by; the test networks undo it, so that maps are colours in [0, 1].
MMPOSE_PIXELS = np.array([123.675, 116.28, 103.53]), np.array([58.395, 57.12, 57.375])
ALPHAPOSE_PIXELS = np.array([0.406, 0.457, 0.480]) * 255, np.array([255.0, 255, 255])

_OPSET = [helper.make_opsetid("", 17)]


def save(path: Path, nodes, inputs: dict, outputs: dict, constants: dict, dtype=TensorProto.FLOAT) -> Path:
    """Write a graph; a port is a list of sizes (None is open), or a pair of type and such a list."""

    def port(name, shape):
        kind, shape = shape if isinstance(shape, tuple) else (dtype, shape)
        dims = [f"{name}_{i}" if size is None else size for i, size in enumerate(shape)]
        return helper.make_tensor_value_info(name, kind, dims)

    graph = helper.make_graph(
        nodes,
        "test",
        [port(name, shape) for name, shape in inputs.items()],
        [port(name, shape) for name, shape in outputs.items()],
        [numpy_helper.from_array(np.asarray(value), name) for name, value in constants.items()],
    )
    onnx.save(helper.make_model(graph, opset_imports=_OPSET, ir_version=8), path)
    return path


def constant_model(path: Path, input_shape, outputs: dict[str, np.ndarray], *, open_batch=False) -> Path:
    """A network that answers the same whatever it sees; with an open batch, for each image alike."""
    nodes, constants, shapes = [], {}, {}
    # The input must be used, or exporters and runtimes drop it: add 0 times its mean.
    axes = list(range(1 if open_batch else 0, len(input_shape)))
    nodes.append(helper.make_node("ReduceMean", ["image"], ["mean"], axes=axes, keepdims=0))
    constants["zero"] = np.zeros((), np.float32)
    nodes.append(helper.make_node("Mul", ["mean", "zero"], ["nothing"]))
    for name, value in outputs.items():
        value = np.asarray(value)
        kind = helper.np_dtype_to_tensor_dtype(value.dtype)
        constants[f"value_{name}"] = value
        addend = "nothing"
        if open_batch:
            constants[f"shape_{name}"] = np.array([-1] + [1] * (value.ndim - 1))
            nodes.append(helper.make_node("Reshape", ["nothing", f"shape_{name}"], [f"rows_{name}"]))
            addend = f"rows_{name}"
        if kind != TensorProto.FLOAT:
            nodes.append(helper.make_node("Cast", [addend], [f"cast_{name}"], to=kind))
            addend = f"cast_{name}"
        nodes.append(helper.make_node("Add", [f"value_{name}", addend], [name]))
        shapes[name] = (kind, [None, *value.shape[1:]] if value.ndim else [])
    shape = [None, *input_shape[1:]] if open_batch else list(input_shape)
    return save(path, nodes, {"image": shape}, shapes, constants)


def told(path: Path, **metadata: str) -> Path:
    """Write metadata into a model's file."""
    proto = onnx.load(path)
    helper.set_model_props(proto, metadata)
    onnx.save(proto, path)
    return path


def _colour_weights(n_keypoints, side, pixels):
    """Convolution that averages channel k % 3 for keypoint k and gives 0 for black, 1 for white."""
    mean, std = pixels
    weights = np.zeros((n_keypoints, 3, side, side), np.float32)
    for k in range(n_keypoints):
        weights[k, k % 3] = std[k % 3] / 255 / side**2
    return {"weights": weights, "bias": (mean[np.arange(n_keypoints) % 3] / 255).astype(np.float32)}


def colour_maps_model(path: Path, size_px, n_keypoints: int, batch=None, pixels=MMPOSE_PIXELS) -> Path:
    """Heat maps from colours: keypoint k is where channel k % 3 of the image is highest.

    Map cell i is input pixel 4 i (the networks' convention), averaged over the 5 x 5 pixels around it.
    """
    width, height = size_px
    node = helper.make_node("Conv", ["image", "weights", "bias"], ["maps"], strides=[4, 4], pads=[2, 2, 1, 1])
    return save(
        path,
        [node],
        {"image": [batch, 3, height, width]},
        {"maps": [batch, n_keypoints, height and height // 4, width and width // 4]},
        _colour_weights(n_keypoints, 5, pixels),
    )


def colour_simcc_model(path: Path, size_px, n_keypoints: int, batch=None, shuffles=False) -> Path:
    """SimCC from colours: keypoint k is where channel k % 3 is highest; two bins per pixel."""
    width, height = size_px
    make = helper.make_node
    nodes = [make("Conv", ["image", "weights", "bias"], ["maps"], pads=[1, 1, 1, 1])]
    constants = _colour_weights(n_keypoints, 3, MMPOSE_PIXELS) | {"twice": np.array([1, 1, 2], np.float32)}
    for name, axis in (("simcc_x", 2), ("simcc_y", 3)):
        nodes.append(make("ReduceMax", ["maps"], [f"{name}_1"], axes=[axis], keepdims=0))
        nodes.append(
            make("Resize", [f"{name}_1", "", "twice"], [name], mode="nearest", nearest_mode="floor",
                 coordinate_transformation_mode="asymmetric")
        )  # fmt: skip
    if shuffles:
        constants["unused"] = np.zeros((1, 4, 1, 1), np.float32)
        nodes.append(make("DepthToSpace", ["unused"], ["shuffled"], blocksize=2))
    return save(
        path,
        nodes,
        {"image": [batch, 3, height, width]},
        {"simcc_x": [batch, n_keypoints, 2 * width], "simcc_y": [batch, n_keypoints, 2 * height]},
        constants,
    )
