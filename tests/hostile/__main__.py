"""Judge hostile inputs: `python -m tests.hostile [BEGINNING OF A NAME]...`; a table of what fell."""

from __future__ import annotations

import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from hicp_lib.detectors.weights.default import weights_dir
from tests.hostile.corpus import corpus
from tests.hostile.judge import Judge


def main() -> int:
    wanted = sys.argv[1:] or [""]
    cases = [case for name, case in corpus().items() if name.startswith(tuple(wanted))]
    n, fell, cpu_s, start_s = Counter[str](), Counter[str](), 0.0, time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        judge = Judge(Path(folder), weights_dir())
        for case in cases:
            told = judge.faults(case)
            n[case.kind] += 1
            cpu_s += judge.used["cpu_s"]
            if told:
                fell[case.kind] += 1
                print(f"FELL {case.name}\n       " + "\n       ".join(map(ascii, told)), flush=True)
        judge.close()
    for kind, of in n.items():
        print(f"{kind:<20} {of:>4} cases, {fell[kind]:>3} fell")
    print(
        f"{len(cases)} cases, {fell.total()} fell; {cpu_s:.0f} s of a processor, "
        f"{time.monotonic() - start_s:.0f} s in all"
    )
    return bool(fell)


if __name__ == "__main__":
    sys.exit(main())
