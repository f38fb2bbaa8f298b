"""Published weights: recorded on first use, refused when they change, never led out of their folder.

The downloads come from a server on this machine that serves what a test puts into a dictionary.
"""

from __future__ import annotations

import io
import json
import os
import re
import socketserver
import stat
import threading
import time
import zipfile
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from hicp_lib.cli import main as cli
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import sha256_bytes
from hicp_lib.detectors.onnx.session import open_model
from hicp_lib.detectors.weights import downloads, published
from hicp_lib.detectors.weights.default import weights_dir

CONTENT = b"\x00network\xff" * 1000


def zipped(*members: tuple[str | zipfile.ZipInfo, bytes]) -> bytes:
    """A zip archive of these members."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members:
            file.writestr(name, content)
    return archive.getvalue()


class Server(ThreadingHTTPServer):
    """Serves `files`; `announce` adds to the sizes it tells; `requests` counts."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.files: dict[str, bytes] = {}
        self.announce: int | None = 0
        self.requests = 0

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_port}"


class Handler(BaseHTTPRequestHandler):
    server: Server

    def do_GET(self) -> None:
        self.server.requests += 1
        content = self.server.files.get(self.path)
        if content is None:
            self.send_error(404)
            return
        self.send_response(200)
        if self.server.announce is not None:
            self.send_header("Content-Length", str(len(content) + self.server.announce))
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *arguments) -> None:
        pass


