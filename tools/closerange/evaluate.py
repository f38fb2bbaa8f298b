"""Evaluate networks for close range, and what they are held against, on rendered people.

    python tools/closerange/evaluate.py NAME=PEOPLE.onnx,HANDS.onnx [...] --out TABLES [--development N]
                                        [--photographs CHECKOUT] [--ways]

By default on the held-out people of the full study: Basic, Headless and Near. `--development N`: on N scenes
of development identities (seed 900003), to choose by. `--photographs CHECKOUT`: on the photographs of
`tools/photographs.py`, where only bodies are judged. Writes TABLES/metrics.csv (average precision of bodies,
hands and single hands), TABLES/differences.csv (the first network less every other detector),
TABLES/extended.csv (by extended OKS) and TABLES/ablations.csv (the networks alone, by their names); of
photographs only TABLES/photographs.csv, like differences.csv. The first network is called "closerange" in the
others; `--ways` adds it to the ablations without its second look at hands, and without presence.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import pandas as pd
from photographs import make_subsets  # noqa: E402

from hicp_lib.core.files import cache_dir
from hicp_lib.datasets.subsets import create_hicp
from hicp_lib.detectors.runtime.results import detections_of
from hicp_lib.detectors.runtime.run import time_dataset
from hicp_lib.evaluation.ap import metric_table
from hicp_lib.evaluation.failures.presence import extended_table
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.formats.annotations import read_annotations
from hicp_lib.simulation.world.scenes import render_dataset
from hicp_lib.study.sources import open_near, open_source

DEVELOPMENT_SEED, MIN_PIXELS = 900_003, 20_000
BODIES = ("movenet-lightning", "movenet-thunder")
_ALL_LOOKS = {"looks": "wrists+mirrored+image+along"}
_COMBINED = ("combined:movenet-thunder+mediapipe-hands", "combined:mediapipe-pose+mediapipe-hands")
OTHERS: dict[str, tuple[str, dict[str, Any]]] = {name: (name, {}) for name in (*BODIES, "mediapipe")}
OTHERS |= {f"{name}, all looks": (name, _ALL_LOOKS) for name in _COMBINED}
"""Detectors and their options that networks are held against; looks as of notebook 02b."""
OURS = "closerange"


def held_out() -> tuple[dict[str, Path], Path]:
    """Folders of the full study's data sets, and the annotations of the whole images."""
    data = open_source()
    near = open_near(data, 96, 0, MIN_PIXELS)
    return data.subsets | {"near": near.basic}, data.annotations


def development(n_scenes: int) -> tuple[dict[str, Path], Path]:
    """As `held_out`, of development identities."""
    folder = cache_dir() / f"closerange_development_{n_scenes}"
    render_dataset(folder / "scenes", n_scenes, DEVELOPMENT_SEED, split="development")
    annotations = folder / "scenes" / "annotations.json"
    create_hicp(annotations, folder / "scenes" / "images", folder / "hicp", MIN_PIXELS)
    return {subset: folder / "hicp" / subset for subset in ("basic", "headless")}, annotations


def networks(models: dict[str, list[str]], ways: bool) -> dict[str, dict[str, Any]]:
    """Options of the detector by name; with `ways`, the first also without its second look, and presence."""
    of = {name: dict(zip(("model", "hand_model"), files, strict=True)) for name, files in models.items()}
    first, *others = of
    made = {OURS: of[first]}
    if ways:
        made[f"{OURS}, without a second look at hands"] = of[first] | {"look_again": False}
        made[f"{OURS}, without presence in its scores"] = of[first] | {"presence": False}
    return made | {f"{OURS}, {name}": of[name] for name in others}


