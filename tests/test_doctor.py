"""The doctor finds what is missing and says how to mend it."""

from __future__ import annotations

import sys

import pytest

from hicp_lib import cli, doctor, system_libraries


def test_locked_versions_are_those_of_this_python_and_system():
    lock = (
        "# made by make lock\nnumpy==2.4.6 ; python_full_version < '3' \\\n    --hash=sha256:a\n"
        "numpy==2.5.5 ; python_full_version >= '3' \\\n    --hash=sha256:b\npywinpty==1 ; os_name == 'none'\n"
        "tqdm==4.70.1 \\\n    --hash=sha256:c\n"
    )
    assert dict(doctor.locked_versions(lock)) == {"numpy": "2.5.5", "tqdm": "4.70.1"}


def test_a_package_that_differs_from_the_lock_is_named(tmp_path):
    lock = tmp_path / "environment.lock"
    lock.write_text("pytest==0.0.1 \\\n    --hash=sha256:a\nno-such-package==1 \\\n    --hash=sha256:b\n")
    check = doctor.check_locked_versions(lock)
    assert not check.is_ok
    assert "2 differ: pytest " in check.finding
    assert "no-such-package none instead of 1" in check.finding
    assert not doctor.check_locked_versions(tmp_path / "none.lock").is_ok


def test_a_library_that_does_not_load_is_named(tmp_path, monkeypatch):
    (tmp_path / "brokenlibrary.py").write_text("raise ImportError('libGL.so.1: cannot open\\nshared object')")
    monkeypatch.syspath_prepend(tmp_path)
    check = doctor.check_imports(("json", "brokenlibrary"))
    assert not check.is_ok
    assert check.finding == "brokenlibrary (libGL.so.1: cannot open shared object)"


def test_missing_weights_are_named_with_the_command(tmp_path, monkeypatch):
    monkeypatch.setenv("HICP_CACHE", str(tmp_path))
    check = doctor.check_weights()
    assert not check.is_ok
    assert "absent" in check.finding
    assert check.remedy == "hicp models fetch"


def test_a_folder_that_cannot_be_written_is_found(tmp_path):
    writable, room = doctor.check_folder("cache", tmp_path / "new" / "folder", "set HICP_CACHE")
    assert writable.is_ok
    assert room.is_ok
    (tmp_path / "file").write_text("")
    writable, _ = doctor.check_folder("cache", tmp_path / "file" / "folder", "set HICP_CACHE")
    assert not writable.is_ok
    assert writable.remedy == "set HICP_CACHE"


@pytest.mark.skipif(sys.platform != "linux", reason="shared libraries of Debian")
def test_missing_system_libraries_are_named_by_package(monkeypatch):
    names = {"libc.so.6": "libc6", "libnone.so.1": "libnone1"}
    monkeypatch.setattr(system_libraries, "DEBIAN_PACKAGES", names)
    assert system_libraries.missing_packages() == ["libnone1"]
    monkeypatch.setattr(doctor, "missing_packages", lambda: ["libegl1", "libgl1"])
    check = doctor.check_system_libraries()
    assert not check.is_ok
    assert check.remedy == "sudo apt-get install libegl1 libgl1"


def test_the_command_prints_one_line_a_check_and_its_exit_code_tells(capsys, monkeypatch):
    checks = [doctor.Check("a", True, "fine"), doctor.Check("b", False, "gone", "do this")]
    monkeypatch.setattr(doctor, "run_checks", lambda: checks)
    assert cli.run(["doctor"]) == 2
    assert capsys.readouterr().out.splitlines() == ["ok   a: fine", "FAIL b: gone; remedy: do this"]
    monkeypatch.setattr(doctor, "run_checks", lambda: checks[:1])
    assert cli.run(["doctor"]) == 0
