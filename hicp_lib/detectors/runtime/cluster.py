"""Spread images over an existing Dask cluster.

The images' bytes travel, not their paths, so no folder need be shared. Scheduler and workers need this
package as it is installed here, and the workers the weights; a worker that would find something else
(other weights, settings, code or libraries) refuses. Results are kept here as they come in. An image
whose worker dies goes to another; Dask gives up on it when it has outlived as many workers as Dask's
setting `distributed.scheduler.allowed-failures` says.

Dask's workers execute what its clients send them: connect only to a cluster you trust.
"""

from __future__ import annotations

import logging
import re
import threading
import traceback
import warnings
from collections.abc import Callable, Hashable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import cv2
import numpy as np

from hicp_lib.core.detections import Detector
from hicp_lib.core.errors import InputError, one_line
from hicp_lib.core.extras import needs
from hicp_lib.core.files import sha256_bytes
from hicp_lib.core.images import decode_image, image_bytes
from hicp_lib.detectors.runtime.pool import DetectorPool, naming_image
from hicp_lib.detectors.runtime.results import (
    Timed,
    cache_folder,
    identity,
    read_result,
    result_path,
    write_result,
)

if TYPE_CHECKING:
    from distributed import Client, Future

# Checked here, since Dask starts threads, and for an empty address a cluster, before it looks.
_ADDRESS = re.compile(r"(tcp|tls|ws|wss|ucx)://\S+:\d{1,5}")
Key = TypeVar("Key", bound=Hashable)
Answer = TypeVar("Answer")
# How long to wait for the scheduler, and for workers where there are none.
PATIENCE_S = 30.0
_LOGGERS = ("distributed", "distributed.client", "tornado.application", "asyncio")


def detect_on_cluster(
    address: str,
    name: str,
    options: dict,
    detector: Detector,
    jobs: dict[Key, tuple[Path, np.ndarray | None]],
) -> Iterator[tuple[Key, Timed]]:
    """People in images, by the workers of a Dask cluster; pairs of key and result as they come in.

    Parameters
    ----------
    address : str
        Of Dask's scheduler, e.g. "tcp://127.0.0.1:8786".
    name : str
    options : dict of str to object
        Of the detector, as `make_detector` takes them.
    detector : Detector
        The same, made here; workers' ones must equal it in all that results depend on.
    jobs : dict of object to (Path, array or None)
        Image file, and boxes (n, 4: x, y, width, height) if the detector takes them, by any key.

    Yields
    ------
    (object, Timed)
        Key and result.

    Raises
    ------
    InputError
        If the extra is not installed, the cluster cannot be reached, has no workers or loses them, a
        worker cannot make the same detector, or an image cannot be read or kills its workers.
    """
    folder = cache_folder(detector)
    paths = {
        key: result_path(folder, sha256_bytes(image_bytes(path)), boxes_px)
        for key, (path, boxes_px) in jobs.items()
    }
    missing = []
    for key, path in paths.items():
        result = read_result(path)
        if result is None:
            missing.append(key)
        else:
            yield key, result
    if missing:
        todo = ((key, (image_bytes(jobs[key][0]), str(jobs[key][0]), jobs[key][1])) for key in missing)
        with _connected(address) as client:
            for key, answer in _spread(client, address, todo, (name, options, identity(detector))):
                if isinstance(answer, Exception):
                    raise answer
                write_result(paths[key], answer)
                yield key, answer


@contextmanager
def _connected(address: str) -> Iterator[Client]:
    with needs("dask"):
        from distributed import Client
    if not _ADDRESS.fullmatch(address):
        raise InputError(f"{address}: no Dask scheduler answers (no address); give one's, tcp://HOST:PORT")
    with _quiet():
        try:
            client = Client(address, timeout=PATIENCE_S)
        except (OSError, ValueError, RuntimeError, AssertionError) as error:  # its thread is late
            raise InputError(
                f"{address}: no Dask scheduler answers ({one_line(error)}); "
                "give one's address, tcp://HOST:PORT"
            ) from None
        try:
            with _explained(address, client):
                try:
                    client.wait_for_workers(1, timeout=PATIENCE_S)
                except TimeoutError:
                    raise InputError(f"{address}: the Dask cluster has no workers; start some") from None
            yield client
        finally:
            with suppress(OSError, RuntimeError):  # it may be gone; what was found is here
                client.close()


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Dask from telling at length, while it reconnects and closes, what is told in one line.

    Which of its parts notices first that a scheduler is gone depends on what was under way, so all are
    kept quiet: its own loggers, of which some have a level to themselves, and those of the loop it runs in.
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
    client: Client, address: str, todo: Iterator[tuple[Key, tuple]], detector: tuple
) -> Iterator[tuple[Key, Timed | Exception]]:
    """Results as they come in, or what went wrong; no more images travel than keep all workers busy."""
    running: dict[Future, tuple[Key, str]] = {}
    with _explained(address, client):
        for key, (content, path, boxes_px) in todo:
            with warnings.catch_warnings():
                # Dask would have large arguments scattered; but scattered data is lost with its worker.
                warnings.filterwarnings("ignore", "Sending large graph", UserWarning)
                future = client.submit(_detect_here, *detector, content, path, boxes_px, pure=False)
            running[future] = key, path
            while len(running) >= 2 * sum(client.nthreads().values()) > 0:
                yield from _finished(client, running)
        while running:
            yield from _finished(client, running)


