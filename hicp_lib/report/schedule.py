"""Which job starts when: some at a time, each after those it needs."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from functools import cache
from graphlib import TopologicalSorter


def needed(after: Mapping[str, Sequence[str]], name: str) -> set[str]:
    """A job and all that come before it, directly or through others.

    Examples
    --------
    >>> sorted(needed({"a": [], "b": ["a"], "c": ["b"], "d": ["a"]}, "c"))
    ['a', 'b', 'c']
    """
    return {name}.union(*(needed(after, other) for other in after[name]))


def run_when_ready(
    after: Mapping[str, Sequence[str]],
    job: Callable[[str, list[Future]], object],
    pool: Executor,
    n_parallel: int,
) -> dict[str, Future]:
    """Run every job once those before it have ended, well or not; its ended future by its name.

    Of those that are ready, the one at the head of the longest chain of others goes first: started late, it
    would keep them all waiting; among equals the first in `after`.

    Parameters
    ----------
    after : mapping of str to sequence of str
        Names of the jobs before it, by the name of every job.
    job : callable
        Takes a name and the ended futures of those before it; called in the pool.
    pool : Executor
    n_parallel : int
        Jobs at a time; as many as the pool has workers, so that none is queued before its turn.

    Returns
    -------
    dict of str to Future

    Raises
    ------
    graphlib.CycleError
        If jobs wait for each other.

    Examples
    --------
    >>> from concurrent.futures import ThreadPoolExecutor
    >>> with ThreadPoolExecutor(1) as pool:
    ...     done = run_when_ready({"b": ["a"], "a": []}, lambda name, before: name.upper(), pool, 1)
    >>> list(done), done["b"].result()
    (['a', 'b'], 'B')
    """
    order = TopologicalSorter(after)
    order.prepare()
    urgency = _urgency(after)
    ready: list[str] = []
    done: dict[str, Future] = {}
    running: dict[Future, str] = {}
    while order.is_active():
        ready = sorted([*ready, *order.get_ready()], key=urgency.index)
        while ready and len(running) < n_parallel:
            name = ready.pop(0)
            running[pool.submit(job, name, [done[other] for other in after[name]])] = name
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            name = running.pop(future)
            done[name] = future
            order.done(name)
    return done


def _urgency(after: Mapping[str, Sequence[str]]) -> list[str]:
    """All jobs, by falling length of the longest chain that begins with each."""

    @cache
    def length(name: str) -> int:
        return 1 + max((length(later) for later, earlier in after.items() if name in earlier), default=0)

    return sorted(after, key=length, reverse=True)
