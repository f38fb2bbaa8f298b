"""Separable convolutions of concatenations: without the concatenation the same comes out."""

import numpy as np
import onnxruntime
import pytest
from bake.split_channels import split_channels
from hypothesis import given
from hypothesis import strategies as st
from onnx import TensorProto, helper, numpy_helper


def network(sizes, n_out=4, side=3, each=1, bias=False, keep=False):
    """Convolutions of an image to `sizes` channels, concatenated; of each of these channels; of all."""
    rng = np.random.default_rng(sum(sizes))
    total = sum(sizes)
    weights = {f"w{k}": rng.normal(size=(size, 3, 1, 1)) for k, size in enumerate(sizes)}
    weights["each"] = rng.normal(size=(total * each, 1, side, side))
    weights["all"] = rng.normal(size=(n_out, total * each, 1, 1))
    weights["bias"] = rng.normal(size=n_out)
    nodes = [helper.make_node("Conv", ["image", f"w{k}"], [f"m{k}"]) for k in range(len(sizes))]
    nodes += [
        helper.make_node("Concat", [f"m{k}" for k in range(len(sizes))], ["together"], axis=1),
        helper.make_node("Conv", ["together", "each"], ["single"], group=total, auto_pad="SAME_UPPER"),
        helper.make_node("Conv", ["single", "all", *["bias"][:bias]], ["summed"], strides=[2, 2]),
    ]
    ports = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, [None] * 4)
        for name in ("image", "summed", *["single"][:keep])
    ]
    values = [numpy_helper.from_array(value.astype(np.float32), name) for name, value in weights.items()]
    graph = helper.make_graph(nodes, "test", ports[:1], ports[1:], values)
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)


def answers(model) -> list[np.ndarray]:
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    image = np.random.default_rng(0).normal(size=(2, 3, 6, 7)).astype(np.float32)
    return session.run(None, {"image": image})


def kinds(model) -> list[str]:
    return [node.op_type for node in model.graph.node]


@given(sizes=st.lists(st.integers(1, 40), min_size=1, max_size=4), side=st.integers(1, 3))
def test_the_outputs_are_the_same_and_nothing_odd_is_concatenated(sizes, side):
    model = network(sizes, side=side)
    split = split_channels(model)
    assert ("Concat" in kinds(split)) == (sum(sizes) % 16 == 0)
    np.testing.assert_allclose(answers(split)[0], answers(model)[0], rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize("other", [{"each": 2}, {"bias": True}, {"keep": True}])
def test_what_is_of_another_kind_stays(other):
    model = network([16, 3], **other)
    split = split_channels(model)
    assert kinds(split) == kinds(model)
    np.testing.assert_array_equal(answers(split)[0], answers(model)[0])


def test_a_concatenation_that_others_take_stays_for_them():
    model = network([16, 3])
    model.graph.output.append(helper.make_tensor_value_info("together", TensorProto.FLOAT, [None] * 4))
    split = split_channels(model)
    assert kinds(split).count("Concat") == 1 and kinds(split).count("Conv") == 2 + 4
    for found, expected in zip(answers(split), answers(model), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)


def test_the_model_that_is_given_is_left_as_it_was():
    model = network([16, 3])
    before = model.SerializeToString()
    assert split_channels(model).SerializeToString() == split_channels(model).SerializeToString()
    assert model.SerializeToString() == before
