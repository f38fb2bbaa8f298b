"""The baked network: made the same each time, from the source package that is named and no other."""

from __future__ import annotations

import io
import os
import tarfile

import bake_openpose
import numpy as np
import onnx
import pytest
from bake import source_package

from hicp_lib.core.files import sha256_bytes
from hicp_lib.detectors.openpose.networks import OpenPoseMobileNet
from hicp_lib.detectors.weights import default
from tests.tools.test_frozen_graph import Graph


def small_graph() -> bytes:
    """A graph with one separable convolution of 19 concatenated channels."""
    rng = np.random.default_rng(0)
    graph = Graph()
    parts = []
    for name, n in (("a", 16), ("b", 3)):
        graph.last = "image"
        parts.append(graph.convolution(name, rng.normal(size=(1, 1, 3, n))))
    graph.add("ConcatV2", "both", [*parts, graph.constant("axis", np.array(3, np.int32))])
    graph.convolution("each", rng.normal(size=(3, 3, 19, 1)), op="DepthwiseConv2dNative")
    graph.convolution("all", rng.normal(size=(1, 1, 19, 4)))
    return graph.bytes()


def test_two_bakes_give_the_same_bytes_and_say_what_they_are_from():
    about = {"source": "here", "licence": "MIT"}
    graph = small_graph()
    content = bake_openpose.bake(graph, about)
    assert bake_openpose.bake(graph, about) == content
    model = onnx.load_from_string(content)
    assert {entry.key: entry.value for entry in model.metadata_props} == about
    assert "Concat" not in {node.op_type for node in model.graph.node}


def test_the_committed_file_says_what_it_was_made_from():
    model = onnx.load_from_string(default.load(f"{OpenPoseMobileNet.name}.onnx"))
    about = {entry.key: entry.value for entry in model.metadata_props}
    assert about["source_sha256"] == bake_openpose.GRAPH_SHA256
    assert about["licence"] == bake_openpose.LICENCE
    assert bake_openpose.DEFAULT_OUT == default.find("openpose-mobilenet.onnx").path


def source_archive(folder, graph: bytes):
    """A source package with this graph, whose setup.py leaves a trace when it is executed."""
    archive = folder / "traced_package-1.0.tar.gz"
    setup = f"open({str(folder / 'executed')!r}, 'w').close()\nraise SystemExit('executed')\n"
    with tarfile.open(archive, "w:gz") as file:
        for name, content in (
            ("setup.py", setup.encode()),
            ("PKG-INFO", b"Metadata-Version: 2.1\nName: traced-package\nVersion: 1.0\n"),
            ("graph.pb", graph),
        ):
            info = tarfile.TarInfo(f"traced_package-1.0/{name}")
            info.size = len(content)
            file.addfile(info, io.BytesIO(content))
    return archive


def test_a_graph_is_read_only_from_the_package_and_the_bytes_that_are_named(tmp_path, monkeypatch):
    archive = source_archive(tmp_path, b"graph")
    monkeypatch.setattr(bake_openpose, "MEMBER", "traced_package-1.0/graph.pb")
    with pytest.raises(SystemExit, match="is not the source package"):
        bake_openpose.read_graph(archive)
    monkeypatch.setattr(bake_openpose, "PACKAGE_SHA256", sha256_bytes(archive.read_bytes()))
    with pytest.raises(SystemExit, match=r"graph\.pb has not SHA-256"):
        bake_openpose.read_graph(archive)
    monkeypatch.setattr(bake_openpose, "GRAPH_SHA256", sha256_bytes(b"graph"))
    assert bake_openpose.read_graph(archive) == b"graph"


def test_a_source_package_is_fetched_without_executing_it_and_only_with_its_hash(tmp_path, monkeypatch):
    packages, out = tmp_path / "packages", tmp_path / "out"
    packages.mkdir()
    out.mkdir()
    archive = source_archive(packages, b"graph")
    for name, value in (("NO_INDEX", "1"), ("FIND_LINKS", str(packages)), ("CONFIG_FILE", os.devnull)):
        monkeypatch.setenv(f"PIP_{name}", value)
    with pytest.raises(SystemExit, match="could not download"):
        source_package.download("traced-package==1.0", "0" * 64, out)
    assert not list(out.iterdir())
    source_package.download("traced-package==1.0", sha256_bytes(archive.read_bytes()), out)
    assert (out / archive.name).read_bytes() == archive.read_bytes()
    assert not (packages / "executed").exists()
