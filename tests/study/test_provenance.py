"""Hashes see every byte; what cannot be known is said to be unknown."""

from __future__ import annotations

import random
import shutil
import subprocess

import pytest

from hicp_lib.core.cache import input_sha256
from hicp_lib.core.checkout import CHECKOUT
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
    files = sorted(path for path in copy.rglob("*") if path.is_file())
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
    with pytest.raises(InputError, match="nowhere: .* are not there; install hicp anew"):
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
