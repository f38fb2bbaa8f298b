"""Schedule jobs: several in parallel, each after those it needs."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from functools import cache
from graphlib import TopologicalSorter


def needed(after: Mapping[str, Sequence[str]], name: str) -> set[str]:
    """A job and all its predecessors, direct and indirect.

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
    """Run every job after its predecessors have ended, successfully or not; returns ended futures by name.

    Of the jobs that are ready, the one with the longest chain of successors starts first, since they all wait
    for it; among equals the first in `after`.

    Parameters
    ----------
    after : mapping of str to sequence of str
        Names of the jobs before it, by the name of every job.
    job : callable
        Takes a name and the ended futures of those before it; called in the pool.
    pool : Executor
    n_parallel : int
        Jobs at a time; equal to the pool's number of workers, so that none is queued too early.

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
    """All jobs, by decreasing length of the longest chain that starts with each."""

    @cache
    def length(name: str) -> int:
        return 1 + max((length(later) for later, earlier in after.items() if name in earlier), default=0)

    return sorted(after, key=length, reverse=True)
