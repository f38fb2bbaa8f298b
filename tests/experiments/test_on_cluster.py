"""What is rendered and simulated on a Dask cluster is the same, to the byte, as what is made here."""

from pathlib import Path

import pytest
from distributed import LocalCluster

from hicp_lib.core import cluster
from hicp_lib.core.cluster import connected
from hicp_lib.core.errors import InputError
from hicp_lib.core.executor import CLUSTER_VARIABLE, run_jobs
from hicp_lib.experiments import doses
from hicp_lib.experiments.avoidance.closed_loop import Trial
from hicp_lib.experiments.avoidance.runs import TRUE_KEYPOINTS, Job, run_all
from hicp_lib.experiments.recordings.open import open_people
from hicp_lib.experiments.recordings.simulate import simulate_recording
from hicp_lib.simulation.world.scenes import render_dataset
from tests.core.test_executor import fail, write_pid


@pytest.fixture(scope="module")
def address():
    """Of a scheduler with two workers, processes of this machine that share no folder with the caller."""
    with LocalCluster(2, processes=True, threads_per_worker=1, dashboard_address=None) as local:
        yield local.scheduler_address


def contents(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_scenes_and_recordings_are_the_same_files(address, tmp_path):
    for where, workers in (("here", 1), ("there", address)):
        render_dataset(tmp_path / where / "scenes", 2, 11, workers, progress=False)
        for name in ("relative-upper", "mocap"):
            simulate_recording(tmp_path / where / name, name, 2, workers=workers, progress=False)
    here = contents(tmp_path / "here")
    assert here == contents(tmp_path / "there") and len(here) > 20


def test_the_study_s_caches_are_the_same_files(address, tmp_path, monkeypatch):
    monkeypatch.setattr(doses, "LEVELS", {"resolution": (640, 80)})
    jobs = [Job(Trial("sitting, hand", duration_s=0.3), TRUE_KEYPOINTS)]
    for where in ("here", "there"):
        monkeypatch.setenv("HICP_CACHE", str(tmp_path / where))
        monkeypatch.setenv(CLUSTER_VARIABLE, address if where == "there" else "")
        run_all(jobs)
        assert [len(one) for one in open_people("relative-lower", n_frames=1, n_people=2)] == [1, 1]
    here = contents(tmp_path / "here")
    assert here == contents(tmp_path / "there") and len(here) > 20


def test_files_travel_and_the_one_that_is_named_comes_last(address, tmp_path, monkeypatch):
    written = []
    write = cluster.write_bytes
    monkeypatch.setattr(cluster, "write_bytes", lambda path, of: written.append(path.name) or write(path, of))
    jobs = [("b", _write_both)]
    ((key, result),) = run_jobs(jobs, address, folder=tmp_path)
    assert (key, result, written) == ("b", "done", ["a", "c", "b"])
    assert contents(tmp_path) == {"a": b"1", "b": b"2", "c": b"3"}


def _write_both(folder: Path) -> str:
    for name, content in zip("bac", "213", strict=True):
        (folder / name).write_text(content)
    return "done"


def test_a_fault_of_a_job_comes_back_as_it_is(address, tmp_path):
    with pytest.raises(KeyError, match="a fault") as error:
        list(run_jobs([("a", fail)], address, folder=tmp_path))
    assert "test_executor.py" in error.value.__notes__[0]


def test_workers_that_would_make_something_else_are_refused(address, tmp_path):
    alike = {"libraries": {"numpy": "1"}, "code": "a"}, _of_the_worker
    with pytest.raises(InputError, match=r"^worker tcp://.* differ from here: libraries.numpy;"):
        list(run_jobs([("a", write_pid)], address, folder=tmp_path, alike=alike))
    assert contents(tmp_path) == {}


def _of_the_worker() -> dict:
    return {"libraries": {"numpy": "2"}, "code": "a"}


def test_a_cluster_that_answers_is_found_before_work_begins(address):
    with connected(address) as client:
        assert len(client.nthreads()) == 2
