"""Jobs on an existing Dask cluster.

Inputs and output files are sent, not paths, so no shared folder is needed. Scheduler and workers need this
package as it is installed here; a worker that would compute something else (other code, libraries, weights,
settings) refuses. A job whose worker dies is given to another, until it has lost as many workers as Dask's
setting `distributed.scheduler.allowed-failures` allows.

Dask's workers execute what its clients send them: connect only to a cluster you trust.
"""

from __future__ import annotations

import asyncio
import logging
import math
import tempfile
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Hashable, Iterable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import cv2

from hicp_lib.core.cache import code_identity
from hicp_lib.core.errors import InputError, one_line
from hicp_lib.core.executor import as_they_come, resolved
from hicp_lib.core.extras import needs
from hicp_lib.core.files import write_bytes
from hicp_lib.core.limited import raised

if TYPE_CHECKING:
    from distributed import Client

Key = TypeVar("Key", bound=Hashable)
Answer = TypeVar("Answer")
# How long to wait for the scheduler, and for workers if there are none: at the start, and later.
SOON_S, PATIENCE_S = 3.0, 30.0
_ANEW_S = 1.0  # interval between counts of the workers
_LOGGERS = ("distributed", "distributed.client", "tornado.application", "asyncio")


def run_on_cluster(
    address: str, jobs: Iterable[tuple[Key, Callable | None]], kind: str, folder: Path | None, alike:
    Callable[[], dict] | None, named: Callable[[Key], object],
) -> Iterator[tuple[Key, Any]]:  # fmt: skip
    """As `hicp_lib.core.executor.run_jobs`, on the workers of a cluster; without jobs it is not contacted.

    Parameters
    ----------
    address : str
        Of Dask's scheduler, e.g. "tcp://127.0.0.1:8786".
    jobs : iterable of (key, callable or None)
    kind : str
    folder : Path or None
    alike : callable or None
    named : callable

    Yields
    ------
    (object, object)

    Raises
    ------
    InputError
        If the extra is not installed, the cluster cannot be reached, has no workers or loses them, a worker
        would compute something else, or a job kills its workers.
    """
    todo = iter(jobs)
    for first in todo:
        if first[1] is not None:
            break
        yield first[0], None
    else:
        return
    alike = alike or partial(code_identity, getattr(first[1], "func", first[1]).__module__)
    how = alike(), alike, folder is not None, kind == "processes"
    with connected(address) as client:
        for key, answer in _spread(client, address, chain([first], todo), how, named):
            if isinstance(answer, Exception):
                raise answer
            if folder is not None and answer is not None:
                answer, files = answer
                for name in sorted(files, key=str(key).__eq__):  # the one that the key names is the last
                    write_bytes(folder / name, files[name])
            yield key, answer


@contextmanager
def connected(address: str) -> Iterator[Client]:
    """A client of a cluster that has workers.

    Parameters
    ----------
    address : str

    Yields
    ------
    distributed.Client

    Raises
    ------
    InputError
        If the extra is not installed, no scheduler answers, or there are no workers.
    """
    with needs("dask"):
        from distributed import Client
    resolved(address)
    soon_s = raised(SOON_S)
    with _quiet():
        try:
            with ThreadPoolExecutor(1) as thread:  # a notebook's thread already has an event loop
                thread.submit(asyncio.run, _greet(address, soon_s)).result()
            client = Client(address, timeout=soon_s)
        except Exception as error:  # another kind of server may answer anything
            raise InputError(
                f"{address}: no Dask scheduler answers ({one_line(error)}); give tcp://HOST:PORT"
            ) from None
        try:
            with _explained(address, client):
                try:
                    client.wait_for_workers(1, timeout=soon_s)
                except TimeoutError:
                    raise InputError(f"{address}: the Dask cluster has no workers; start some") from None
            yield client
        finally:
            with suppress(OSError, RuntimeError):  # it may be gone; the results have been received
                client.close()