@pytest.fixture
def server(tmp_path, monkeypatch):
    """A server with an archive of one network and a plain file, and a registry that names both."""
    for name in list(os.environ):
        if name.lower().endswith("_proxy"):
            monkeypatch.delenv(name)
    monkeypatch.setenv("HICP_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(published, "REGISTRY_PATH", tmp_path / "data" / "published.json")
    (tmp_path / "data").mkdir()
    with Server() as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        server.files["/a/net.zip"] = zipped(("x/deep/end2end.onnx", CONTENT), ("x/readme.txt", b"read"))
        server.files["/plain.task"] = CONTENT
        register(server)
        yield server
        server.shutdown()
        thread.join()


def register(server: Server, **changes) -> None:
    """A registry of the archive (`net`) and of the plain file (`plain`); `changes` are the archive's."""
    row = {"use": "mmpose --model", "licence": "MIT", "size_bytes": None, "sha256": None, "note": ""}
    rows = {
        "net": row | {"url": f"{server.url}/a/net.zip", "member": "end2end.onnx"} | changes,
        "plain": row | {"url": f"{server.url}/plain.task", "member": None, "use": None, "note": "as it is"},
    }
    published.REGISTRY_PATH.write_text(json.dumps(rows))


def the_status(name: str) -> str:
    return published.status(published.published()[name])


def refused(name: str, match: str) -> str:
    """The one line a fetch is refused with; nothing new is in the cache or the record after it."""
    before = kept()
    with pytest.raises(InputError, match=match) as error:
        published.fetch_published(name)
    assert "\n" not in str(error.value)
    assert kept() == before
    return str(error.value)


def kept() -> dict[str, bytes]:
    """Every file of the cache and beside the registry."""
    root = published.REGISTRY_PATH.parents[1]
    return {str(path.relative_to(root)): path.read_bytes() for path in root.rglob("*") if path.is_file()}


@pytest.mark.parametrize(("name", "file"), [("net", "net.onnx"), ("plain", "plain.task")])
def test_the_first_fetch_records_the_hash_and_the_second_stays_at_home(server, name, file):
    assert the_status(name) == "absent"
    path = published.fetch_published(name).path
    assert path == weights_dir() / "published" / file
    assert path.read_bytes() == CONTENT
    assert the_status(name) == "present"
    download = next(content for address, content in server.files.items() if name in address)
    record = json.loads(published.lock_path().read_text())[name]
    assert record["sha256"] == sha256_bytes(download)
    assert record["file_sha256"] == sha256_bytes(CONTENT)
    assert published.fetch_published(name).path == path
    assert server.requests == 1


def test_a_fetched_file_is_held_against_its_record_when_it_is_used(server, tmp_path):
    path = published.fetch_published("net").path
    published.check_use(path, CONTENT)
    other = CONTENT[:-1] + b"?"
    path.write_bytes(other)
    for use in (lambda: published.check_use(path, other), lambda: open_model(path)):
        with pytest.raises(InputError, match=r"net\.onnx: is not the file that .* records; run: hicp models"):
            use()
    published.check_use(tmp_path / "net.onnx", other)  # the user's own


def test_a_download_that_changed_is_refused(server):
    path = published.fetch_published("net").path
    path.unlink()
    server.files["/a/net.zip"] = zipped(("end2end.onnx", CONTENT[:-1] + b"\0"))
    assert str(published.lock_path()) in refused("net", r"net\.zip: SHA-256 is .* has changed")
    assert the_status("net") == "absent"


@pytest.mark.parametrize("position", [0, 4321, len(CONTENT) - 1])
def test_one_flipped_bit_is_seen_and_fetch_repairs_it(server, position):
    path = published.fetch_published("net").path
    damaged = bytearray(CONTENT)
    damaged[position] ^= 1
    path.write_bytes(damaged)
    assert the_status("net") == "corrupt"
    published.fetch_published("net")
    assert path.read_bytes() == CONTENT
    assert the_status("net") == "present"


def test_one_flipped_bit_of_a_download_is_refused_where_the_hash_is_known(server):
    whole = server.files["/a/net.zip"]
    register(server, sha256=sha256_bytes(whole))
    for position in (0, len(whole) // 2, len(whole) - 1):
        damaged = bytearray(whole)
        damaged[position] ^= 1
        server.files["/a/net.zip"] = bytes(damaged)
        refused("net", "SHA-256 is")
    server.files["/a/net.zip"] = whole
    assert published.fetch_published("net").path.read_bytes() == CONTENT


def test_one_flipped_bit_in_an_archive_of_unknown_hash_fails_its_checksum(server):
    """Within the compressed content the archive's own CRC speaks up, before anything is recorded."""
    damaged = bytearray(server.files["/a/net.zip"])
    damaged[60] ^= 1
    server.files["/a/net.zip"] = bytes(damaged)
    refused("net", "not an intact zip archive")


def test_nothing_is_written_beside_the_registry(server, tmp_path):
    published.fetch_published("net")
    assert [path.name for path in (tmp_path / "data").iterdir()] == ["published.json"]


def test_a_file_without_a_record_is_fetched_anew(server):
    path = published.fetch_published("net").path
    published.lock_path().unlink()
    assert the_status("net") == "unrecorded"
    path.write_bytes(b"something else")
    assert published.fetch_published("net").path.read_bytes() == CONTENT


def test_an_unexpected_size_is_refused(server):
    register(server, size_bytes=len(server.files["/a/net.zip"]) + 1)
    refused("net", "bytes, expected")


@pytest.mark.parametrize("announce", [1, 1000, None])
def test_a_download_that_breaks_off_leaves_nothing_and_is_fetched_again(server, announce):
    server.announce = announce
    refused("plain", r"could not be downloaded \((ended after \d+ bytes, \d+ were|size announced)")
    server.announce = 0
    assert published.fetch_published("plain").path.read_bytes() == CONTENT


class Slow(socketserver.BaseRequestHandler):
    """Says the same again and again, a byte every tenth of a second, or as fast as it can."""

    head, again, pause_s = b"", b"", 0.1

    def handle(self) -> None:
        self.request.recv(4096)
        with suppress(OSError):
            self.request.sendall(self.head)
            while True:
                self.request.sendall(self.again)
                time.sleep(self.pause_s)


HEAD = b"HTTP/1.1 200 OK\r\nContent-Length: 9000\r\n"
SLOW = {
    "nothing": ("timed out|TimeoutError", b"", b"", 0.1),
    "its head": ("TimeoutError", b"HTTP/1.1 200 OK\r\nX: ", b"x", 0.1),
    "its body": (r"too slow: \d+ bytes in 1 s", HEAD + b"\r\n", b"x", 0.1),
    "more than it announced": (
        r"ended after \d+ bytes, 9000 were announced", HEAD + b"Transfer-Encoding: chunked\r\n\r\n",
        b"400\r\n" + bytes(1024) + b"\r\n", 0.0,
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", SLOW)
def test_a_server_that_never_ends_is_left(tmp_path, monkeypatch, kind):
    match, *says = SLOW[kind]
    monkeypatch.setattr(downloads, "TIMEOUT_S", 0.5)
    handler = type("Handler", (Slow,), dict(zip(("head", "again", "pause_s"), says, strict=True)))
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), handler) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}).start()
        begin_s, url = time.monotonic(), f"http://127.0.0.1:{server.server_address[1]}/net"
        try:
            problem = downloads.download(url, tmp_path / "net", 10_000)
        finally:
            server.shutdown()
    assert problem and re.fullmatch(match, problem)
    assert time.monotonic() < begin_s + 10