def ablations(metrics: pd.DataFrame, pairs: pd.DataFrame, first: str) -> pd.DataFrame:
    """Average precision of networks by the names they were given, and less that of the one named in `less`.

    "A; B" compares with the one whose name begins with "A", others with the first.
    """
    names = metrics["detector"][metrics["detector"].str.startswith(OURS)].drop_duplicates()
    shown = {name: name.removeprefix(OURS).removeprefix(", ") or first for name in names}
    bases = {}
    for name, variant in shown.items():
        kind, _, way = variant.partition("; ")
        like = [one for one, other in shown.items() if way and ";" not in other and other.startswith(kind)]
        bases[name] = like[0] if like else OURS
    keys = ["detector", "subset", "group"]
    rows = metrics[metrics["detector"].isin(names) & metrics["group"].isin(["body", "hand"])]
    rows = rows[rows["metric"] == "AP"][[*keys, "value", "low", "high"]]
    changes = pairs[(pairs["metric"] == "AP") & (pairs["other"] == pairs["detector"].map(bases))]
    changes = changes.rename(columns={"value": "change", "low": "change_low", "high": "change_high"})
    rows = rows.merge(changes[[*keys, "change", "change_low", "change_high"]], "left", keys)
    less = rows["detector"].map(bases).map(shown).mask(rows["change"].isna())
    rows = rows.assign(variant=rows["detector"].map(shown), less=less)
    bounds = ["value", "low", "high", "less", "change", "change_low", "change_high"]
    return rows[["variant", "subset", "group", *bounds]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("models", nargs="+", help="NAME=PEOPLE.onnx,HANDS.onnx")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--development", type=int, default=0, metavar="N")
    parser.add_argument("--ways", action="store_true", help="also without a second look, without presence")
    parser.add_argument("--photographs", type=Path, metavar="CHECKOUT")
    arguments = parser.parse_args()
    given = dict(text.split("=", 1) for text in arguments.models)
    models = {name: files.split(",") for name, files in given.items()}
    groups, others = metric_table.GROUPS_OF_OBJECTS, OTHERS
    with tempfile.TemporaryDirectory() as place:
        if arguments.photographs:
            folders, whole = make_subsets(arguments.photographs, Path(place))[0], None
            groups, others = ("body",), {name: OTHERS[name] for name in BODIES}
        else:
            folders, whole = development(arguments.development) if arguments.development else held_out()
        truth = {subset: read_annotations(folder / "annotations.json") for subset, folder in folders.items()}
        runs = others | {name: (OURS, options) for name, options in networks(models, arguments.ways).items()}
        found = {
            (subset, name): detections_of(time_dataset(detector, folder, **options))
            for subset, folder in folders.items()
            for name, (detector, options) in runs.items()
        }
    draws = Draws(1000, 0)
    drawn = metric_table.draw_cases(truth, found, draws, groups)
    metrics, pairs = metric_table.metric_table(drawn), metric_table.pairs(drawn)
    ours = pairs[(pairs["detector"] == OURS) & (pairs["metric"] == "AP") & pairs["other"].isin(others)]
    if whole is None:
        tables = {"photographs": ours}
    else:
        first = next(iter(models))
        compared = [OURS, *others]
        told = metrics[metrics["detector"].isin(compared)]
        tables = {"metrics": told, "differences": ours, "ablations": ablations(metrics, pairs, first)}
        kept = [subset for subset in folders if subset != "near"]  # Near is cut from other images
        of_whole = {(s, d): run for (s, d), run in found.items() if s in kept and d in compared}
        bodies = {case: drawn[case] for case in drawn if case[:2] in of_whole and case[2] == "body"}
        known = {subset: truth[subset] for subset in kept}
        tables["extended"] = extended_table(known, of_whole, read_annotations(whole), bodies, draws)
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name, table in tables.items():
        table.to_csv(arguments.out / f"{name}.csv", index=False, float_format="%.4f", lineterminator="\n")
    ap = metrics[metrics["metric"] == "AP"]
    print(ap.pivot_table(index=["group", "detector"], columns="subset", values="value").round(3).to_string())
    for table in [of for name, of in tables.items() if name == "extended"]:
        rows = table.pivot_table(index="detector", columns=["subset", "measure"], values="value")
        print(rows.round(3).to_string())


if __name__ == "__main__":
    main()
