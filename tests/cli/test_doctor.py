"""The doctor finds what is missing and says how to mend it."""

from __future__ import annotations

import sys
import time
import tomllib
from types import SimpleNamespace

import psutil
import pytest
from packaging.specifiers import SpecifierSet

from hicp_lib.cli import doctor, system_libraries
from hicp_lib.cli import main as cli
from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.core.errors import InputError
from hicp_lib.detectors.registry import default_detector_names


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
    assert check.is_ok is False
    assert "2 differ: pytest " in check.finding
    assert "no-such-package none instead of 1" in check.finding
    assert doctor.check_locked_versions(tmp_path / "none.lock").is_ok is False


def test_another_opencv_is_named_with_a_remedy(tmp_path, monkeypatch):
    assert doctor.check_opencv().finding.startswith("opencv-python-headless ")
    monkeypatch.setattr("sys.path", [str(tmp_path)])
    reinstall = "pip install --force-reinstall --no-deps opencv-python-headless"
    assert (doctor.check_opencv().is_ok, doctor.check_opencv().remedy) == (False, reinstall)
    for name in ("opencv-python-headless", "opencv-contrib-python"):
        info = tmp_path / f"{name.replace('-', '_')}-5.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 5.0\n")
    check = doctor.check_opencv()
    assert check.is_ok is False
    assert check.finding == "opencv-contrib-python instead of opencv-python-headless"
    assert check.remedy == f"pip uninstall -y opencv-contrib-python; {reinstall}"


def trial(code: str, limit_s: float = 60.0) -> doctor.Check:
    return doctor.check_probe("renderer", (sys.executable, "-c", code), limit_s)


def test_a_trial_says_what_it_found():
    check = trial("print('noise'); print('[true, \"two people\"]')")
    assert str(check) == "ok   renderer: two people"


@pytest.mark.parametrize(
    ("code", "finding"),
    [
        ("os.abort()", "its process died of SIGABRT (Check failed: it broke)"),
        ("ctypes.string_at(0)", "its process died of SIGSEGV (Check failed: it broke)"),
        ("os.kill(os.getpid(), signal.SIGKILL)", "its process died of SIGKILL (Check failed: it broke)"),
        ("os._exit(7)", "its process died of exit code 7 (Check failed: it broke)"),
    ],
)
def test_a_trial_that_dies_is_one_line_with_its_signal_and_its_last_words(code, finding):
    check = trial(f"import ctypes, os, signal; os.write(2, b'Check failed:  it broke\\n\\n'); {code}")
    assert check.is_ok is False
    assert check.finding == finding
    assert "/proc" in check.remedy and "make report" in check.remedy


@pytest.mark.parametrize(
    ("library", "remedy"),
    [
        ("libGLESv2.so.2", "sudo apt-get install libgles2"),
        ("libnone.so.1", "install the system's package with libnone.so.1"),
    ],
)
def test_a_missing_shared_library_is_told_with_its_package(monkeypatch, library, remedy):
    words = f"{library}: cannot open shared object file: No such file or directory"
    fail = f"import sys; from hicp_lib.cli import probes; probes.probes = lambda: dict(renderer=fail)\n" \
           f"def fail(): raise OSError({words!r})\nprobes.main('renderer')"  # fmt: skip
    assert trial(fail) == doctor.Check("renderer", False, words, remedy)
    # Before the trial could begin: the interpreter's own traceback
    check = trial(f"raise ImportError({words!r})")
    assert check.is_ok is False
    assert (library in check.finding, check.remedy) == (True, remedy)


def test_a_package_that_is_not_installed_is_no_fault():
    code = (
        "import sys; from hicp_lib.core import extras\nfrom hicp_lib.cli import probes\n"
        "probes.probes = lambda: dict(renderer=absent)\n"
        "def absent(): extras.require('render', 'no_such_package')\nprobes.main('renderer')"
    )
    check = trial(code)
    assert check.is_ok is None
    assert check.finding.startswith("no_such_package is not installed")
    assert str(check).endswith("pip install '.[render]'")


def test_a_trial_that_hangs_is_ended_with_what_it_started(tmp_path):
    started = tmp_path / "started"
    code = (
        "import subprocess, sys, time\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
        f"open({str(started)!r}, 'w').write(str(child.pid)); time.sleep(600)"
    )
    begun_s = time.monotonic()
    check = trial(code, limit_s=5.0)
    assert time.monotonic() - begun_s < 60
    assert (check.is_ok, check.finding) == (False, "no answer within 5 s, ended")
    while not is_gone(int(started.read_text())):
        assert time.monotonic() - begun_s < 60