def test_more_than_a_model_can_be_is_not_downloaded(server, monkeypatch):
    monkeypatch.setattr(published, "MAX_BYTES", len(CONTENT) - 1)
    refused("plain", "size announced: 9000 bytes, expected up to 8999")


def link(name: str) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name)
    info.external_attr = (stat.S_IFLNK | 0o777) << 16
    return info


@pytest.mark.parametrize(
    ("members", "match"),
    [
        ([("..\\end2end.onnx", CONTENT)], "expected one file"),
        ([(link("end2end.onnx"), b"/etc/passwd")], "expected one file"),
        ([("end2end.onnx/", b"")], "expected one file"),
        ([("a/end2end.onnx", CONTENT), ("b/end2end.onnx", CONTENT)], "expected one file"),
        ([("other.onnx", CONTENT)], "expected one file"),
    ],
)
def test_hostile_archives_are_refused(server, members, match):
    server.files["/a/net.zip"] = zipped(*members)
    refused("net", match)


@pytest.mark.parametrize("name", ["../end2end.onnx", "a/../../end2end.onnx", "/tmp/end2end.onnx"])
def test_a_name_that_leads_out_of_a_folder_is_never_a_files(server, tmp_path, name):
    server.files["/a/net.zip"] = zipped((name, CONTENT), ("../../x", b""))
    before = {path for path in tmp_path.parent.rglob("*") if path.is_file()}
    path = published.fetch_published("net").path
    assert path.read_bytes() == CONTENT
    assert {path for path in tmp_path.parent.rglob("*") if path.is_file()} - before == {
        path, published.lock_path()
    }  # fmt: skip


def test_an_archive_that_swells_is_refused_before_it_is_read(server, monkeypatch):
    monkeypatch.setattr(published, "MAX_BYTES", 100_000)
    server.files["/a/net.zip"] = zipped(("end2end.onnx", bytes(100_001)))
    assert len(server.files["/a/net.zip"]) < 1000
    refused("net", "of up to 100000 bytes")


def test_an_archive_that_lies_about_its_size_is_refused(server):
    honest = zipped(("end2end.onnx", bytes(100_000)))
    server.files["/a/net.zip"] = honest.replace((100_000).to_bytes(4, "little"), (10).to_bytes(4, "little"))
    assert server.files["/a/net.zip"] != honest
    refused("net", "not an intact zip archive")


@pytest.mark.parametrize("content", [b"x", b"PK\x03\x04 no archive", zipped(("end2end.onnx", CONTENT))[:-9]])
def test_what_is_no_archive_is_refused(server, content):
    server.files["/a/net.zip"] = content
    refused("net", "not an intact zip archive")


def test_an_address_that_is_gone_says_where_to_put_the_file(server):
    del server.files["/a/net.zip"]
    line = refused("net", "HTTP Error 404")
    assert str(weights_dir() / "published" / "by_hand" / "net.zip") in line


