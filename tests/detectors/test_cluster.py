"""Images over a Dask cluster of two processes: the same file as without, whatever dies on the way."""

import importlib
import json
import os
import subprocess
import sys
import time
from contextlib import contextmanager

import numpy as np
import pytest

from hicp_lib.detectors import cluster, registry, run
from hicp_lib.errors import InputError
from hicp_lib.images import write_png

pytestmark = pytest.mark.cluster


@contextmanager
def dask_cluster(slow, n_workers=2, *arguments, **environment):
    """Scheduler and workers on this machine only: the address and the workers' processes."""
    file, local = slow.folder / "scheduler.json", ("--host", "127.0.0.1", "--no-dashboard")
    file.unlink(missing_ok=True)
    named = ("--scheduler-file", str(file))
    processes = [slow.start("-m", "dask", "scheduler", "--port", "0", *local, *named, **environment)]
    options = ("--no-nanny", "--nthreads", "1", "--memory-limit", "0", "--death-timeout", "60")
    for _ in range(n_workers):
        worker = ("-m", "dask", "worker", *local, *named, *options, *arguments)
        processes.append(slow.start(*worker, **environment))
    try:
        while not (file.exists() and file.read_text().endswith("}")):
            assert processes[0].poll() is None, processes[0].communicate()
            time.sleep(0.02)
        yield json.loads(file.read_text())["address"], processes
    finally:
        for process in processes:
            process.kill()
            process.communicate()


PRELOAD = ("--preload", "slow_detector")


@pytest.fixture
def registered(slow, monkeypatch):
    """This process knows the detector too, and is patient for a second only."""
    monkeypatch.syspath_prepend(os.path.dirname(__file__))
    monkeypatch.setenv("SLOW_CALLS", str(slow.calls))
    monkeypatch.setenv("HICP_CACHE", str(slow.folder / "cache"))
    monkeypatch.setattr(cluster, "PATIENCE_S", 1.0)
    monkeypatch.setattr(registry, "DETECTORS", dict(registry.DETECTORS))
    registry.DETECTORS["slow"] = importlib.import_module("slow_detector").ENTRY
    return {path.name: path for path in sorted(slow.images.iterdir())}


def refusal(address, images, name="slow", **options) -> str:
    """The one line in which a run is refused."""
    with pytest.raises(InputError) as error:
        run.detect_images(name, images, dask=address, **options)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_a_worker_killed_half_way_changes_nothing(slow):
    with dask_cluster(slow, 2, *PRELOAD) as (address, (_, doomed, other)):
        client = slow.detect("out.json", "--dask", address)
        while not (len(slow.computed(doomed)) >= 5 and slow.computed(other)):
            assert client.poll() is None, client.communicate()
            time.sleep(0.01)
        doomed.kill()
        output, errors = client.communicate(timeout=120)
        assert (client.returncode, output) == (0, "out.json: 40 people in 40 images\n"), errors
        by_doomed = slow.computed(doomed)
        assert 5 <= len(by_doomed) < 30 and slow.computed(client) == []
        # What the dead worker had not handed over is done again, and nothing else.
        assert set(slow.computed()) == set(range(40)) and len(slow.computed()) <= 43

    alone = slow.detect("alone.json", "--workers", "2", HICP_CACHE=str(slow.folder / "other"))
    alone.communicate(timeout=120)
    assert len(slow.computed(alone)) == 40
    assert (slow.folder / "out.json").read_bytes() == (slow.folder / "alone.json").read_bytes()

    done = len(slow.computed())
    again = slow.detect("again.json", "--dask", "tcp://127.0.0.1:9")  # nothing is missing: nobody is asked
    assert again.communicate(timeout=120)[0] == "again.json: 40 people in 40 images\n"
    assert len(slow.computed()) == done
    assert (slow.folder / "again.json").read_bytes() == (slow.folder / "out.json").read_bytes()


def test_a_client_that_was_killed_goes_on_where_it_was(slow):
    with dask_cluster(slow, 2, *PRELOAD) as (address, workers):
        killed = slow.detect("out.json", "--dask", address)
        while slow.n_kept() < 15:
            assert killed.poll() is None, killed.communicate()
            time.sleep(0.01)
        killed.kill()
        killed.communicate()
        time.sleep(0.5)  # what was under way ends
        kept, before = slow.n_kept(), len(slow.computed())
        resumed = slow.detect("out.json", "--dask", address)
        assert resumed.communicate(timeout=120) == ("out.json: 40 people in 40 images\n", "")
        assert kept < 40 and len(slow.computed()) - before == 40 - kept
    people = json.loads((slow.folder / "out.json").read_text())
    assert [(p["image_id"], p["keypoints"][0]) for p in people] == [(i, i) for i in range(40)]


