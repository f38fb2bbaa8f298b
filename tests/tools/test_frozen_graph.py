"""Frozen graphs: what ONNX Runtime makes of the translation is what TensorFlow defines."""

import numpy as np
import onnxruntime
import pytest
from bake.frozen_graph import graph_class, to_onnx
from hypothesis import given
from hypothesis import strategies as st

from hicp_lib.core.errors import InputError

FLOAT, INT32 = 1, 3


class Graph:
    """A frozen graph that grows node by node; each method gives the name of what it added."""

    def __init__(self) -> None:
        self.message = graph_class()()
        self.last = self.add("Placeholder", "image")

    def add(self, op: str, name: str, inputs=(), **settings) -> str:
        node = self.message.node.add(op=op, name=name, input=inputs)
        for key, value in settings.items():
            setting = node.attr.add(key=key).value
            if isinstance(value, bytes):
                setting.s = value
            else:
                setting.list.i.extend(value)
        self.last = name
        return name

    def constant(self, name: str, values, as_list: bool = False) -> str:
        values = np.asarray(values)
        tensor = self.message.node.add(op="Const", name=name).attr.add(key="value").value.tensor
        tensor.dtype = FLOAT if values.dtype == np.float32 else INT32
        for size in values.shape:
            tensor.tensor_shape.dim.add(size=size)
        if not as_list:
            tensor.tensor_content = values.tobytes()
        else:
            (tensor.float_val if tensor.dtype == FLOAT else tensor.int_val).extend(values.ravel().tolist())
        return name

    def convolution(self, name: str, weights: np.ndarray, stride=1, padding=b"SAME", op="Conv2D") -> str:
        inputs = [self.last, self.constant(f"{name}/weights", weights.astype(np.float32))]
        strides = [1, stride, stride, 1]
        return self.add(op, name, inputs, strides=strides, padding=padding, data_format=b"NHWC")

    def bytes(self) -> bytes:
        return self.message.SerializeToString()


def by_onnx_runtime(content: bytes, image: np.ndarray) -> np.ndarray:
    model = to_onnx(content, "graph").SerializeToString()
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    (output,) = session.run(None, {"image": image})
    return output


