"""Images over a Dask cluster of two processes: the same file as without, whatever dies on the way."""

import importlib
import json
import os
import socketserver
import subprocess
import sys
import threading
import time
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
from distributed import Client
from distributed.client import ClosedClientError

from hicp_lib.core import cluster
from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.images import write_png
from hicp_lib.detectors import registry
from hicp_lib.detectors.runtime import run

# No test hangs for ever; nothing that is expected is ever waited for so long.
LONG_S = 120


@contextmanager
def dask_cluster(slow, workers=({},), *arguments, **environment):
    """Scheduler and registered workers on this machine only: the address and their processes.

    `workers` are the variables that each adds to the environment.
    """
    file, local = slow.folder / "scheduler.json", ("--host", "127.0.0.1", "--no-dashboard")
    file.unlink(missing_ok=True)
    named = ("--scheduler-file", str(file))
    processes = [slow.start("-m", "dask", "scheduler", "--port", "0", *local, *named, **environment)]
    options = ("--no-nanny", "--nthreads", "1", "--memory-limit", "0", "--death-timeout", str(LONG_S))
    for own in workers:
        command = ("-m", "dask", "worker", *local, *named, *options, *arguments)
        processes.append(slow.start(*command, **environment | own))
    try:
        while not (file.exists() and file.read_text().endswith("}")):
            assert processes[0].poll() is None, processes[0].communicate()
            time.sleep(0.02)
        address = json.loads(file.read_text())["address"]
        if workers:
            with Client(address, timeout=LONG_S, set_as_default=False) as client:
                client.wait_for_workers(len(workers), timeout=LONG_S)
        yield address, processes
    finally:
        for process in processes:
            process.kill()
            process.communicate()


PRELOAD = ("--preload", "slow_detector")


@pytest.fixture
def registered(slow, monkeypatch):
    """This process knows the detector too."""
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "preloaded")
    monkeypatch.setenv("SLOW_CALLS", str(slow.calls))
    monkeypatch.setenv("HICP_CACHE", str(slow.folder / "cache"))
    monkeypatch.setattr(registry, "DETECTORS", dict(registry.DETECTORS))
    registry.DETECTORS["slow"] = importlib.import_module("slow_detector").ENTRY
    return {path.name: path for path in sorted(slow.images.iterdir())}


def refusal(address, images, name="slow", **options) -> str:
    """The one line in which a run is refused."""
    with pytest.raises(InputError) as error:
        run.detect_images(name, images, workers=address, **options)
    assert "\n" not in str(error.value)
    return str(error.value)


def told(name: str) -> str:
    """What `hicp detect` ends with."""
    look = f"look: hicp draw --detections {name}.json --images images --out {name}.html"
    return f"{name}.json: 40 people in 40 images\n{look}\n"


def test_a_worker_killed_half_way_changes_nothing(slow):
    workers = {"SLOW_DIES_AFTER": "10"}, {"SLOW_GATE": "0"}  # the other one waits, lest it do all of it
    with dask_cluster(slow, workers, *PRELOAD) as (address, (_, doomed, other)):
        client = slow.detect("out.json", "--dask", address)
        assert doomed.wait(LONG_S) < 0  # it was killed,
        slow.open_gate()
        output, errors = client.communicate(timeout=LONG_S)
        assert (client.returncode, output) == (0, told("out")), errors
        assert len(slow.computed(doomed)) == 10 and slow.computed(client) == []  # having done its part
        # What the dead worker had not handed over is done again, nothing else: at most four are under way.
        assert set(slow.computed()) == set(range(40)) and len(slow.computed()) <= 43
        assert len(slow.computed(other)) >= 30

    alone = slow.detect("alone.json", "--workers", "2", HICP_CACHE=str(slow.folder / "other"))
    alone.communicate(timeout=LONG_S)
    assert len(slow.computed(alone)) == 40
    assert (slow.folder / "out.json").read_bytes() == (slow.folder / "alone.json").read_bytes()

    done = len(slow.computed())
    again = slow.detect("again.json", "--dask", "tcp://127.0.0.1:9")  # nothing is missing: nobody is asked
    assert again.communicate(timeout=LONG_S)[0] == told("again")
    assert len(slow.computed()) == done
    assert (slow.folder / "again.json").read_bytes() == (slow.folder / "out.json").read_bytes()


def test_a_client_that_was_killed_goes_on_where_it_was(slow):
    with dask_cluster(slow, ({}, {}), *PRELOAD, SLOW_GATE="20") as (address, _):
        killed = slow.detect("out.json", "--dask", address)
        while slow.n_kept() < 20:
            assert killed.poll() is None, killed.communicate()
            time.sleep(0.02)
        killed.kill()
        killed.communicate()
        slow.open_gate()
        resumed = slow.detect("out.json", "--dask", address)
        output, errors = resumed.communicate(timeout=LONG_S)
        assert (resumed.returncode, output) == (0, told("out")), errors
    # What was kept is not done again; the few that were under way may be.
    times = np.bincount(slow.computed())
    assert (times[:20] == 1).all() and (times >= 1).all() and times.sum() <= 44
    people = json.loads((slow.folder / "out.json").read_text())
    assert [(p["image_id"], p["keypoints"][0]) for p in people] == [(i, i) for i in range(40)]


