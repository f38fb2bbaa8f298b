"""Jobs start when those before them have ended, the most urgent first, no more at a time than allowed."""

import threading
from concurrent.futures import ThreadPoolExecutor
from graphlib import CycleError

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hicp_lib.report.schedule import run_when_ready


@st.composite
def jobs(draw):
    """Names -> some of the names before."""
    after = {}
    for number in range(draw(st.integers(1, 8))):
        after[f"job {number}"] = draw(st.lists(st.sampled_from(sorted(after)), unique=True)) if after else []
    return dict(draw(st.permutations(sorted(after.items()))))


def run(after, n_parallel, failing=()):
    """Names in the order in which they started, their outcomes, and the most that ran at a time."""
    started, ended, at_a_time, lock = [], [], [], threading.Lock()

    def job(name, before):
        assert all(future.done() for future in before) and len(before) == len(after[name])
        with lock:
            assert set(after[name]) <= set(ended)
            started.append(name)
            at_a_time.append(len(started) - len(ended))
        with lock:
            ended.append(name)
        if name in failing:
            raise ValueError(name)
        return name.upper()

    with ThreadPoolExecutor(n_parallel) as pool:
        done = run_when_ready(after, job, pool, n_parallel)
    return started, done, max(at_a_time)


@given(jobs(), st.integers(1, 3))
def test_each_runs_once_and_after_those_it_names(after, n_parallel):
    started, done, most = run(after, n_parallel)
    assert sorted(started) == sorted(after) == sorted(done)
    assert {name: future.result() for name, future in done.items()} == {name: name.upper() for name in after}
    assert most <= n_parallel


def test_the_longest_chain_goes_first():
    after = {"alone": [], "first": [], "second": ["first"], "last": ["second"], "short": [], "end": ["short"]}
    assert run(after, 1)[0] == ["first", "second", "short", "alone", "last", "end"]


def test_a_job_that_waits_keeps_no_other_from_running():
    gate = threading.Event()

    def job(name, before):
        if name == "slow":
            assert gate.wait(30), "the job that needs nothing did not run beside the slow one"
        if name == "free":
            gate.set()

    with ThreadPoolExecutor(2) as pool:
        done = run_when_ready({"slow": [], "needs it": ["slow"], "free": []}, job, pool, 2)
    assert all(future.exception() is None for future in done.values())


def test_a_failed_job_is_handed_to_those_after_it():
    _, done, _ = run({"bad": [], "later": ["bad"]}, 2, failing={"bad"})
    assert isinstance(done["bad"].exception(), ValueError)
    assert done["later"].result() == "LATER"


def test_a_circle_is_refused():
    with ThreadPoolExecutor(1) as pool, pytest.raises(CycleError):
        run_when_ready({"a": ["b"], "b": ["a"]}, lambda name, before: None, pool, 1)
