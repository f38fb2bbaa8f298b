"""Commands that are killed at any moment, or whose files a power cut leaves cut off, and then run again.

`python -m tests.hostile.kills --n 200 [KIND]...` kills so many and prints a table.
"""

from __future__ import annotations

import argparse
import os
import random
import shlex
import shutil
import sys
import tempfile
from collections import Counter
from contextlib import suppress
from pathlib import Path

from hicp_lib.detectors.weights.default import weights_dir
from tests.hostile.good import CREATE, DETECT, DRAW, IMPORT_OPEN3D, make_good
from tests.hostile.judge import Ready, state

# What is run, and how often of 100 kills: rendering takes seconds of a processor.
COMMANDS = {
    "detect": (f"{DETECT} --out out/d.json", 26),
    "create": (f"{CREATE} --out out", 26),
    "import bag": ("record import out --bag x.bag", 14),
    "import open3d": (IMPORT_OPEN3D, 10),
    "draw": (f"{DRAW} --out out", 10),
    "render": ("scenes render out --n 2 --workers 2", 7),
    "simulate": ("record simulate mocap out --n-frames 2 --workers 2", 7),
}
GO_ON = ("detect", "create", "render", "simulate")  # the others want a new folder when they were done
LONG_S = 300.0


def finals(folder: Path) -> dict[str, tuple]:
    """Files of a folder under their final names."""
    return {name: of for name, of in state(folder).items() if not any(p[0] == "." for p in Path(name).parts)}


class Killing:
    """One command in a folder of its own, and what it gives undisturbed.

    Parameters
    ----------
    folder : Path
    kind : str
        Of `COMMANDS`.
    ready : Ready
    """

    def __init__(self, folder: Path, kind: str, ready: Ready) -> None:
        self.ready, self.kind = ready, kind
        self.folder = folder / kind.replace(" ", "_")
        self.good = make_good(self.folder / "good")
        for k in range(9):
            shutil.copy(self.good / "pictures" / "a.png", self.good / "pictures" / f"more{k}.png")
        work, cache = self._new()
        used, _, errors = self._run(work, cache)
        assert used["status"] == 0, errors
        self.duration_s = used["wall_s"]
        self.expected = finals(work / "out")
        assert self.expected

    def _new(self) -> tuple[Path, Path]:
        work, cache = self.folder / "work", self.folder / "cache"  # always the same: some files name them
        for folder in (work, cache):
            shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(self.good, work)
        cache.mkdir()
        if weights_dir().is_dir():
            (cache / "weights").symlink_to(weights_dir())
        return work, cache

    def _run(self, work: Path, cache: Path, kill_s: float | None = None) -> tuple[dict, str, str]:
        arguments = shlex.split(COMMANDS[self.kind][0])
        return self.ready.run(work, arguments, {"HICP_CACHE": str(cache)}, wall_s=LONG_S, kill_s=kill_s)

    def killed(self, moments: random.Random) -> list[str]:
        """What is wrong after a kill at a random moment, and after the next run."""
        work, cache = self._new()
        told: list[str] = []
        used, *_ = self._run(work, cache, moments.uniform(0, self.duration_s))
        if used["orphans"]:
            told.append(f"{used['orphans']} processes outlive it")
        left = finals(work / "out")
        told += [f"{name} is half-written" for name, of in left.items() if of != self.expected.get(name)]
        return told + self._again(work, cache)

    def cut(self, moments: random.Random) -> list[str]:
        """What is wrong where a power cut left a file of the end state short, after the next run."""
        work, cache = self._new()
        self._run(work, cache)
        files = [path for path in (*(work / "out").rglob("*"), *cache.rglob("*"))
                 if path.is_file() and not path.is_relative_to(cache / "weights")]  # fmt: skip
        path = moments.choice(sorted(files))
        os.truncate(path, moments.choice((0, path.stat().st_size // 2)))
        return [f"{path.name} cut: {fault}" for fault in self._again(work, cache)]

    def _again(self, work: Path, cache: Path) -> list[str]:
        was_done = finals(work / "out") == self.expected
        used, _, errors = self._run(work, cache)
        if self.kind not in GO_ON and was_done and "is there already" in errors:
            return []
        code = os.waitstatus_to_exitcode(used["status"])
        told = [f"exit code {code}: {errors[-300:]}"] if code else []
        found = finals(work / "out")
        wrong = [name for name in found | self.expected if found.get(name) != self.expected.get(name)]
        told += [f"{name} differs after the next run" for name in wrong]
        told += [f"{name} is left" for name in state(work) if ".partial" in name]
        return told


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", default=list(COMMANDS))
    parser.add_argument("--n", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    shares = {kind: COMMANDS[kind][1] for kind in asked.kinds}
    moments, n, fell = random.Random(asked.seed), Counter[str](), Counter[str]()
    with tempfile.TemporaryDirectory() as name, suppress(KeyboardInterrupt):  # a table of what was done
        ready = Ready(Path(name), {})
        for kind, share in shares.items():
            killing = Killing(Path(name), kind, ready)
            for _ in range(round(asked.n * share / sum(shares.values()))):
                for how in ("killed", "cut"):
                    if how == "killed" or (kind in GO_ON and moments.random() < 0.25):
                        n[f"{kind}, {how}"] += 1
                        if told := getattr(killing, how)(moments):
                            fell[f"{kind}, {how}"] += 1
                            print(f"FELL {kind}, {how}: " + ascii("; ".join(told))[:600], flush=True)
        ready.close()
    for kind, of in n.items():
        print(f"{kind:<24} {of:>4}, {fell[kind]:>3} fell")
    return bool(fell)


if __name__ == "__main__":
    sys.exit(main())
