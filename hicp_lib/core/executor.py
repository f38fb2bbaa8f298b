"""One interface for parallel work: threads or processes of this machine, or the workers of a Dask cluster.

The caller says whether jobs run in threads or processes here, and passes the user's `workers`: a number, the
address of a Dask scheduler, or nothing, which means the cluster that `HICP_DASK` names, else all cores.
Results depend neither on the number of workers nor on where they run.
"""

import multiprocessing
import os
import re
import threading
from collections.abc import Callable, Hashable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from operator import length_hint
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np

from hicp_lib.core.children import begin, safe_start
from hicp_lib.core.environment import usable_cores
from hicp_lib.core.errors import InputError
from hicp_lib.core.extras import needs

CLUSTER_VARIABLE = "HICP_DASK"
Key = TypeVar("Key", bound=Hashable)
Workers = int | str | None
# Checked here, since Dask starts threads, and for an empty address a cluster, before it looks.
_ADDRESS = re.compile(r"(tcp|tls|ws|wss|ucx)://\S+:\d{1,5}")


def resolved(workers: Workers) -> int | str:
    """The number of workers on this machine, or the address of the cluster to use.

    Parameters
    ----------
    workers : int or str or None
        None is the cluster that the variable `HICP_DASK` names; without it, all cores this process may use.

    Raises
    ------
    InputError
        If it is neither a whole number from 1 nor an address.

    Examples
    --------
    >>> resolved(3), resolved("tcp://127.0.0.1:8786")
    (3, 'tcp://127.0.0.1:8786')
    """
    if workers is None:
        workers = os.environ.get(CLUSTER_VARIABLE) or usable_cores()
    if isinstance(workers, str):
        if not _ADDRESS.fullmatch(workers):
            raise InputError(f"{workers}: no Dask scheduler answers (no address); give tcp://HOST:PORT")
    elif not (isinstance(workers, (int, np.integer)) and workers >= 1):
        raise InputError(f"workers is {workers!r}; expected a whole number from 1")
    return workers


def run_jobs(
    jobs: Iterable[tuple[Key, Callable | None]], workers: Workers = None, kind: str = "processes", *, folder:
    Path | None = None, alike: Callable[[], dict] | None = None, named: Callable[[Key], object] = str,
) -> Iterator[tuple[Key, Any]]:  # fmt: skip
    """Run jobs in parallel; yields each one's key and result, as they arrive.

    Parameters
    ----------
    jobs : iterable of (key, callable)
        Taken as workers become free. Processes and clusters need functions of modules, or partials of them;
        threads take anything. None in place of a callable means already done: its key is yielded with None.
    workers : int or str, optional
        As of `resolved`. With one worker, or one job, the calling thread does the work.
    kind : str
        "threads" or "processes": what is used on this machine. A cluster's worker runs jobs for processes one
        at a time.
    folder : Path, optional
        Jobs are called with it and write files there. On a cluster, whose machines need no access to it, they
        get a folder of their own, and their files are sent back. If a job's key names one of its files (a
        path below `folder`), that file appears after all others.
    alike : callable, optional
        Returns what results depend on at the place where it is called, JSON-able; a cluster's worker that
        returns something else than this machine is refused. By default the code of the first job.
    named : callable, optional
        What a message calls a job, by its key.

    Yields
    ------
    (object, object)

    Raises
    ------
    InputError
        If a process dies, or for problems with a cluster (`hicp_lib.core.cluster`).

    Examples
    --------
    >>> from functools import partial
    >>> dict(run_jobs([("a", partial(max, 1, 2)), ("b", partial(max, 4, 3))], workers=1))
    {'a': 2, 'b': 4}
    """
    workers = resolved(workers)
    if isinstance(workers, str):
        from hicp_lib.core.cluster import run_on_cluster  # the library is an extra

        yield from run_on_cluster(workers, jobs, kind, folder, alike, named)
        return
    n = min(workers, length_hint(jobs, workers))
    todo = jobs if folder is None else ((key, job and partial(job, folder)) for key, job in jobs)
    with single_threaded_opencv():
        if n < 2:
            yield from ((key, job and job()) for key, job in todo)
            return
        with (_Threads if kind == "threads" else Processes)(n) as executor:
            try:
                for key, future in as_they_come(todo, executor.submit, _first_ones, lambda: 2 * n):
                    yield key, future and future.result()
            except BrokenProcessPool:
                raise InputError(
                    "a worker process was killed (is memory short?); run the same command again to "
                    "continue, with fewer workers if it happens again"
                ) from None


def threads_beside() -> int:
    """Number of threads that run jobs in this cluster worker, including this one; 1 elsewhere."""
    with needs("dask"):
        from distributed import get_worker

    try:
        return get_worker().state.nthreads
    except ValueError:
        return 1


def as_they_come(
    jobs: Iterable[tuple[Key, Callable | None]], submit: Callable[[Callable], Any], first_ones:
    Callable[[Iterable], Iterable], n_most: Callable[[], float],
) -> Iterator[tuple[Key, Any]]:  # fmt: skip
    """Keys and finished futures of jobs; only as many are submitted as keep all workers busy.

    Parameters
    ----------
    jobs : iterable of (key, callable or None)
    submit : callable
        Submits a job; returns a future.
    first_ones : callable
        Waits for some of the given futures; returns those that finished, at least one.
    n_most : callable
        How many may be in progress.

    Yields
    ------
    (object, object)
        Key and future; None where there was no job.
    """
    running: dict[Any, Key] = {}
    for key, job in jobs:
        if job is None:
            yield key, None
            ended: Iterable = [future for future in running if future.done()]
        else:
            running[submit(job)] = key
            ended = first_ones(running) if len(running) >= n_most() else ()
        yield from [(running.pop(future), future) for future in ended]
    while running:
        yield from [(running.pop(future), future) for future in first_ones(running)]


def _first_ones(futures: Iterable) -> Iterable:
    return wait(futures, return_when=FIRST_COMPLETED).done


class _Threads(ThreadPoolExecutor):
    """Threads; at the end, running jobs are awaited and the others dropped."""

    def __exit__(self, *_: object) -> None:
        self.shutdown(cancel_futures=True)


class Processes(ProcessPoolExecutor):
    """Processes with one thread each: more threads than processors only wait for each other.

    Each starts as a fresh interpreter, since Open3D's threads do not survive a fork; the linear algebra
    library reads its number of threads when it is loaded. They end at once when this end of a pipe closes: at
    an error here, at a keyboard interrupt, and whenever this process dies.
    """

    def __init__(self, n: int) -> None:
        context = multiprocessing.get_context("spawn")
        self._theirs, self._ours = context.Pipe(duplex=False)
        with safe_start():
            super().__init__(n, context, begin, (self._theirs,))

    def submit(self, *arguments: Any, **named: Any) -> Any:
        """As for any executor; it may start a process."""
        with safe_start():
            return super().submit(*arguments, **named)

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is not None:
            self._ours.close()
        self.shutdown(cancel_futures=True)
        for end in (self._ours, self._theirs):
            end.close()


_opencv_lock, _n_threads_before = threading.Lock(), list[int]()


@contextmanager
def single_threaded_opencv() -> Iterator[None]:
    """Limit OpenCV to one thread in a block, since jobs already run in parallel.

    The setting is global to the process: of several overlapping blocks, the last to end restores the original
    value.
    """
    with _opencv_lock:
        _n_threads_before.append(cv2.getNumThreads())
        cv2.setNumThreads(1)
    try:
        yield
    finally:
        with _opencv_lock:
            cv2.setNumThreads(_n_threads_before.pop())