def test_a_real_detector_gives_the_same_numbers(slow, own_cache, photograph, tmp_path):
    paths = {i: tmp_path / f"photograph_{i}.png" for i in range(6)}
    for i, path in paths.items():
        write_png(path, photograph[10 * i : 500 + 7 * i, 5 * i :])
    with dask_cluster(slow, ({}, {}), HICP_CACHE=str(own_cache)) as (address, _):
        remote = run.detect_images("mediapipe", paths, workers=address)
    own_cache.rename(tmp_path / "with results")
    os.makedirs(own_cache)
    (tmp_path / "with results" / "weights").rename(own_cache / "weights")
    local = run.detect_images("mediapipe", paths, workers=1)
    assert list(remote) == list(local)
    assert sum(len(result.detections) for result in local.values()) > 0
    for key, result in local.items():
        for field in ("keypoints_px", "scores", "person_scores"):
            pair = [getattr(r.detections, field) for r in (result, remote[key])]
            assert np.array_equal(*pair, equal_nan=True)
    assert all(result.workers == 1 and result.time_ms > 0 for result in remote.values())


def test_what_workers_cannot_do_and_that_they_are_gone_is_said_in_one_line(slow, registered, monkeypatch):
    broken, absent = slow.folder / "broken.png", slow.folder / "absent.png"
    broken.write_bytes(b"no image")
    with dask_cluster(slow, ({},), *PRELOAD, SLOW_GATE="20") as (address, (_, worker)):
        monkeypatch.setenv("SLOW_VERSION", "2")
        line = refusal(address, registered)
        assert line.startswith("worker tcp://127.0.0.1:")
        assert "these differ from here: settings.version;" in line
        assert slow.n_kept() == 0 == len(slow.computed())
        monkeypatch.delenv("SLOW_VERSION")

        registry.DETECTORS["known here only"] = registry.DETECTORS["slow"]
        line = refusal(address, registered, "known here only")
        assert line.startswith("worker tcp://") and "detector 'known here only' is not known" in line
        # Weights are read before images.
        assert "option 'delay' is not known" in refusal(address, {1: broken}, delay=1)

        some = {name: registered[name] for name in sorted(registered)[:4]}
        assert refusal(address, some | {"x": broken}).startswith(f"{broken}: is not an image")
        assert slow.n_kept() > 0
        assert refusal(address, {"x": absent}).startswith(f"{absent}: cannot be read")

        write = run.results.write_result

        def write_and_lose(*arguments):
            write(*arguments)
            if slow.n_kept() == 20:
                worker.kill()
                monkeypatch.setattr(cluster, "PATIENCE_S", 0.5)

        monkeypatch.setattr(run.results, "write_result", write_and_lose)
        line = refusal(address, registered)
        assert line.startswith(f"{address}: the Dask cluster is gone (it has lost its workers)")
        assert line.endswith("run the same command again to continue") and slow.n_kept() == 20


def test_a_fault_of_a_detector_is_told_as_what_it_is(slow, registered):
    """Not as a cluster that is gone or runs something else, though Dask ends in such errors then."""
    faulty = slow.folder / "faulty.png"
    write_png(faulty, np.full((8, 9, 3), 254, np.uint8))
    with dask_cluster(slow, ({},), *PRELOAD) as (address, _):
        with pytest.raises(AttributeError) as error:
            run.detect_images("slow", {"faulty": faulty}, workers=address)
    assert str(error.value) == "a fault of the detector's"
    assert "slow_detector.py" in error.value.__notes__[0]  # where it was on the worker


class FakeClient:
    def __init__(self, status: str) -> None:
        self.status = status


@pytest.mark.parametrize("status", ["running", "closed"])
@pytest.mark.parametrize("error", [AttributeError, RuntimeError])
def test_only_a_client_that_is_closed_trips_over_what_it_no_longer_has(error, status):
    expected = (
        (error, "^no scheduler$") if status == "running" else (InputError, "is gone [(]no scheduler[)]")
    )
    with pytest.raises(expected[0], match=expected[1]), cluster._explained("tcp://a:1", FakeClient(status)):
        raise error("no scheduler")


@pytest.mark.parametrize("error", [CancelledError, ConnectionError, ClosedClientError])
def test_a_lost_connection_is_told_whatever_the_client_says(error):
    with pytest.raises(InputError, match="^tcp://a:1: the Dask cluster is gone [(]lost[)]; run the same"):
        with cluster._explained("tcp://a:1", FakeClient("running")):
            raise error("lost")


def test_other_errors_are_not_taken_for_a_lost_cluster():
    with pytest.raises(KeyError), cluster._explained("tcp://a:1", FakeClient("closed")):
        raise KeyError("a fault")


@pytest.mark.parametrize("error", [ModuleNotFoundError("no slow_detector"), RuntimeError("no slow_detector")])
def test_what_dask_cannot_run_is_another_environment(error):
    told = cluster._not_run(error, "a.png")
    assert str(told) == (
        "the Dask cluster cannot run its jobs (no slow_detector); "
        "install the same environment and weights on scheduler and workers"
    )


