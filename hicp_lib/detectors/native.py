"""Keep a native library quiet: nothing on standard error, nothing sent over the network.

MediaPipe 1.x reports usage metrics (no images) to its vendor every minute and whenever a task
is closed, and has no switch for that. Its HTTP client obeys the usual proxy variables, so
these are pointed at a closed port of this machine before the library is used. The study
contacts nobody; the tests watch that it stays so.
"""

from __future__ import annotations

import os
import sys
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


@contextmanager
def quiet_stderr() -> Iterator[None]:
    """Discard what is written to file descriptor 2, which native libraries use directly."""
    sys.stderr.flush()
    saved = os.dup(2)
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
