"""What a process is given by its surroundings: cores, and variables that something reads when it starts."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_lock = threading.RLock()


def usable_cores() -> int:
    """Cores that this process may use; at least 1."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def with_variables(**variables: str) -> Iterator[None]:
    """Set variables of this process for a block, which is to be short: they are everybody's.

    Of several threads one at a time does so, and then all is as it was before.
    """
    with _lock:
        before = {name: os.environ.get(name) for name in variables}
        os.environ.update(variables)
        try:
            yield
        finally:
            for name, value in before.items():
                os.environ.pop(name, None) if value is None else os.environ.update({name: value})