def test_an_image_that_kills_its_workers_is_named(slow, registered):
    deadly = slow.folder / "deadly.png"
    write_png(deadly, np.full((8, 9, 3), 255, np.uint8))
    environment = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}
    with dask_cluster(slow, ({},), *PRELOAD, **environment) as (address, _):
        line = refusal(address, {"deadly": deadly})
    assert line.startswith(f"{deadly}: every worker that ran it died, most recently tcp://127.0.0.1:")


def test_the_command_line_tells_of_a_lost_scheduler_in_one_line(slow):
    with dask_cluster(slow, ({},), *PRELOAD, SLOW_GATE="4") as (address, (scheduler, _)):
        # How long Dask tries to reconnect.
        environment = {"DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "1s"}
        client = slow.detect("out.json", "--dask", address, **environment)
        while slow.n_kept() < 4:
            assert client.poll() is None, client.communicate()
            time.sleep(0.02)
        scheduler.kill()
        output, errors = client.communicate(timeout=LONG_S)
    assert (client.returncode, output) == (2, "")
    assert errors.startswith(f"hicp: {address}: the Dask cluster is gone ("), errors
    assert errors.count("\n") == 1, errors
    assert errors.endswith("run the same command again to continue\n")
    assert slow.n_kept() == 4 and not (slow.folder / "out.json").exists()


def test_who_is_not_there_is_said(slow, registered, monkeypatch):
    for nonsense in ("", "nonsense", "nonsense://127.0.0.1:1", "tcp://127.0.0.1:no"):
        assert refusal(nonsense, registered).startswith(f"{nonsense}: no Dask scheduler answers")
    monkeypatch.setattr(cluster, "SOON_S", 0.5)
    assert refusal("tcp://127.0.0.1:9", registered).startswith("tcp://127.0.0.1:9: no Dask scheduler answers")
    with dask_cluster(slow, ()) as (address, _):
        monkeypatch.setattr(cluster, "SOON_S", 3.0)
        assert refusal(address, registered) == f"{address}: the Dask cluster has no workers; start some"
    monkeypatch.setitem(sys.modules, "distributed", None)
    told = refusal("tcp://127.0.0.1:9", registered)
    assert told.startswith("distributed is not installed") and told.endswith("pip install '.[dask]'")


def speaks(said: bytes, again: bool, hears: bool = False) -> socketserver.BaseRequestHandler:
    """What a server that is no scheduler does: says something, once or every tenth of a second."""

    class Handler(socketserver.BaseRequestHandler):
        def handle(self) -> None:
            if hears:
                self.request.recv(4096)
            with suppress(OSError):
                self.request.sendall(said)
                while not hears:
                    time.sleep(0.1)
                    self.request.sendall(said if again else b"")

    return Handler


@pytest.mark.parametrize(
    "handler",
    [
        speaks(b"HTTP/1.0 400 Bad Request\r\n\r\n", again=False, hears=True),
        speaks(b"SSH-2.0-OpenSSH_9.6\r\n", again=False),
        speaks(b"", again=False),
        speaks(b"", again=False, hears=True),
        speaks(b"\x01", again=True),
        speaks(bytes(4096), again=True),
    ],
    ids=["http", "ssh", "silent", "hangs up", "drips", "floods"],
)
def test_a_server_that_is_no_scheduler_is_left_in_time(registered, monkeypatch, handler):
    monkeypatch.setattr(cluster, "SOON_S", 1.0)
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), handler) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}).start()
        address, begin = f"tcp://127.0.0.1:{server.server_address[1]}", time.monotonic()
        try:
            assert refusal(address, registered).startswith(f"{address}: no Dask scheduler answers (")
        finally:
            server.shutdown()
    assert time.monotonic() < begin + 20  # it was 280


def test_a_worker_is_no_scheduler(slow, registered):
    with dask_cluster(slow, ({},)) as (address, _), Client(address, set_as_default=False) as client:
        (worker,) = client.nthreads()
        assert "it is a Worker" in refusal(worker, registered)


def test_a_missing_dask_is_told_before_the_cluster_is_asked(monkeypatch, tmp_path):
    monkeypatch.setenv("HICP_CACHE", str(tmp_path))
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"^distributed is not installed.*\.\[dask\]'$"):
        run.detect_images("movenet-lightning", {1: DATA_DIR / "photograph.jpg"}, "tcp://127.0.0.1:9")


def test_differences_are_named_by_their_keys():
    one = {"a": {"b": 1, "c": [1, 2]}, "d": 1}
    assert cluster._differences(one, {"a": {"b": 1, "c": [1, 2]}, "d": 1}) == []
    assert cluster._differences(one, {"a": {"b": 2, "c": [1]}, "e": 1}) == ["a.b", "a.c", "d", "e"]


def test_dask_and_threads_exclude_each_other(slow):
    process: subprocess.Popen = slow.detect("out.json", "--dask", "tcp://127.0.0.1:9", "--workers", "2")
    assert "Give either --workers N or --dask ADDRESS" in process.communicate()[1]
    assert process.returncode == 2
