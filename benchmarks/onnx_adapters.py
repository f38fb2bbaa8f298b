"""What the adapters of users' ONNX models cost on top of the network.

Networks of the real ones' size and shape with random weights are built here (chains of 3 x 3
convolutions; only the amount of arithmetic matters), and `detect` is timed with the time inside
the network taken apart. The project's floors: all but the network at most 15 % of the network's
time for networks of HRNet-W48's size, at most 3 ms per person otherwise. The median of the
repeats counts; processor time of this one thread, which tells more than wall time on a busy machine.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper
from timing import Comparison, run

from hicp_lib.detectors.onnx import session
from hicp_lib.detectors.registry import make_detector

FLOOR_RATIO, FLOOR_S = 0.15, 3e-3


def chain(nodes: list, constants: dict, channels: int, n_layers: int, stride: int, rng) -> str:
    """A strided stem and `n_layers` convolutions; the name of the last output."""
    last, fan_in = "image", 3
    for layer in range(n_layers + 1):
        weights = rng.standard_normal((channels, fan_in, 3, 3)) * (2 / (9 * fan_in)) ** 0.5
        constants[f"w{layer}"] = weights.astype(np.float32)
        strides = [stride, stride] if layer == 0 else [1, 1]
        nodes.append(
            helper.make_node("Conv", [last, f"w{layer}"], [f"c{layer}"], pads=[1, 1, 1, 1], strides=strides)
        )
        nodes.append(helper.make_node("Relu", [f"c{layer}"], [f"r{layer}"]))
        last, fan_in = f"r{layer}", channels
    return last


def write(path: Path, nodes: list, shape: list, outputs: dict[str, list], constants: dict) -> Path:
    """Save the graph; its outputs by name and shape."""
    graph = helper.make_graph(
        nodes,
        "benchmark",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, shape)],
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in outputs.items()],
        [numpy_helper.from_array(value, name) for name, value in constants.items()],
    )
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8), path)
    return path


def heat_map_network(
    path: Path, size: tuple[int, int], n_keypoints: int, channels: int, n_layers: int
) -> Path:
    """Maps at a quarter of the input (width, height)."""
    rng = np.random.default_rng(0)
    nodes, constants = [], {}
    last = chain(nodes, constants, channels, n_layers, 4, rng)
    constants["head"] = rng.standard_normal((n_keypoints, channels, 1, 1)).astype(np.float32)
    nodes.append(helper.make_node("Conv", [last, "head"], ["maps"]))
    shape = [1, 3, size[1], size[0]]
    return write(path, nodes, shape, {"maps": [1, n_keypoints, size[1] // 4, size[0] // 4]}, constants)


def simcc_network(path: Path, size: tuple[int, int], n_keypoints: int, channels: int, n_layers: int) -> Path:
    """Two vectors per keypoint, two bins per pixel of the input (width, height)."""
    rng = np.random.default_rng(0)
    nodes, constants = [], {}
    last = chain(nodes, constants, channels, n_layers, 16, rng)
    constants["head"] = rng.standard_normal((n_keypoints, channels, 1, 1)).astype(np.float32)
    constants["rows"] = np.array([1, n_keypoints, -1])
    nodes.append(helper.make_node("Conv", [last, "head"], ["maps"]))
    nodes.append(helper.make_node("Reshape", ["maps", "rows"], ["flat"]))
    n_cells = (size[0] // 16) * (size[1] // 16)
    outputs = {}
    for name, side in (("simcc_x", size[0]), ("simcc_y", size[1])):
        constants[f"to_{name}"] = rng.standard_normal((n_cells, 2 * side)).astype(np.float32)
        nodes.append(helper.make_node("MatMul", ["flat", f"to_{name}"], [name]))
        outputs[name] = [1, n_keypoints, 2 * side]
    return write(path, nodes, [1, 3, size[1], size[0]], outputs, constants)


class Stopwatch:
    """Adds up the processor time inside `OnnxModel.run`."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._run = session.OnnxModel.run
        stopwatch = self

        def run(model: session.OnnxModel, pixels: np.ndarray) -> list[np.ndarray]:
            start = time.thread_time()
            outputs = stopwatch._run(model, pixels)
            stopwatch.seconds += time.thread_time() - start
            return outputs

        session.OnnxModel.run = run


def detect_s(name: str, model: Path, stopwatch: Stopwatch, repeats: int, **options) -> list[float]:
    """Median times of an image of one person, in the network and in all else."""
    detector = make_detector(name, model=model, **options)
    image = np.random.default_rng(1).integers(0, 256, (480, 400, 3), dtype=np.uint8)
    detector.detect(image)
    times_s = []
    for _ in range(repeats):
        stopwatch.seconds = 0.0
        start = time.thread_time()
        detector.detect(image)
        times_s.append((stopwatch.seconds, time.thread_time() - start - stopwatch.seconds))
    return np.median(times_s, axis=0).tolist()


def measure(arguments) -> Iterator[Comparison]:
    cv2.setNumThreads(1)
    stopwatch, depth = Stopwatch(), arguments.depth
    with tempfile.TemporaryDirectory() as folder:
        # 33 thousand million multiplications as HRNet-W48 at 288 x 384; 2.4 as RTMPose-m at 192 x 256;
        # 3 as FastPose (ResNet-50) at 192 x 256.
        hrnet = heat_map_network(Path(folder) / "hrnet.onnx", (288, 384), 133, 96, round(57 * depth))
        rtmpose = simcc_network(Path(folder) / "rtmpose.onnx", (192, 256), 133, 384, round(9 * depth))
        fastpose = heat_map_network(Path(folder) / "fastpose.onnx", (192, 256), 136, 96, round(12 * depth))
        cases = {
            "HRNet-W48 size, DARK": ("mmpose", hrnet, {}),
            "HRNet-W48 size, DARK, flip test": ("mmpose", hrnet, {"flip_test": True}),
            "RTMPose-m size, SimCC": ("mmpose", rtmpose, {}),
            "FastPose size, heat map": ("alphapose", fastpose, {"decoding": "heatmap"}),
            "FastPose size, integral": ("alphapose", fastpose, {"decoding": "integral"}),
        }
        for title, (name, model, options) in cases.items():
            network_s, adapter_s = detect_s(name, model, stopwatch, arguments.repeats, **options)
            floor = {"most": FLOOR_RATIO} if model == hrnet else {"most_s": FLOOR_S}
            yield Comparison(f"all but the network, {title}", adapter_s, "the network", network_s, **floor)


if __name__ == "__main__":
    run(measure, __doc__, repeats=(5, 1), depth=(1.0, 0.0))
