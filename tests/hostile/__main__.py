"""Judge hostile inputs: `python -m tests.hostile [BEGINNING OF A NAME]...`; a table of what fell.

`--mutated N [KIND]...` judges N files of each kind with changed bytes in place of the corpus.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path

from hicp_lib.detectors.weights.default import weights_dir
from tests.hostile import mutated
from tests.hostile.corpus import corpus
from tests.hostile.judge import Judge


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("wanted", nargs="*")
    parser.add_argument("--mutated", type=int, metavar="N")
    parser.add_argument("--every", type=int, default=1, metavar="K", help="of the corpus, one of K")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    if asked.mutated is None:
        named = corpus().items()
        cases = [case for of in asked.wanted or ("",) for name, case in named if name.startswith(of)]
        cases = cases[:: asked.every]
    else:
        kinds = tuple(asked.wanted) or tuple(mutated.COMMANDS)
        cases = list(mutated.cases(asked.mutated, asked.seed, kinds))
    n, fell, refused = Counter[str](), Counter[str](), Counter[str]()
    cpu_s, start_s = 0.0, time.monotonic()
    with tempfile.TemporaryDirectory() as folder, suppress(KeyboardInterrupt):  # a table of what was done
        judge = Judge(Path(folder), weights_dir())
        for case in cases:
            told = judge.faults(case)
            n[case.kind] += 1
            refused[case.kind] += not told and judge.used["status"] != 0
            cpu_s += judge.used["cpu_s"]
            if told:
                fell[case.kind] += 1
                print(f"FELL {case.name}\n       " + "\n       ".join(map(ascii, told)), flush=True)
        judge.close()
    for kind, of in n.items():
        right = of - refused[kind] - fell[kind]
        print(f"{kind:<20} {of:>4} cases: {refused[kind]:>4} refused, {right:>4} right, {fell[kind]:>3} fell")
    took = f"{cpu_s:.0f} s of a processor, {time.monotonic() - start_s:.0f} s in all"
    print(f"{n.total()} of {len(cases)} cases, {refused.total()} refused, {fell.total()} fell; {took}")
    return bool(fell)


if __name__ == "__main__":
    sys.exit(main())