def test_a_real_detector_gives_the_same_numbers(slow, own_cache, photograph, tmp_path):
    paths = {i: tmp_path / f"photograph_{i}.png" for i in range(6)}
    for i, path in paths.items():
        write_png(path, photograph[10 * i : 500 + 7 * i, 5 * i :])
    with dask_cluster(slow, 2, HICP_CACHE=str(own_cache)) as (address, _):
        remote = run.detect_images("mediapipe", paths, dask=address)
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


def test_workers_that_would_find_something_else_refuse(slow, registered):
    with dask_cluster(slow, 1, *PRELOAD, SLOW_VERSION="2") as (address, _):
        line = refusal(address, registered)
        assert line.startswith("worker tcp://127.0.0.1:")
        assert "these differ from here: settings.version;" in line
        assert slow.n_kept() == 0 == len(slow.computed())


def test_workers_that_cannot_make_the_detector_say_so(slow, registered):
    with dask_cluster(slow, 1) as (address, _):
        line = refusal(address, registered)
        assert line.startswith("worker tcp://") and "detector 'slow' is not known" in line
        broken = slow.folder / "broken.png"
        broken.write_bytes(b"no image")
        # Weights are read before images.
        assert "no option 'delay'" in refusal(address, {1: broken}, delay=1)


def test_a_broken_or_absent_image_is_named(slow, registered):
    broken = slow.folder / "broken.png"
    broken.write_bytes(b"no image")
    with dask_cluster(slow, 1, *PRELOAD) as (address, _):
        assert refusal(address, registered | {"x": broken}).startswith(f"{broken}: is not an image")
        assert slow.n_kept() > 0
        absent = slow.folder / "absent.png"
        assert refusal(address, {"x": absent}).startswith(f"{absent}: cannot be read")


def test_an_image_that_kills_its_workers_is_named(slow, registered):
    deadly = slow.folder / "deadly.png"
    write_png(deadly, np.full((8, 9, 3), 255, np.uint8))
    environment = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}
    with dask_cluster(slow, 2, *PRELOAD, **environment) as (address, _):
        line = refusal(address, {"deadly": deadly})
        assert line.startswith(f"{deadly}: every worker that took this image died, lately tcp://127.0.0.1:")


@pytest.mark.parametrize("loss", ["workers", "scheduler"])
def test_a_cluster_that_is_lost_is_not_waited_for_for_ever(slow, registered, monkeypatch, loss):
    with dask_cluster(slow, 1, *PRELOAD) as (address, (scheduler, worker)):
        write = cluster.write_result

        def write_and_lose(*arguments):
            write(*arguments)
            if slow.n_kept() == 4:
                (worker if loss == "workers" else scheduler).kill()

        monkeypatch.setattr(cluster, "write_result", write_and_lose)
        line = refusal(address, registered)
    assert line.startswith(f"{address}: the Dask cluster is gone (")
    assert line.endswith("run the same command again to go on")
    assert 4 <= slow.n_kept() < 40


def test_the_command_line_tells_of_a_lost_scheduler_in_one_line(slow):
    with dask_cluster(slow, 1, *PRELOAD) as (address, (scheduler, _)):
        environment = {"DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "1s"}
        client = slow.detect("out.json", "--dask", address, **environment)
        while slow.n_kept() < 4:
            assert client.poll() is None, client.communicate()
            time.sleep(0.01)
        scheduler.kill()
        output, errors = client.communicate(timeout=120)
    assert (client.returncode, output) == (2, "")
    assert errors.startswith(f"hicp: {address}: the Dask cluster is gone (") and errors.count("\n") == 1
    assert not (slow.folder / "out.json").exists()


def test_who_is_not_there_is_said(slow, registered, monkeypatch):
    assert refusal("tcp://127.0.0.1:9", registered).startswith("tcp://127.0.0.1:9: no Dask scheduler answers")
    for nonsense in ("", "nonsense", "nonsense://127.0.0.1:1", "tcp://127.0.0.1:no"):
        assert refusal(nonsense, registered).startswith(f"{nonsense}: no Dask scheduler answers")
    with dask_cluster(slow, 0) as (address, _):
        assert refusal(address, registered) == f"{address}: the Dask cluster has no workers; start some"
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert "install this package's extra 'dask'" in refusal("tcp://127.0.0.1:9", registered)


def test_differences_are_named_by_their_keys():
    one = {"a": {"b": 1, "c": [1, 2]}, "d": 1}
    assert cluster._differences(one, {"a": {"b": 1, "c": [1, 2]}, "d": 1}) == []
    assert cluster._differences(one, {"a": {"b": 2, "c": [1]}, "e": 1}) == ["a.b", "a.c", "d", "e"]


def test_dask_and_threads_exclude_each_other(slow):
    process: subprocess.Popen = slow.detect("out.json", "--dask", "tcp://127.0.0.1:9", "--workers", "2")
    assert "Give either --workers N or --dask ADDRESS" in process.communicate()[1]
    assert process.returncode == 2
