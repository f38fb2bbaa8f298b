"""Networks and bundles of networks: of sizes, shapes and answers that cannot be."""

from __future__ import annotations

import io
import warnings
import zipfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from tests.detectors.onnx.onnx_models import constant_model
from tests.hostile.case import Case
from tests.hostile.good import READERS

FLOAT = TensorProto.FLOAT
node, port = helper.make_node, helper.make_tensor_value_info
IMAGE = [1, 3, 64, 48]


def network(
    nodes, constants=None, outputs=(("maps", [1, 133, 16, 12]),), opset: int = 17, image=IMAGE
) -> bytes:
    """A network from an image to maps, made of these nodes."""
    graph = helper.make_graph(
        nodes, "g",
        [port("image", FLOAT, image)],
        [port(name, FLOAT, shape) for name, shape in outputs],
        [numpy_helper.from_array(np.asarray(value), name) for name, value in (constants or {}).items()],
    )  # fmt: skip
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)], ir_version=8)
    return model.SerializeToString()


ZERO = {"zero": np.zeros((1, 133, 16, 12), np.float32)}


def of_shape(*sizes: int) -> bytes:
    """A constant of these sizes, a few bytes in the file."""
    nodes = [node("ConstantOfShape", ["shape"], ["big"]), node("ReduceMax", ["big"], ["most"]),
             node("ReduceMax", ["image"], ["seen"]), node("Add", ["most", "seen"], ["sum"]),
             node("Add", ["sum", "zero"], ["maps"])]  # fmt: skip
    return network(nodes, ZERO | {"shape": np.array(sizes)})


def of_input_times(scale: float) -> bytes:
    nodes = [node("Resize", ["image", "", "scales"], ["big"], mode="nearest"),
             node("ReduceMax", ["big"], ["most"]), node("Add", ["most", "zero"], ["maps"])]  # fmt: skip
    return network(nodes, ZERO | {"scales": np.array([1, 1, scale, scale], np.float32)})


def tiled(times: int) -> bytes:
    nodes = [node("Tile", ["image", "times"], ["big"]), node("ReduceMax", ["big"], ["most"]),
             node("Add", ["most", "zero"], ["maps"])]  # fmt: skip
    return network(nodes, ZERO | {"times": np.array([1, times, times, 1])})


def ranged() -> bytes:
    nodes = [node("Range", ["from", "to", "by"], ["big"]), node("ReduceMax", ["big"], ["most"]),
             node("ReduceMax", ["image"], ["seen"]), node("Add", ["most", "seen"], ["sum"]),
             node("Add", ["sum", "zero"], ["maps"])]  # fmt: skip
    return network(nodes, ZERO | {"from": np.float32(0), "to": np.float32(1e10), "by": np.float32(1)})


def endless_loop() -> bytes:
    """A loop of 2^62 rounds."""
    body = helper.make_graph(
        [node("Identity", ["on"], ["on_then"]), node("Add", ["x", "x"], ["y"])], "body",
        [port("i", TensorProto.INT64, []), port("on", TensorProto.BOOL, []), port("x", FLOAT, [])],
        [port("on_then", TensorProto.BOOL, []), port("y", FLOAT, [])],
    )  # fmt: skip
    nodes = [node("ReduceMax", ["image"], ["seen"], keepdims=0),
             node("Loop", ["n", "true", "seen"], ["last"], body=body),
             node("Add", ["last", "zero"], ["maps"])]  # fmt: skip
    return network(nodes, ZERO | {"n": np.array(2**62), "true": np.array(True)})


def products(n: int, side: int) -> bytes:
    """Products of constants, which are computed when the network is opened."""
    names = ["big", *(f"n{k}" for k in range(n))]
    nodes = [node("ConstantOfShape", ["shape"], ["big"])]
    nodes += [node("MatMul", [a, "big"], [b]) for a, b in zip(names, names[1:], strict=False)]
    nodes += [node("ReduceMax", [names[-1]], ["most"]), node("ReduceMax", ["image"], ["seen"]),
              node("Add", ["most", "seen"], ["sum"]), node("Add", ["sum", "zero"], ["maps"])]  # fmt: skip
    return network(nodes, ZERO | {"shape": np.array([side, side])})


