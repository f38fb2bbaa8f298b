"""Simulated results in shuffled orders, in one process and in many: every one has to be the same to the bit.

Dresses the people of scenes, renders some, and makes frames of all recordings, motion capture, doses and
avoidance: in the numbers' order by one worker, and shuffled by 1, 2 and 4. Texts are hashed and threads are
counted in another way each time. Ends with 1 if anything differs. Wall times stand beside the first turn's.
"""

from __future__ import annotations

import multiprocessing
import os
import random
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from timing import Comparison, run

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.simulation import made_results  # noqa: E402


def names(n_scenes: int, n_rendered: int, n_others: int) -> list[str]:
    """What is made, as `made_results` calls it."""
    numbers = dict.fromkeys(made_results.KINDS, n_others) | {"dressed": n_scenes, "scene": n_rendered}
    return [f"{kind} {number}" for kind, n in numbers.items() for number in range(n)]


def made(asked: list[str], workers: int, seed: int) -> dict[str, str]:
    """What workers make, by name."""
    os.environ["PYTHONHASHSEED"] = str(seed)
    os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = str(1 + seed % 3)
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        return dict(zip(asked, pool.imap(made_results.made, asked, chunksize=4), strict=True))


def measure(options) -> Iterator[Comparison]:
    asked = names(options.scenes, options.rendered, options.others)
    differing: set[str] = set()
    first, first_s = None, float("nan")
    for turn, workers in enumerate((1, 1, 2, 4)[: options.turns]):
        start_s = time.perf_counter()
        if turn:
            random.Random(options.seed + turn).shuffle(asked)
        found = made(asked, workers, turn)
        passed_s = time.perf_counter() - start_s
        if first is None:
            first, first_s = found, passed_s
        else:
            yield Comparison(f"shuffled, workers: {workers}", passed_s, "in order, one worker", first_s)
        differing |= {name for name in asked if found[name] != first[name]}
    print(f"{len(differing)} of {len(asked)} differ", *sorted(differing), sep="\n")
    if differing:
        sys.exit(1)


if __name__ == "__main__":
    run(
        measure, __doc__,
        scenes=(500, 2), rendered=(100, 0), others=(6, 0), turns=(4, 2), seed=(0, 0),
    )  # fmt: skip