def test_without_network_one_line_says_where_to_put_the_file_and_there_it_is_taken(server, capsys):
    server.shutdown()
    server.server_close()
    assert cli.run(["models", "fetch", "net"]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert re.search(r"could not be downloaded \(.*refused.*\); check the network, or put net\.zip at ", line)
    by_hand = weights_dir() / "published" / "by_hand" / "net.zip"
    assert f" {by_hand} " in line
    by_hand.parent.mkdir(parents=True)
    by_hand.write_bytes(server.files["/a/net.zip"])
    assert published.fetch_published("net").path.read_bytes() == CONTENT


def test_downloads_take_the_users_proxies_as_they_are_now(server, monkeypatch):
    """Here one that is used, then one that is not."""
    register(server, url="http://published.invalid/net.zip")
    server.files["http://published.invalid/net.zip"] = server.files["/a/net.zip"]
    monkeypatch.setenv("http_proxy", server.url)
    assert published.fetch_published("net").path.read_bytes() == CONTENT
    monkeypatch.setenv("http_proxy", "http://127.0.0.1:9")
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    assert published.fetch_published("plain").path.read_bytes() == CONTENT


@pytest.mark.parametrize("content", ["[]", '{"net": 1}', '{"net": {"sha256": "0"}}', "{"])
def test_a_broken_record_is_told_and_kept(server, content):
    published.published_dir().mkdir(parents=True)
    published.lock_path().write_text(content)
    published.published()["net"].path.write_bytes(CONTENT)
    refused("net", r"published_weights\.lock\.json: ")
    assert published.lock_path().read_text() == content


@pytest.mark.parametrize("change", [{"url": "http://127.0.0.1/.."}, {"url": 1}, {"hash": ""}, {"url": ""}])
def test_a_broken_registry_is_told(server, change):
    register(server, **change)
    refused("net", "restore the committed file")


def test_a_file_that_cannot_be_read_does_not_hide_the_others(server, capsys, monkeypatch):
    published.fetch_published("plain")
    path = published.published()["net"].path
    path.mkdir()
    assert (the_status("net"), the_status("plain")) == ("unreadable", "present")
    (weights_dir() / "pose_detection.tflite").mkdir()
    assert cli.run(["models", "list"]) == 0
    rows = {row.split()[0]: row.split()[1] for row in capsys.readouterr().out.splitlines()}
    assert rows["net"] == rows["pose_detection.tflite"] == "unreadable" and rows["plain"] == "present"


def test_unknown_names_are_refused(server):
    refused("nothing", "'nothing' is not known; expected one of: net, plain")


def test_the_command_lists_them_and_fetches_only_what_is_named(server, capsys, monkeypatch):
    from hicp_lib.detectors.weights import default as default_weights

    asked = []
    monkeypatch.setattr(default_weights, "fetch", lambda names: asked.append(names) or [])
    assert cli.run(["models", "fetch"]) == 0
    assert (asked, server.requests) == ([None], 0)
    assert cli.run(["models", "fetch", "net", "plain"]) == 0
    assert (asked, server.requests) == ([None], 2)
    path = published.published()["net"].path
    lines = capsys.readouterr().out.splitlines()
    assert f"hicp detect --detector mmpose --model {path}" in lines[0]
    assert "as it is" in lines[1]
    assert cli.run(["models", "list"]) == 0
    rows = [line.split()[:2] for line in capsys.readouterr().out.splitlines()]
    assert [row for row in rows if row[0] in ("net", "plain")] == [["net", "present"], ["plain", "present"]]


def test_the_committed_registry_is_whole():
    from hicp_lib.detectors.registry import DETECTORS

    models = published.published()
    assert len({model.path for model in models.values()}) == len(models)
    assert len({model.by_hand for model in models.values()}) == len(models)
    for model in models.values():
        assert model.url.startswith("https://")
        if model.use is not None:
            detector, option = model.use.split()
            assert detector in DETECTORS and option in ("--model", "--person-model")
            assert model.path.suffix in (".onnx", ".task")
        else:
            assert re.search("does not run here|no detector here takes it", model.note)
        assert model.sha256 is None or re.fullmatch("[0-9a-f]{64}", model.sha256)
        assert model.size_bytes is None or model.size_bytes > 0
