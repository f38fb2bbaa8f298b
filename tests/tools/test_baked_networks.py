"""The networks in data/weights: what they were made from is told in them."""

import re
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import numpy_helper

from hicp_lib.detectors.registry import DETECTORS
from hicp_lib.detectors.weights import default

TOOL = (Path(__file__).parents[2] / "tools" / "bake_tfjs.py").read_text()
PACKAGE = re.search(r'PACKAGE = "(.*)"', TOOL).group(1)
NAMES = ("movenet-thunder", "movenet-lightning", "movenet-multipose", "posenet", "nanodet")
MAX_ALL_BYTES = 50_000_000  # of others' networks
MAX_BYTES = 12_000_000  # of one of the study's own


def network(name: str) -> onnx.ModelProto:
    return onnx.load_from_string(default.load(f"{name}.onnx"))


@pytest.mark.parametrize("name", NAMES)
def test_source_and_licence_are_told(name):
    about = {entry.key: entry.value for entry in network(name).metadata_props}
    assert about["source"] == f"{PACKAGE}: {name}"
    assert about["licence"].startswith(default.find(f"{name}.onnx").licence)
    assert f'"{name}": Network(' in TOOL and len(about["source_sha256"]) == 64


@pytest.mark.parametrize("name", [name for name in NAMES if name != "posenet"])
def test_weights_are_kept_in_16_bits(name):
    """PoseNet's were published in 32 bits, of which 16 would lose some."""
    kinds = [numpy_helper.to_array(tensor) for tensor in network(name).graph.initializer]
    large = sum(values.nbytes for values in kinds if values.dtype == np.float32)
    assert large < 0.02 * sum(values.nbytes for values in kinds)


def test_all_of_them_are_small():
    sizes = {name: of.size_bytes for name, of in default.registry().items() if of.distribution is None}
    ours = [sizes.pop(name) for name in ("closerange.onnx", "closerange-hands.onnx")]
    assert max(ours) < MAX_BYTES and sum(sizes.values()) < MAX_ALL_BYTES


@pytest.mark.parametrize("name", [*NAMES[:4], "openpose-mobilenet"])
def test_the_number_of_parameters_is_right(name):
    counted = sum(int(np.prod(tensor.dims)) for tensor in network(name).graph.initializer)
    assert DETECTORS[name].facts.n_parameters == pytest.approx(counted, rel=0.01)
