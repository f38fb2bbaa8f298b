"""Hashes see every byte; what cannot be known is said to be unknown."""

from __future__ import annotations

import os
import random
import shutil
import subprocess

import psutil
import pytest

from hicp_lib.core.cache import input_sha256
from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.core.environment import usable_cores
from hicp_lib.core.errors import InputError
from hicp_lib.study import provenance


@pytest.mark.parametrize("kind", ["library", "data"])
def test_one_byte_of_any_file_changes_the_hash(tmp_path, monkeypatch, kind):
    variable = f"{kind.upper()}_DIR"
    copy = tmp_path / kind
    shutil.copytree(
        getattr(provenance, variable), copy, ignore=shutil.ignore_patterns("__pycache__", ".partial-*")
    )
    monkeypatch.setattr(provenance, variable, copy)
    hash_of = getattr(provenance, f"{kind}_sha256")
    whole = hash_of()
    files = sorted(
        path for path in copy.rglob("*") if path.is_file() and path.name != "py.typed"
    )  # the mark of types is no source
    for path in random.Random(0).sample(files, min(12, len(files))):
        content = path.read_bytes()
        path.write_bytes(bytes([content[0] ^ 1]) + content[1:] if content else b"\n")
        assert hash_of() != whole, path.name
        path.write_bytes(content)
        assert hash_of() == whole
    files[0].rename(files[0].with_name(f"renamed{files[0].suffix}"))
    assert hash_of() != whole


def test_the_hash_of_nothing_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(provenance, "DATA_DIR", tmp_path / "nowhere")
    with pytest.raises(InputError, match="nowhere: .* are missing; reinstall hicp"):
        provenance.data_sha256()


def test_without_git_or_a_checkout_the_commit_is_unknown(tmp_path, monkeypatch):
    monkeypatch.setattr(provenance, "CHECKOUT", tmp_path)
    assert provenance.git_state() == {"commit": "unknown", "changed_files": None}
    monkeypatch.setattr(provenance, "CHECKOUT", None)
    assert provenance.git_state() == {"commit": "unknown", "changed_files": None}
    monkeypatch.setattr(provenance, "CHECKOUT", CHECKOUT)

    def missing(*arguments, **keywords):
        raise FileNotFoundError("git")

    monkeypatch.setattr(subprocess, "run", missing)
    assert provenance.git_state() == {"commit": "unknown", "changed_files": None}


def test_an_input_folder_is_known_by_names_sizes_and_times(tmp_path):
    (tmp_path / "a").write_bytes(b"1")
    before = input_sha256(tmp_path)
    assert input_sha256(tmp_path) == before
    (tmp_path / "b").write_bytes(b"")
    assert input_sha256(tmp_path) != before
    assert input_sha256(tmp_path / "a") != input_sha256(tmp_path / "b")


def test_links_of_a_folder_are_followed_and_circles_refused(tmp_path):
    images, elsewhere = tmp_path / "images", tmp_path / "elsewhere"
    images.mkdir()
    (elsewhere / "deeper").mkdir(parents=True)
    (elsewhere / "deeper" / "1.png").write_bytes(b"1")
    empty = input_sha256(images)
    (images / "train").symlink_to(elsewhere)
    linked = input_sha256(images)
    (elsewhere / "deeper" / "1.png").write_bytes(b"22")
    assert len({empty, linked, input_sha256(images)}) == 3
    (images / "nowhere").symlink_to(tmp_path / "none")
    input_sha256(images)
    (elsewhere / "deeper" / "back").symlink_to(images)
    with pytest.raises(InputError, match=r"images/train/deeper/back: leads to a folder that it lies in"):
        input_sha256(images)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no such files")
def test_what_is_no_file_and_no_folder_has_no_identity(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="pipe: is neither a file nor a folder"):
        input_sha256(tmp_path / "pipe")


def test_git_runs_nothing_of_a_checkout_and_speaks_of_no_other(tmp_path, monkeypatch):
    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    marker, program = tmp_path / "ran", tmp_path / "program"
    program.write_text(f"#!/bin/sh\ntouch {marker}\n")
    program.chmod(0o755)
    for name in ("core.fsmonitor", "core.pager", "core.sshCommand"):
        subprocess.run(["git", "-C", tmp_path, "config", name, program], check=True)
    monkeypatch.setattr(provenance, "CHECKOUT", tmp_path)
    assert provenance.git_state()["changed_files"] == 1 and not marker.exists()
    (tmp_path / "within").mkdir()
    monkeypatch.setattr(provenance, "CHECKOUT", tmp_path / "within")
    monkeypatch.setenv("GIT_DIR", str(tmp_path / ".git"))
    assert provenance.git_state() == {"commit": "unknown", "changed_files": None}


def test_the_stamp_tells_code_data_machine_and_libraries():
    stamp = provenance.provenance({"seed": 3})
    assert stamp["parameters"] == {"seed": 3}
    assert stamp["machine"]["cores"] == usable_cores() >= 1
    assert stamp["versions"]["python"] and stamp["versions"]["numpy"]
    assert not {"pip", "setuptools"} & set(stamp["versions"]), "only what can move a number"
    assert all(len(sha256) == 64 for sha256 in stamp["weights_sha256"].values())


def test_threads_are_told_where_they_are_limited(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    assert provenance.machine()["OMP_NUM_THREADS"] == "1"
    assert "OPENBLAS_NUM_THREADS" not in provenance.machine()


def test_memory_is_in_megabytes():
    held_mb = psutil.Process().memory_info().rss / 1e6
    assert 0.9 * held_mb <= provenance.peak_memory_mb() <= 50 * held_mb


@pytest.mark.parametrize(("changed", "words"), [(None, "abc"), (0, "abc"), (2, "abc with 2 changed files")])
def test_the_footer_shows_all_that_was_stamped(changed, words):
    stamp = {
        "parameters": {"source": "<rendered>", "names": ["ä"]},
        "git": {"commit": "abc", "changed_files": changed},
        "library_sha256": "1" * 64, "lock_sha256": "2" * 64, "data_sha256": "3" * 64,
        "weights_sha256": {"pose": "4" * 64},
        "versions": {"python": "3.11"},
        "onnx_providers": [],
        "machine": {"cpu": "x", "cores": 2},
        "wall_s": 1.25,
    }  # fmt: skip
    footer = provenance.provenance_html(stamp)
    for text in (
        f"<td>{words}</td>", "source = &#34;&#60;rendered&#62;&#34;, names = &#91;&#34;ä&#34;&#93;",
        f"library {'1' * 12}, lock {'2' * 12}, data {'3' * 12}<", f"pose {'4' * 12}<", "python 3.11",
        "ONNX Runtime not used", "cpu x, cores 2", "1.2 s",
    ):  # fmt: skip
        assert text in footer
    assert "CPUExecutionProvider, Other" in provenance.provenance_html(
        stamp | {"onnx_providers": ["CPUExecutionProvider", "Other"]}
    )
