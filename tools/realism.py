"""Do detectors take changed people more like photographed ones? The same scenes, before and after a change.

    python tools/realism.py render FOLDER          # in a checkout of each version
    python tools/realism.py compare BEFORE AFTER   # two such folders

Renders scenes of development identities, cuts the people out (Basic and Headless), runs detectors of bodies
on the crops of those who are in both folders, and writes `data/reference/realism.csv`: AP of bodies before
and after, the change with its 95 % interval (scenes are resampled, the same ones before and after), and AP on
photographs (`tools/photographs.py`).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from hicp_lib.core.datafiles import REFERENCE_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.datasets.subsets import SUBSETS, create_hicp
from hicp_lib.detectors.runtime.results import detections_of
from hicp_lib.detectors.runtime.run import time_dataset
from hicp_lib.evaluation.ap.bootstrap import difference
from hicp_lib.evaluation.ap.metric_table import Drawn, draw_cases
from hicp_lib.formats.annotations import Annotations, read_annotations
from hicp_lib.simulation.world.scenes import render_dataset
from hicp_lib.study.photographs import photographs

N_SCENES, SEED = 150, 7
DETECTORS = ("movenet-lightning", "movenet-thunder", "mediapipe-pose")


def render(folder: Path) -> None:
    """Scenes, and the crops made of them."""
    render_dataset(folder / "scenes", N_SCENES, SEED, workers=1, split="development")
    create_hicp(folder / "scenes" / "annotations.json", folder / "scenes" / "images", folder / "hicp")


def compare(before: Path, after: Path) -> pd.DataFrame:
    """AP before and after, of the same people."""
    first, second = (read_annotations(folder / "scenes" / "annotations.json") for folder in (before, after))
    if who(first) != who(second):
        raise InputError(f"{before}, {after}: not the same people; render both with the same identities")
    truths = [
        {subset: read_annotations(folder / "hicp" / subset / "annotations.json") for subset in SUBSETS}
        for folder in (before, after)
    ]
    shared = {subset: truths[0][subset].images.keys() & truths[1][subset].images.keys() for subset in SUBSETS}
    was, now = (
        drawn(folder / "hicp", truth, shared) for folder, truth in zip((before, after), truths, strict=True)
    )
    photographed = photographs("metrics").query("metric == 'AP'").set_index(["subset", "detector"])["value"]
    rows = []
    for case, (its, samples) in now.items():
        subset, detector, _ = case
        earlier, draws = was[case]
        change = difference(its, earlier, samples, draws)["AP"]
        known = photographed[subset, detector]
        rows.append((subset, detector, known, earlier.AP, its.AP, *change, its.n_people))
    columns = "subset detector photographs before after change low high n_people".split()
    return pd.DataFrame(rows, columns=columns)


def who(people: Annotations) -> list:
    """Everybody's identity, with the image they are in."""
    return [(i, extra["identity"]) for i, extra in zip(people.image_ids.tolist(), people.extras, strict=True)]


def drawn(folder: Path, truth: dict[str, Annotations], shared: dict[str, set[int]]) -> Drawn:
    """AP of bodies of every subset and detector, with draws."""
    kept = {subset: of.of_images(shared[subset]) for subset, of in truth.items()}
    found = {}
    for subset in SUBSETS:
        for detector in DETECTORS:
            run = detections_of(time_dataset(detector, folder / subset))
            found[subset, detector] = {i: seen for i, seen in run.items() if i in shared[subset]}
    return draw_cases(kept, found, groups=["body"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(required=True)
    make = commands.add_parser("render", help=render.__doc__)
    make.add_argument("folder", type=Path)
    make.set_defaults(run=lambda options: render(options.folder))
    judge = commands.add_parser("compare", help=compare.__doc__)
    judge.add_argument("folders", type=Path, nargs=2, metavar=("BEFORE", "AFTER"))
    judge.set_defaults(run=lambda options: report(compare(*options.folders)))
    options = parser.parse_args()
    options.run(options)


def report(table: pd.DataFrame) -> None:
    """Write and print the table."""
    table.round(4).to_csv(REFERENCE_DIR / "realism.csv", index=False)
    print(table.round(3).to_string(index=False))


if __name__ == "__main__":
    main()
