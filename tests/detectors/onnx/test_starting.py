"""Networks that would take all memory or never end are refused in one line, and take nothing along."""

import resource
import time

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from hicp_lib.core.errors import InputError
from hicp_lib.detectors.onnx import model_file
from hicp_lib.detectors.onnx.one_stage import OneStage
from hicp_lib.detectors.onnx.session import open_model
from hicp_lib.detectors.registry import make_detector
from tests.detectors.onnx.onnx_models import colour_maps_model, constant_model, save, told

node = helper.make_node
IMAGE = {"image": [1, 3, 64, 64]}
ANY = {"y": (TensorProto.FLOAT, [None])}


def refused(path, match: str, use=open_model) -> None:
    before, begin = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    with pytest.raises(InputError, match=match) as error:
        use(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)
    grown_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert grown_kb < 500_000 and time.process_time() - begin < 2


def loop(path, body, n_inputs: list[str], constants: dict, port) -> None:
    """A network that repeats a body on the mean of its image."""
    ports = [("i", TensorProto.INT64, []), ("go", TensorProto.BOOL, []), ("v", TensorProto.FLOAT, port)]
    gone = [("go_on", TensorProto.BOOL, []), ("w", TensorProto.FLOAT, port)]
    graph = helper.make_graph(
        [node("Identity", ["go"], ["go_on"]), body], "body",
        *([helper.make_tensor_value_info(*one) for one in side] for side in (ports, gone)),
    )  # fmt: skip
    nodes = [
        node("ReduceMean", ["image"], ["mean"], keepdims=0),
        node("Reshape", ["mean", "shape"], ["start"]),
    ]
    nodes.append(node("Loop", [*n_inputs, "yes", "start"], ["y"], body=graph))
    constants |= {"yes": np.array(True), "shape": np.array([1] * len(port), np.int64)}
    save(path, nodes, IMAGE, ANY, constants)


# Constants are computed when a network is opened, the rest when it is run.
BOMBS = {
    "ConstantOfShape": (
        [node("ConstantOfShape", ["size"], ["c"]), node("ReduceSum", ["c"], ["sum"], keepdims=0)],
        {"size": np.array([10**10])},
    ),
    "Range": (
        [node("Range", ["a", "b", "c"], ["r"]), node("ReduceSum", ["r"], ["sum"], keepdims=0)],
        {"a": np.float32(0), "b": np.float32(4e9), "c": np.float32(1)},
    ),
    "MatMul": (
        [node("MatMul", ["a", "b"], ["c"]), node("ReduceSum", ["c"], ["sum"], keepdims=0)],
        {"a": np.ones((60_000, 1), np.float32), "b": np.ones((1, 60_000), np.float32)},
    ),
    "Expand": (
        [node("ReduceMean", ["image"], ["m"], keepdims=0), node("Expand", ["m", "size"], ["sum"])],
        {"size": np.array([50_000, 50_000])},
    ),
    "Tile": ([node("Tile", ["image", "times"], ["sum"])], {"times": np.array([400, 1, 10, 10])}),
    "Pad": ([node("Pad", ["image", "pads"], ["sum"])], {"pads": np.array([0] * 6 + [50_000] * 2)}),
    "Resize": (
        [node("Resize", ["image", "", "scales"], ["sum"])], {"scales": np.array([1, 1, 1e4, 1e4], np.float32)}
    ),
    "Conv": ([node("Conv", ["image", "w"], ["sum"])], {"w": np.zeros((90_000, 3, 1, 1), np.float32)}),
}  # fmt: skip


@pytest.mark.parametrize("kind", BOMBS)
def test_a_network_that_asks_for_all_memory_is_refused(tmp_path, kind):
    nodes, constants = BOMBS[kind]
    path = save(tmp_path / "m.onnx", [*nodes, node("Identity", ["sum"], ["y"])], IMAGE, ANY, constants)
    if kind in ("ConstantOfShape", "Range", "MatMul"):  # numbers, not images
        path = save(
            tmp_path / "m.onnx", [*nodes, node("Add", ["image", "sum"], ["y"])], IMAGE, ANY, constants
        )
    refused(path, "GB of memory; if the file is sound, HICP_LIMITS=")


def test_a_loop_without_end_and_one_that_doubles_are_refused(tmp_path):
    path = tmp_path / "m.onnx"
    loop(path, node("Concat", ["v", "v"], ["w"], axis=0), ["n"], {"n": np.int64(60)}, [None])
    refused(path, "GB of memory")
    loop(path, node("Neg", ["v"], ["w"]), [""], {}, [])
    refused(path, "takes more than 1.5 s; if the file is sound, HICP_LIMITS=")


@pytest.mark.parametrize("shape", [[1, 3, 100_000, 100_000], [10**6, 3, 256, 192]])
def test_an_input_of_all_memory_is_refused(tmp_path, shape):
    path = save(tmp_path / "m.onnx", [node("Identity", ["image"], ["y"])], {"image": shape}, ANY, {})
    refused(path, "GB of memory")


def test_a_size_in_the_metadata_is_no_way_round(tmp_path):
    path = save(
        tmp_path / "m.onnx", [node("Identity", ["image"], ["y"])], {"image": [1, 3, None, None]}, ANY, {}
    )
    refused(told(path, imgsz="[100000, 100000]"), r"input would be \(1, 3, 100000, 100000\)", OneStage)


def test_outputs_that_are_no_numbers_are_refused(tmp_path):
    path = tmp_path / "m.onnx"
    text = {"y": (TensorProto.STRING, IMAGE["image"])}
    save(path, [node("Cast", ["image"], ["y"], to=TensorProto.STRING)], IMAGE, text, {})
    refused(path, "outputs of numbers")
    save(path, [node("Mul", ["image", "nan"], ["y"])], IMAGE, ANY, {"nan": np.float32(np.nan)})
    refused(path, "output y is NaN in places", lambda path: open_model(path).response_to_zeros())


def test_infinity_is_a_number(tmp_path):
    """Networks mask with it."""
    path = constant_model(tmp_path / "m.onnx", (1, 3, 8, 8), {"y": np.full((1, 2), -np.inf, np.float32)})
    assert open_model(path).response_to_zeros()[0].tolist() == [[-np.inf] * 2]


def test_what_else_is_wrong_with_a_graph_is_told_as_before(tmp_path, monkeypatch):
    path = tmp_path / "m.onnx"
    save(path, [node("Add", ["image", "b"], ["a"]), node("Add", ["a", "a"], ["b"])], IMAGE, {"a": [None]}, {})
    refused(path, "ONNX Runtime cannot run it .*not acyclic")
    save(path, [node("Bomb", ["image"], ["y"])], IMAGE, ANY, {})
    refused(path, "ONNX Runtime cannot run it")
    proto = onnx.load(colour_maps_model(path, (16, 16), 3))
    proto.opset_import[0].version = 999
    path.write_bytes(proto.SerializeToString())
    refused(path, "ONNX Runtime cannot run it")
    monkeypatch.setattr(model_file, "_MOST_NODES", 4)
    save(path, [node("Relu", ["image" if i == 0 else f"x{i - 1}"], [f"x{i}"]) for i in range(5)], IMAGE,
         {"x4": [None]}, {})  # fmt: skip
    refused(path, "has 5 nodes; expected a network of up to 4")


def test_a_network_of_ours_is_not_tried(monkeypatch):
    monkeypatch.setattr("hicp_lib.detectors.onnx.session.try_out", None)
    assert len(make_detector("movenet-multipose").detect(np.zeros((64, 48, 3), np.uint8))) == 0
