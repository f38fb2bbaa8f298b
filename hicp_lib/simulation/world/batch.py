"""Many results at once: processes that simulate, and the folders they write to."""

import multiprocessing
import multiprocessing.pool
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from operator import call
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np

from hicp_lib.core.environment import usable_cores, with_variables
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json, write_json

Result = TypeVar("Result")


@contextmanager
def worker_pool(workers: int) -> Iterator[multiprocessing.pool.Pool]:
    """Processes that simulate, with one thread each: more threads than processors only wait for each other.

    Each starts as a fresh interpreter, since Open3D's threads do not survive a fork; the
    linear algebra library reads its number of threads when it is loaded.
    """
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
    context = multiprocessing.get_context("spawn")
    with with_variables(**dict.fromkeys(names, "1")):
        pool = context.Pool(workers, initializer=cv2.setNumThreads, initargs=(1,))
    with pool:
        yield pool


def run_jobs(jobs: Sequence[Callable[[], Result]], workers: int | None = None) -> Iterator[Result]:
    """Run jobs, several at a time.

    Parameters
    ----------
    jobs : sequence of callable
        Functions of modules, or partials of them, so that processes can be given them.
    workers : int, optional
        Processes; one for each core that this process may use when left out.

    Yields
    ------
    object
        What the jobs return, in their order.

    Examples
    --------
    >>> from functools import partial
    >>> list(run_jobs([partial(max, 1, 2), partial(max, 4, 3)], workers=1))
    [2, 4]
    """
    n_workers = min(workers or usable_cores(), len(jobs))
    if n_workers < 2:
        yield from map(call, jobs)
        return
    with worker_pool(n_workers) as pool:
        yield from pool.imap(call, jobs)


def check_numbers(**limits: tuple[object, int, int]) -> None:
    """Refuse numbers out of range.

    Parameters
    ----------
    **limits : tuple
        By its name: what was given, the lowest and the highest number allowed.

    Raises
    ------
    InputError
        For the first that is no whole number or lies outside.

    Examples
    --------
    >>> check_numbers(seed=(3, 0, 10))
    """
    for name, (value, low, high) in limits.items():
        if not isinstance(value, int | np.integer) or not low <= value <= high:
            raise InputError(f"{name} is {value!r}; expected a whole number from {low} to {high}")


def keep_parts(out: Path, parts_dir: str, stamp: dict, made: Iterable[str]) -> None:
    """Keep what an interrupted run finished; drop what was made with something else.

    Parameters
    ----------
    out : Path
        Folder that is written to.
    parts_dir : str
        Name of the folder in it that says what is finished.
    stamp : dict
        What results depend on, JSON-able; kept there.
    made : iterable of str
        Patterns of the files that are made, relative to `out`.
    """
    stamp_file = out / parts_dir / "stamp.json"
    if stamp_file.exists() and read_json(stamp_file) == stamp:
        return
    for pattern in (f"{parts_dir}/*.json", *made):
        for path in out.glob(pattern):
            path.unlink()
    write_json(stamp_file, stamp)


def check_output(out: Path, marker: str, purpose: str, made: str) -> None:
    """Refuse a folder that holds something else.

    Parameters
    ----------
    out : Path
    marker : str
        Name of a folder that is only in what was made here.
    purpose, made : str
        What the folder is for and what is done to files there, in the words of the message.

    Raises
    ------
    InputError
        If `out` is a file, or holds files and no `marker`.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: is a file; give a folder {purpose}")
    if out.is_dir() and any(out.iterdir()) and not (out / marker).is_dir():
        raise InputError(f"{out}: holds files that were not {made}; give an empty or new folder")
