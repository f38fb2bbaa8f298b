"""Simulated results in shuffled orders, in one process and in many: every one has to be the same to the bit.

    python benchmarks/same_bytes.py [--scenes 500] [--rendered 100] [--others 6] [--seed 0]

Dresses the people of scenes, renders some, and makes frames of all recordings, motion capture, doses and
avoidance: in the numbers' order by one worker, and shuffled by 1, 2 and 4. Texts are hashed and threads are
counted in another way each time. Ends with 1 if anything differs.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import random
import sys
import time
from pathlib import Path

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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=500, help="whose people are dressed")
    parser.add_argument("--rendered", type=int, default=100, help="scenes that are rendered, too")
    parser.add_argument("--others", type=int, default=6, help="of every other kind")
    parser.add_argument("--seed", type=int, default=0, help="of the orders")
    arguments = parser.parse_args()
    asked = names(arguments.scenes, arguments.rendered, arguments.others)
    differing: set[str] = set()
    first = None
    for turn, workers in enumerate((1, 1, 2, 4)):
        start_s = time.perf_counter()
        if turn:
            random.Random(arguments.seed + turn).shuffle(asked)
        found = made(asked, workers, turn)
        first = first or found
        other = {name for name in asked if found[name] != first[name]}
        differing |= other
        order = "shuffled" if turn else "in order"
        print(f"{workers} workers, {order}: {time.perf_counter() - start_s:.0f} s, {len(other)} differ")
    print(f"{len(differing)} of {len(asked)} differ", *sorted(differing), sep="\n")
    sys.exit(bool(differing))


if __name__ == "__main__":
    main()