def is_gone(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def test_detectors_renderer_and_controller_run(weights):
    checks = doctor.check_probes()
    assert [check for check in checks if check.is_ok is not True] == []
    tried = ", ".join(check.name for check in checks)
    assert tried == ", ".join([*default_detector_names(), "renderer", "controller"])


def test_missing_weights_are_named_with_the_command(tmp_path, monkeypatch):
    monkeypatch.setenv("HICP_CACHE", str(tmp_path))
    check = doctor.check_weights()
    assert check.is_ok is False
    assert "absent" in check.finding
    assert check.remedy == "hicp models fetch"


def test_a_folder_that_cannot_be_written_is_found(tmp_path):
    writable, room = doctor.check_folder("cache", tmp_path / "new" / "folder", "set HICP_CACHE")
    assert writable.is_ok is True
    assert room.is_ok is True
    (tmp_path / "file").write_text("")
    writable, _ = doctor.check_folder("cache", tmp_path / "file" / "folder", "set HICP_CACHE")
    assert writable.is_ok is False
    assert writable.remedy == "set HICP_CACHE"


@pytest.mark.skipif(sys.platform != "linux", reason="shared libraries of Debian")
def test_missing_system_libraries_are_named_by_package(monkeypatch):
    libraries = {
        "libc.so.6": ("libc6", {"json"}),
        "libnone.so.1": ("libnone1", {"no_such_package", "json"}),
        "libnone.so.2": ("libnone2", {"no_such_package"}),
    }
    monkeypatch.setattr(system_libraries, "LIBRARIES", libraries)
    assert system_libraries.missing_packages() == ["libnone1"]
    monkeypatch.setattr(doctor, "missing_packages", lambda: ["libegl1", "libgl1"])
    check = doctor.check_system_libraries()
    assert check.is_ok is False
    assert check.remedy == "sudo apt-get install libegl1 libgl1"


def test_the_command_prints_one_line_a_check_and_its_exit_code_tells(capsys, monkeypatch):
    checks = [
        doctor.Check("a", True, "fine", "nothing"),
        doctor.Check("b", None, "not installed"),
        doctor.Check("c", False, "gone", "do this"),
    ]
    monkeypatch.setattr(doctor, "run_checks", lambda: checks)
    assert cli.run(["doctor"]) == 2
    assert capsys.readouterr().out.splitlines() == [
        "ok   a: fine",
        "--   b: not installed",
        "FAIL c: gone; remedy: do this",
    ]
    monkeypatch.setattr(doctor, "run_checks", lambda: checks[:2])
    assert cli.run(["doctor"]) == 0


@pytest.mark.parametrize(("free_gb", "is_ok"), [(doctor.MIN_FREE_GB, True), (2.99, False)])
def test_the_disk_needs_room(tmp_path, monkeypatch, free_gb, is_ok):
    usage = SimpleNamespace(free=free_gb * 1e9)
    monkeypatch.setattr(doctor.shutil, "disk_usage", lambda folder: usage)
    _, room = doctor.check_folder("results", tmp_path / "new", "-")
    assert room.is_ok == is_ok and room.remedy == f"free space on the disk of {tmp_path}"
    assert room.finding == f"{free_gb:.1f} GB free (at least 3 wanted)"


@pytest.mark.parametrize(
    ("version", "is_ok"),
    [((3, 10, 9), False), ((3, 11, 0), True), ((3, 14, 2), True), ((3, 15, 0), False)],
)
def test_python_is_one_of_those_the_package_allows(monkeypatch, version, is_ok):
    monkeypatch.setattr(doctor.sys, "version_info", version)
    assert doctor.check_python().is_ok == is_ok
    requires = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]["requires-python"]
    assert (".".join(map(str, version)) in SpecifierSet(requires)) == is_ok


def test_a_registry_that_cannot_be_read_is_one_line(tmp_path, monkeypatch):
    from hicp_lib.detectors.weights import default

    def broken() -> None:
        raise InputError("data/detectors.json: not JSON")

    monkeypatch.setattr(default, "registry", broken)
    check = doctor.check_weights()
    assert (check.is_ok, check.finding) == (False, "data/detectors.json: not JSON")


@pytest.mark.parametrize("name", ["check_weights", "check_opencv", "check_probes", "check_system_libraries"])
def test_a_check_that_breaks_is_a_line_and_the_others_go_on(monkeypatch, name):
    def broken(*_):
        raise OSError(13, "Permission denied", "/weights/a.onnx")

    for one in ("check_probes", "check_weights"):
        monkeypatch.setattr(doctor, one, lambda: doctor.Check("x", True, ""))
    n_lines = len(doctor.run_checks())
    monkeypatch.setattr(doctor, name, broken)
    checks = doctor.run_checks()
    assert len(checks) == n_lines
    assert [c.finding for c in checks if c.is_ok is False and "Errno 13" in c.finding] == [
        "[Errno 13] Permission denied: '/weights/a.onnx'"
    ]


def test_without_a_checkout_there_is_no_lock_to_keep(monkeypatch, tmp_path):
    monkeypatch.setattr(doctor.provenance, "CHECKOUT", None)
    assert doctor.check_locked_versions(tmp_path / "no.lock").is_ok is True
    monkeypatch.setattr(doctor.provenance, "CHECKOUT", tmp_path)
    check = doctor.check_locked_versions(tmp_path / "no.lock")
    assert check.is_ok is False and check.remedy == "git restore environment.lock"