def cyclic() -> bytes:
    return network(
        [
            node("Add", ["image", "b"], ["a"]),
            node("Add", ["a", "image"], ["b"]),
            node("Identity", ["a"], ["maps"]),
        ]
    )


def many_nodes(n: int) -> bytes:
    names = ["image", *(f"n{k}" for k in range(n))]
    nodes = [node("Identity", [a], [b]) for a, b in zip(names, names[1:], strict=False)]
    nodes += [node("ReduceMax", [names[-1]], ["most"]), node("Add", ["most", "zero"], ["maps"])]
    return network(nodes, ZERO)


def doubled(n: int) -> bytes:
    """A tensor that is joined to itself again and again."""
    names = ["image", *(f"n{k}" for k in range(n))]
    nodes = [node("Concat", [a, a], [b], axis=1) for a, b in zip(names, names[1:], strict=False)]
    nodes += [node("ReduceMax", [names[-1]], ["most"]), node("Add", ["most", "zero"], ["maps"])]
    return network(nodes, ZERO)


def external(location: str) -> bytes:
    model = onnx.ModelProto.FromString(
        network([node("Add", ["image", "weights"], ["maps"])], {"weights": np.zeros(3, np.float32)})
    )
    tensor = model.graph.initializer[0]
    tensor.ClearField("raw_data")
    tensor.data_location = TensorProto.EXTERNAL
    tensor.external_data.add(key="location", value=location)
    return model.SerializeToString()


def of_strings() -> bytes:
    graph = helper.make_graph(
        [node("Identity", ["text"], ["maps"])], "g", [port("text", TensorProto.STRING, [1])],
        [port("maps", TensorProto.STRING, [1])],
    )  # fmt: skip
    return helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8
    ).SerializeToString()


def answers(value: float) -> bytes:
    nodes = [
        node("ReduceMax", ["image"], ["seen"]),
        node("Mul", ["seen", "value"], ["many"]),
        node("Add", ["many", "zero"], ["maps"]),
    ]
    return network(nodes, ZERO | {"value": np.float32(value)})


def big_input(side: int) -> bytes:
    nodes = [node("ReduceMax", ["image"], ["most"]), node("Add", ["most", "zero"], ["maps"])]
    return network(nodes, ZERO, image=[1, 3, side, side])


