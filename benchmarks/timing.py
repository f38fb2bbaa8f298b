"""How the benchmarks take time: processor time, the best of some turns, whatever is compared turn by turn."""

from __future__ import annotations

import time
from collections.abc import Callable


def best_seconds(*works: Callable[[], object], turns: int = 3, calls: int = 1) -> list[float]:
    """Least processor time of a call of each work; a machine that slows down meanwhile slows all of them.

    Short works are called several times in a row, as where they are used.
    """
    best_s = [float("inf")] * len(works)
    for _ in range(turns):
        for k, work in enumerate(works):
            start_s = time.process_time()
            for _ in range(calls):
                work()
            best_s[k] = min(best_s[k], (time.process_time() - start_s) / calls)
    return best_s