def windows(image: np.ndarray, side: int, stride: int, padding: bytes, fill: float = 0) -> np.ndarray:
    """What a window over (height, width, channels) sees, padded as TensorFlow does: (h, w, c, side, side)."""
    if padding == b"SAME":
        missing = [max((-(-size // stride) - 1) * stride + side - size, 0) for size in image.shape[:2]]
        sides = [(size // 2, size - size // 2) for size in missing]
        image = np.pad(image, [*sides, (0, 0)], constant_values=fill)
    return np.lib.stride_tricks.sliding_window_view(image, (side, side), (0, 1))[::stride, ::stride]


@given(
    size=st.tuples(st.integers(6, 12), st.integers(6, 12)),
    stride=st.integers(1, 2),
    side=st.integers(1, 3),
    padding=st.sampled_from([b"SAME", b"VALID"]),
)
def test_every_operation_is_as_tensorflow_defines_it(size, stride, side, padding):
    rng = np.random.default_rng(0)
    weights, each = rng.normal(size=(side, side, 3, 4)), rng.normal(size=(side, side, 4, 1))
    offset = rng.normal(size=4).astype(np.float32)
    graph = Graph()
    graph.convolution("c", weights, stride, padding)
    graph.add("BiasAdd", "b", [graph.last, graph.constant("b/values", offset, as_list=True)])
    relu = graph.add("Relu", "r", [graph.last])
    graph.convolution("d", each, op="DepthwiseConv2dNative")
    sides = [1, side, side, 1]
    pool = graph.add("MaxPool", "p", [graph.last], ksize=sides, strides=[1, 1, 1, 1], padding=b"SAME")
    graph.add("ConcatV2", "both", [relu, pool, graph.constant("axis", np.array(3, np.int32))])

    image = rng.normal(size=(*size, 3))
    first = np.einsum("hwcij,ijco->hwo", windows(image, side, stride, padding), weights) + offset
    first = np.maximum(first, 0)
    second = np.einsum("hwcij,ijc->hwc", windows(first, side, 1, b"SAME"), each[..., 0])
    second = windows(second, side, 1, b"SAME", -np.inf).max(axis=(-2, -1))
    expected = np.concatenate([first, second], axis=2).transpose(2, 0, 1)
    found = by_onnx_runtime(graph.bytes(), image.transpose(2, 0, 1)[None].astype(np.float32))
    np.testing.assert_allclose(found[0], expected, atol=1e-4)


def test_channels_that_give_several_each_are_in_tensorflows_order():
    """Output c * m + k of a depthwise convolution is input channel c under its k-th weights."""
    weights = np.arange(1, 7, dtype=np.float32).reshape(1, 1, 3, 2)
    graph = Graph()
    graph.convolution("each", weights, op="DepthwiseConv2dNative")
    image = np.arange(12, dtype=np.float32).reshape(1, 3, 2, 2)
    expected = np.repeat(image, 2, axis=1) * weights.reshape(1, 6, 1, 1)
    np.testing.assert_array_equal(by_onnx_runtime(graph.bytes(), image), expected)


def test_the_side_that_same_pads_more_is_right_and_below():
    graph = Graph()
    graph.convolution("sum", np.ones((2, 2, 1, 1)))
    image = np.arange(4, dtype=np.float32).reshape(1, 1, 2, 2)
    assert by_onnx_runtime(graph.bytes(), image).ravel().tolist() == [6, 4, 5, 3]


def test_values_that_are_all_equal_are_written_once():
    graph = Graph()
    bias = graph.constant("values", np.float32([2, 2, 2]), as_list=True)
    del graph.message.node[-1].attr[0].value.tensor.float_val[1:]
    graph.add("BiasAdd", "bias", ["image", bias])
    assert by_onnx_runtime(graph.bytes(), np.zeros((1, 3, 1, 1), np.float32)).ravel().tolist() == [2, 2, 2]


def dilated(graph: Graph) -> None:
    graph.convolution("c", np.ones((1, 1, 3, 3)))
    graph.message.node[-1].attr.add(key="dilations").value.list.i.extend([1, 2, 2, 1])


def double(graph: Graph) -> None:
    graph.constant("k", [0])
    graph.message.node[-1].attr[0].value.tensor.dtype = 2


@pytest.mark.parametrize(
    "grow, said",
    [
        (lambda g: g.add("Softmax", "s", ["image"]), "operation Softmax (s) is not known, only Conv2D"),
        (lambda g: g.convolution("c", np.ones((1, 1, 3, 3)), padding=b"EXPLICIT"), "(padding EXPLICIT)"),
        (dilated, "operation Conv2D (c) is not as known (dilations [1, 2, 2, 1])"),
        (lambda g: g.add("MaxPool", "p", ["image"], padding=b"SAME", ksize=[2, 1, 1, 1]), "(ksize [2, 1"),
        (lambda g: g.add("MaxPool", "p", ["image"], padding=b"SAME"), "(p) is not as known"),
        (lambda g: g.add("Const", "k"), "constant k is not"),
        (lambda g: g.add("Relu", "r"), "(r) is not as known"),
        (lambda g: g.add("BiasAdd", "b", ["image", "image"]), "(a computed input"),
        (double, "constant k is not"),
    ],
)
def test_what_is_not_known_is_named(grow, said):
    graph = Graph()
    grow(graph)
    with pytest.raises(InputError) as error:
        to_onnx(graph.bytes(), "net.pb")
    assert str(error.value).startswith("net.pb: ") and said in str(error.value)
    assert "\n" not in str(error.value)


def test_what_is_no_graph_is_refused():
    for content in (b"no graph", Graph().bytes()[:-1]):
        with pytest.raises(InputError, match="net.pb: is not a frozen graph"):
            to_onnx(content, "net.pb")
