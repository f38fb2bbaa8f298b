"""Keep a native library quiet: nothing on standard error, nothing sent over the network.

MediaPipe 1.x reports usage metrics (no images) to its vendor every minute and whenever a task
is closed, and has no switch for that. Its HTTP client obeys the usual proxy variables, so
these are pointed at a closed port of this machine before the library is used. The study
contacts nobody; the tests watch that it stays so.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

# Port 9 ("discard") of this machine: a connection is refused at once.
_NOWHERE = {"https_proxy": "http://127.0.0.1:9", "no_proxy": "localhost", "NO_PROXY": "localhost"}
_before: dict[str, str | None] = {}


def keep_offline() -> None:
    """Send this process's proxied HTTPS nowhere, from now on. Child processes inherit it."""
    if not _before:
        _before.update({name: os.environ.get(name) for name in _NOWHERE})
        os.environ.update(_NOWHERE)


def user_environment() -> dict[str, str]:
    """The environment as it was before `keep_offline`, for a child process that may use the network."""
    environment = {**os.environ, **_before}
    return {name: value for name, value in environment.items() if value is not None}


_lock = threading.Lock()
_quiet_depth = 0
_saved_stderr = -1


@contextmanager
def quiet_stderr() -> Iterator[None]:
    """Discard what is written to file descriptor 2, which native libraries use directly.

    The descriptor belongs to the whole process, so the first of several threads in such a
    block redirects it and the last one restores it.
    """
    _redirect()
    try:
        yield
    finally:
        _restore()


def _redirect() -> None:
    global _quiet_depth, _saved_stderr
    with _lock:
        if _quiet_depth == 0:
            sys.stderr.flush()
            _saved_stderr = os.dup(2)
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, 2)
            os.close(nowhere)
        _quiet_depth += 1


def _restore() -> None:
    global _quiet_depth
    with _lock:
        _quiet_depth -= 1
        if _quiet_depth == 0:
            os.dup2(_saved_stderr, 2)
            os.close(_saved_stderr)
