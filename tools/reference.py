"""Store a run of the report as the reference run of its profile, for comparison with other runs.

    python tools/reference.py results/full

Writes `data/reference/full/`: for every notebook its values, the tables it shows and its stamp. The run must
be of a single commit, without changes, so that it can be repeated.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path

import pyarrow.parquet as pq

from hicp_lib.core.datafiles import REFERENCE_DIR
from hicp_lib.core.files import read_json
from hicp_lib.report.repetition import is_measured

MAX_ROWS = 1000  # of a table that is read; what is longer was drawn
MAX_BYTES = 2_000_000


def shown_tables(folder: Path) -> list[Path]:
    """Files of the tables that a notebook shows, or draws from few rows, times apart."""
    paths = [folder / f"{name}.parquet" for name in read_json(folder / "captions.json")]
    tables = [path for path in paths if path.is_file() and not is_measured(path.stem)]
    return [path for path in tables if pq.read_metadata(path).num_rows <= MAX_ROWS]


def keep(results: Path, reference: Path) -> int:
    """Write the reference run anew; its size in bytes."""
    stamps = {path.parent: read_json(path) for path in sorted(results.glob("*/provenance.json"))}
    if not stamps:
        sys.exit(f"{results}: holds no results; give a folder such as results/full after a report")
    commits = {stamp["git"]["commit"] for stamp in stamps.values()}
    changed = [folder.name for folder, stamp in stamps.items() if stamp["git"]["changed_files"]]
    if len(commits) > 1 or changed:
        said = f"{', '.join(changed)} with changed files" if changed else f"of {len(commits)} commits"
        sys.exit(f"{results}: was made {said}; commit, remove results and make the report again")
    shutil.rmtree(reference, ignore_errors=True)
    for folder in stamps:
        (reference / folder.name).mkdir(parents=True)
        for path in (folder / "values.json", folder / "provenance.json", *shown_tables(folder)):
            shutil.copy(path, reference / folder.name)
    return sum(path.stat().st_size for path in reference.rglob("*") if path.is_file())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path, help="folder of results, such as results/full")
    results = parser.parse_args().results.resolve()
    reference = REFERENCE_DIR / results.name
    n_bytes = keep(results, reference)
    print(f"{reference}: {n_bytes / 1e6:.2f} MB")
    if n_bytes > MAX_BYTES:
        sys.exit(f"{reference}: more than {MAX_BYTES / 1e6:g} MB; show fewer rows, or lower MAX_ROWS")


if __name__ == "__main__":
    main()