async def _greet(address: str, soon_s: float) -> None:
    """Raise unless a scheduler answers as one in time: Dask's client waits for minutes for other servers."""
    from distributed import Security
    from distributed.core import rpc

    security = Security().get_connection_args("client")
    async with asyncio.timeout(soon_s), rpc(address, connection_args=security) as server:
        who = await server.identity()
    if who["type"] != "Scheduler":
        raise ValueError(f"it is a {who['type']}")


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppress Dask's long log messages while it reconnects and closes; the error is one line instead.

    Which of its parts notices first that a scheduler is gone depends on what it was doing, so all are
    silenced: its own loggers, some of which have their own level, and those of its event loop.
    """
    logs = [logging.getLogger(name) for name in _LOGGERS]
    levels = [log.level for log in logs]
    for log in logs:
        log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for log, level in zip(logs, levels, strict=True):
            log.setLevel(level)


def _spread(
    client: Client, address: str, jobs: Iterable[tuple[Key, Callable | None]], how: tuple, named:
    Callable[[Key], object],
) -> Iterator[tuple[Key, Any]]:  # fmt: skip
    """Results or errors of jobs, as they arrive."""
    from distributed import wait

    def submit(job: Callable) -> Any:
        with warnings.catch_warnings():
            # Dask would have large arguments scattered; but scattered data is lost with its worker.
            warnings.filterwarnings("ignore", "Sending large graph", UserWarning)
            # One callable, since Dask walks through arguments down to the last key.
            return client.submit(partial(_here, job, *how), pure=False)

    def first_ones(futures: Iterable) -> Iterable:
        some = list(futures)
        return _patiently(client, lambda s: wait(some, timeout=s, return_when="FIRST_COMPLETED").done)

    asked_s, n_threads = -math.inf, 0

    def n_most() -> float:
        nonlocal asked_s, n_threads
        # Asking the scheduler takes as long as submitting a job.
        if not n_threads or time.monotonic() > asked_s + _ANEW_S:
            asked_s, n_threads = time.monotonic(), sum(client.nthreads().values())
        return 2 * n_threads or math.inf

    with _explained(address, client):
        for key, future in as_they_come(jobs, submit, first_ones, n_most):
            if future is None:
                yield key, None
            elif future.status == "error":
                yield key, _not_run(future.exception(PATIENCE_S), named(key))
            else:
                yield key, _patiently(client, future.result)


def _not_run(error: Exception, name: object) -> InputError:
    """Why Dask could not run `_here`, in one line; errors inside it are returned as its result."""
    from distributed import KilledWorker

    if isinstance(error, KilledWorker):
        last = getattr(error.last_worker, "address", "an unknown one")
        return InputError(f"{name}: every worker that ran it died, most recently {last}")
    return InputError(
        f"the Dask cluster cannot run its jobs ({one_line(error)}); "
        "install the same environment and weights on scheduler and workers"
    )


def _patiently(client: Client, ask: Callable[[float], Answer]) -> Answer:
    """Ask until there is an answer, with no time limit, while there are workers."""
    while True:
        try:
            return ask(PATIENCE_S)
        except TimeoutError:
            if not client.nthreads():
                raise ConnectionError("it has lost its workers") from None


@contextmanager
def _explained(address: str, client: Client) -> Iterator[None]:
    """Around calls of Dask only: report in one line that the cluster is gone, whatever exception shows it."""
    from distributed.client import ClosedClientError

    try:
        yield
    except (CancelledError, OSError, ClosedClientError, AttributeError, RuntimeError) as error:
        # A closed client has no scheduler or loop; with an open one, this error would be a bug.
        if isinstance(error, (AttributeError, RuntimeError)) and client.status == "running":
            raise
        raise InputError(
            f"{address}: the Dask cluster is gone ({one_line(error)}); run the same command again to continue"
        ) from None


# Everything below runs on the workers.

_checking, _alone = threading.Lock(), threading.Lock()


def _here(*arguments: Any) -> Any:
    """What `_run` returns or raises, as a value, so that any exception raised is Dask's own."""
    try:
        return _run(*arguments)
    except Exception as error:
        error.add_note(traceback.format_exc())  # errors are sent without it
        return error


def _run(job: Callable, expected: dict, found_there: Callable[[], dict], write: bool, alone: bool) -> Any:
    from distributed import get_worker

    worker = get_worker().address
    cv2.setNumThreads(1)
    try:
        with _checking:
            differing = _differences(expected, found_there())
    except (InputError, OSError) as error:
        raise InputError(f"worker {worker}: {one_line(error)}") from None
    if differing:
        raise InputError(
            f"worker {worker}: would compute something else, since these differ from here: "
            f"{', '.join(differing)}; install the same environment and weights, and restart it"
        )
    with _alone if alone else nullcontext():
        return _with_files(job) if write else job()


def _with_files(job: Callable[[Path], Any]) -> tuple[Any, dict[str, bytes]]:
    """What a job returns, and the files it wrote."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        result = job(folder)
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        return result, {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def _differences(one: object, other: object, where: str = "") -> list[str]:
    """The keys of nested dictionaries whose values differ."""
    if not (isinstance(one, dict) and isinstance(other, dict)):
        return [] if one == other else [where]
    return [
        difference
        for key in sorted(one.keys() | other.keys())
        for difference in _differences(one.get(key), other.get(key), f"{where}.{key}".lstrip("."))
    ]