def _finished(
    client: Client, running: dict[Future, tuple[Key, str]]
) -> Iterator[tuple[Key, Timed | Exception]]:
    """What is there, at least one; it leaves `running`."""
    from distributed import wait

    def first_ones(timeout_s: float) -> set[Future]:
        return wait(list(running), timeout=timeout_s, return_when="FIRST_COMPLETED").done

    for future in _patiently(client, first_ones):
        key, path = running.pop(future)
        if future.status == "error":
            yield key, _not_run(future.exception(PATIENCE_S), path)
        else:
            yield key, _patiently(client, future.result)


def _not_run(error: Exception, path: str) -> InputError:
    """Why Dask could not run `_detect_here`, in one line: what goes wrong within comes back as its result."""
    from distributed import KilledWorker

    if isinstance(error, KilledWorker):
        last = getattr(error.last_worker, "address", "an unknown one")
        return InputError(f"{path}: every worker that took this image died, lately {last}")
    return InputError(
        f"the Dask cluster cannot run this detector ({one_line(error)}); "
        "install the same environment and weights on scheduler and workers"
    )


def _patiently(client: Client, ask: Callable[[float], Answer]) -> Answer:
    """Ask until there is an answer, however long it takes, but only as long as there are workers."""
    while True:
        try:
            return ask(PATIENCE_S)
        except TimeoutError:
            if not client.nthreads():
                raise ConnectionError("it has lost its workers") from None


@contextmanager
def _explained(address: str, client: Client) -> Iterator[None]:
    """Around calls of Dask's alone: tell in one line that the cluster is gone, however it shows."""
    from distributed.client import ClosedClientError

    try:
        yield
    except (CancelledError, OSError, ClosedClientError, AttributeError, RuntimeError) as error:
        # A client that has closed has no scheduler or loop to ask; of one that runs it would be a fault.
        if isinstance(error, (AttributeError, RuntimeError)) and client.status == "running":
            raise
        raise InputError(
            f"{address}: the Dask cluster is gone ({one_line(error)}); run the same command again to go on"
        ) from None


# What follows runs on the workers.

_making = threading.Lock()


def _detect_here(*arguments: Any) -> Timed | Exception:
    """What `_detect` finds or raises: an error that Dask raises in its place is then Dask's own."""
    try:
        return _detect(*arguments)
    except Exception as error:
        error.add_note(traceback.format_exc())  # errors travel without
        return error


def _detect(
    name: str, options: dict, expected: dict, content: bytes, path: str, boxes_px: np.ndarray | None
) -> Timed:
    from distributed import get_worker

    worker = get_worker()
    try:
        with _making:
            pool = _pool(name, tuple(sorted(options.items())), worker.state.nthreads)
    except (InputError, OSError) as error:
        raise InputError(f"worker {worker.address}: {one_line(error)}") from None
    differing = _differences(expected, identity(pool.first))
    if differing:
        raise InputError(
            f"worker {worker.address}: would find something else, for these differ from here: "
            f"{', '.join(differing)}; install the same environment and weights, and start it anew"
        )
    with naming_image(path):
        return pool.detect(decode_image(content, path), boxes_px)


@lru_cache(maxsize=2)
def _pool(name: str, options: tuple[tuple[str, object], ...], workers: int) -> DetectorPool:
    cv2.setNumThreads(1)
    return DetectorPool(name, dict(options), workers)


def _differences(one: object, other: object, where: str = "") -> list[str]:
    """The keys of nested dictionaries under which there is not the same."""
    if not (isinstance(one, dict) and isinstance(other, dict)):
        return [] if one == other else [where]
    return [
        difference
        for key in sorted(one.keys() | other.keys())
        for difference in _differences(one.get(key), other.get(key), f"{where}.{key}".lstrip("."))
    ]
