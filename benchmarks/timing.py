"""What the benchmarks share: sizes, clocks, and one table of times beside named baselines of the same run."""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import psutil

from hicp_lib.core.errors import InputError


@dataclass(frozen=True)
class Comparison:
    """A time, its baseline's, and what the project asks for, of the ratio or of the time itself.

    Where `unit` is GB, they are memory.
    """

    what: str
    ours_s: float
    baseline: str
    baseline_s: float
    most: float | None = None
    most_s: float | None = None
    unit: str = "s"

    @property
    def ratio(self) -> float:
        return self.ours_s / self.baseline_s

    @property
    def floor(self) -> str:
        """The floor in words, and whether it was missed; empty if there is none."""
        if self.most is None and self.most_s is None:
            return ""
        text, missed = (
            (_amount(self.most_s, self.unit), self.ours_s > self.most_s)
            if self.most is None
            else (f"{self.most:.2f}", self.ratio > self.most)
        )
        return text + " (missed)" * missed


def run(measure: Callable[[argparse.Namespace], Iterator[Comparison]], about: str, **sizes: tuple) -> None:
    """Read the sizes, print each comparison as soon as it is there, write all of them as JSON if asked.

    Parameters
    ----------
    measure : callable
        Makes the comparisons from the options. An `InputError` says what is absent, and ends them.
    about : str
        The benchmark's docstring.
    sizes : tuple
        The usual and the smallest value of each option.
    """
    options = _options(about, sizes)
    load = os.getloadavg()[0]
    rows, left_out = [], None
    print("| measured | time | baseline | time | ratio | at most |\n|---|---|---|---|---|---|", flush=True)
    try:
        for row in measure(options):
            rows.append(asdict(row) | {"ratio": row.ratio})
            times = _amount(row.ours_s, row.unit), row.baseline, _amount(row.baseline_s, row.unit)
            print(
                "|",
                " | ".join((row.what, *times, f"{row.ratio:.3g}", "" if options.smallest else row.floor)),
                "|",
                flush=True,
            )
    except InputError as error:
        left_out = str(error)
        print(f"left out: {error}")
    machine = {
        "processor": platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "load_before": round(load, 1),
        "python": platform.python_version(),
        "numpy": np.__version__,
    }
    used = {name: getattr(options, name) for name in sizes}
    for told in (used, machine):
        print(*(f"{key.replace('_', ' ')} {value}" for key, value in told.items()), sep=", ", flush=True)
    if options.json:
        result = {"machine": machine, "sizes": used, "rows": rows, "left_out": left_out}
        options.json.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


def _options(about: str, sizes: dict[str, tuple]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=about.splitlines()[0])
    parser.add_argument("--smallest", action="store_true", help="does it run? sizes not given are the least")
    parser.add_argument("--json", type=Path, help="file for the result")
    for name, (usual, least) in sizes.items():
        parser.add_argument(f"--{name}", type=type(usual), help=f"{usual}; smallest: {least}")
    options = parser.parse_args()
    for name, values in sizes.items():
        if getattr(options, name) is None:
            setattr(options, name, values[options.smallest])
    return options


def _amount(value: float, unit: str) -> str:
    if unit == "s" and value < 1:
        return f"{1e3 * value:.3g} ms"
    return f"{value:.3g} {unit}"


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


def processor_s() -> float:
    """Processor time of this process and of its children, running or ended."""
    running = [child.cpu_times() for child in psutil.Process().children()]
    # The system counts children's in hundredths of a second; this process has a finer clock.
    ended_s = sum(os.times()[2:4])
    return time.process_time() + ended_s + sum(times.user + times.system for times in running)