NETWORKS: dict[str, Callable[[], bytes]] = {
    "a constant of 40 GB": partial(of_shape, 10**10),
    "a constant of 2^62 elements": partial(of_shape, 2**31, 2**31),
    "a constant of negative size": partial(of_shape, -5),
    "the picture 10,000 times as large": partial(of_input_times, 1e4),
    "the picture a million times": partial(tiled, 1000),
    "a range of 1e10": ranged,
    "a loop without end": endless_loop,
    "products of constants": partial(products, 20, 4096),
    "a circle": cyclic,
    "300,000 nodes": partial(many_nodes, 300_000),
    "doubled 40 times": partial(doubled, 40),
    "weights in ../x": partial(external, "../x"),
    "weights in /etc/passwd": partial(external, "/etc/passwd"),
    "operators of another domain": lambda: network([node("Evil", ["image"], ["maps"], domain="x.y")]),
    "an operator nobody knows": lambda: network([node("Evil", ["image"], ["maps"])]),
    "opset 9999": lambda: network([node("Identity", ["image"], ["maps"])], opset=9999),
    "texts": of_strings,
    "no nodes": lambda: network([]),
    "input of 100,000 pixels a side": partial(big_input, 100_000),
    "input of 0 pixels": partial(big_input, 0),
    "half of it": lambda: answers(1)[: len(answers(1)) // 2],
    "answers of another shape": lambda: network(
        [node("ReduceMax", ["image"], ["maps"])], outputs=(("maps", [1, 1, 1, 1]),)
    ),
    "maps of 7 points": lambda: network(
        [node("ReduceMax", ["image"], ["most"]), node("Add", ["most", "small"], ["maps"])],
        {"small": np.zeros((1, 7, 16, 12), np.float32)}, outputs=(("maps", [1, 7, 16, 12]),),
    ),
}  # fmt: skip
ANSWERS = {"NaN": float("nan"), "inf": float("inf"), "1e38": 1e38, "-1e38": -1e38}


def _boxes(value: float, folder: Path) -> None:
    found = np.array([[[value, 5, 50, 48, 0.9]]], np.float32)
    constant_model(folder / "person.onnx", (1, 3, 64, 64), {"dets": found})


def bundle(*members: tuple[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a name may be there twice
        for name, content in members:
            archive.writestr(name, content)
    return stream.getvalue()


POSE = ("pose_detector.tflite", "pose_landmarks_detector.tflite")
HAND = ("hand_detector.tflite", "hand_landmarks_detector.tflite")
MODEL = b"\x1c\0\0\0TFL3" + bytes(range(256))
BUNDLES: dict[str, Callable[[], bytes]] = {
    "members of noise": lambda: bundle(*[(name, MODEL) for name in POSE]),
    "members of hands": lambda: bundle(*[(name, MODEL) for name in HAND]),
    "0 bytes each": lambda: bundle(*[(name, b"") for name in POSE]),
    "members of 2 GB of zeros": lambda: _zip_bomb(),
    "one member": lambda: bundle((POSE[0], MODEL)),
    "the same member twice": lambda: bundle((POSE[0], MODEL), (POSE[0], MODEL)),
    "members out of the folder": lambda: bundle(("../../x", MODEL), *[(name, MODEL) for name in POSE]),
    "half of it": lambda: bundle(*[(name, MODEL) for name in POSE])[:200],
    "offsets beyond the model": lambda: bundle(*[(name, b"\xff\xff\xff\x7fTFL3" ) for name in POSE]),
    "a wrong checksum": lambda: bundle(*[(name, MODEL) for name in POSE]).replace(b"TFL3", b"TFL4", 1),
}  # fmt: skip


def _zip_bomb() -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name in POSE:
            with archive.open(name, "w", force_zip64=True) as member:
                for _ in range(64):
                    member.write(bytes(2**24))
    return stream.getvalue()


def _put(name: str, content: Callable[[], bytes], folder: Path) -> None:
    (folder / name).write_bytes(content())


DETECT = READERS["detect model"][0] + " --boxes image"


def cases() -> Iterator[Case]:
    for kind, content in NETWORKS.items():
        put = partial(_put, "model.onnx", content)
        yield Case(f"network: detect: {kind}", DETECT, put)
        yield Case(f"network: show: {kind}", READERS["models show"][0], put, exits=(0, 2), notes=True)
        yield Case(f"network: inspect: {kind}", "inspect model.onnx", put, exits=(0, 2))
    for name in ("alphapose", "openpose", "detectron2", "rtmo"):
        command = f"detect --detector {name} --model model.onnx --images pictures --out out.json"
        for kind in (
            "a constant of 40 GB",
            "texts",
            "input of 100,000 pixels a side",
            "answers of another shape",
        ):
            yield Case(f"network: {name}: {kind}", command, partial(_put, "model.onnx", NETWORKS[kind]))
    for kind, value in ANSWERS.items():
        exits = (2,) if kind == "NaN" else (0, 2)
        put = partial(_put, "model.onnx", partial(answers, value))
        yield Case(f"network: answers of {kind}", DETECT, put, exits=exits, notes=True)
        command = READERS["detect person model"][0]
        yield Case(f"network: boxes of {kind}", command, partial(_boxes, value), exits=(0, 2), notes=True)
    command, name = READERS["task bundle"]
    for kind, content in BUNDLES.items():
        yield Case(f"bundle: {kind}", command, partial(_put, name, content))
        yield Case(f"bundle: inspect: {kind}", f"inspect {name}", partial(_put, name, content), exits=(0, 2))
