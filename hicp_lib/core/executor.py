"""One way to spread work: threads or processes of this machine, or the workers of a Dask cluster.

Whoever has jobs says which of the two they ask for here, and takes as `workers` what the user gave: a number,
the address of a Dask scheduler, or nothing, which is what `HICP_DASK` names, else all cores. Neither the
number nor the place is in any result.
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
    """How many workers of this machine, or the address of the cluster whose workers are asked for.

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
    """Run jobs, several at a time; each one's key and what it returned, as they come in.

    Parameters
    ----------
    jobs : iterable of (key, callable)
        Drawn as workers get free. Processes and clusters are given functions of modules, or partials of
        them; threads anything. None in place of a callable is done already: its key comes back with None.
    workers : int or str, optional
        As of `resolved`. A single one, or a single job, is run by the caller itself.
    kind : str
        "threads" or "processes": what works here. A cluster's worker runs those for processes one at a time.
    folder : Path, optional
        Jobs are called with it and write files there. On a cluster, whose machines need not see it, they are
        called with one of their own, and the files travel. Of a job's files, that which its key names, if it
        names one (a path below `folder`), is there when all others are.
    alike : callable, optional
        Says what results depend on where it is called, JSON-able; a cluster's worker where it is not what it
        is here is refused. The code of the first job where left out.
    named : callable, optional
        What a message calls a job, by its key.

    Yields
    ------
    (object, object)

    Raises
    ------
    InputError
        If a process dies, or for all that can be amiss with a cluster (`hicp_lib.core.cluster`).

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
                    "a process that worked was killed (is memory short?); run the same command again to go "
                    "on, with fewer workers if it happens again"
                ) from None


def threads_beside() -> int:
    """How many threads of a cluster's worker do jobs, this one among them; 1 elsewhere."""
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
    """Keys and ended futures of jobs; no more are under way than keep all workers busy.

    Parameters
    ----------
    jobs : iterable of (key, callable or None)
    submit : callable
        Gives a job away, for a future.
    first_ones : callable
        Waits for some of the futures it is given to end; those that did, at least one.
    n_most : callable
        How many may be under way.

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
    """Threads; what is under way is waited for at the end, what is not is dropped."""

    def __exit__(self, *_: object) -> None:
        self.shutdown(cancel_futures=True)


class Processes(ProcessPoolExecutor):
    """Processes with one thread each: more threads than processors only wait for each other.

    Each starts as a fresh interpreter, since Open3D's threads do not survive a fork; the linear algebra
    library reads its number of threads when it is loaded. They end at once when this end of a pipe closes,
    which it does at an error here, a stop from the keyboard, and however this process dies.
    """

    def __init__(self, n: int) -> None:
        context = multiprocessing.get_context("spawn")
        self._theirs, self._ours = context.Pipe(duplex=False)
        with safe_start():
            super().__init__(n, context, begin, (self._theirs,))

    def submit(self, *arguments: Any, **named: Any) -> Any:
        """As any executor's; it may start a process."""
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
    """Hold OpenCV to one thread for a block: the jobs are what is spread.

    The number is the whole process's: of several who want it, the last to leave restores what the first met.
    """
    with _opencv_lock:
        _n_threads_before.append(cv2.getNumThreads())
        cv2.setNumThreads(1)
    try:
        yield
    finally:
        with _opencv_lock:
            cv2.setNumThreads(_n_threads_before.pop())
