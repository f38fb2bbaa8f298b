"""The `hicp` command. Every subcommand only reads its arguments, calls the library and prints.

Libraries are imported inside the commands, so that `hicp --help` is fast.
Exit codes: 0 done, 1 a notebook or the book failed, 2 bad input or usage; always with one line on
standard error, never a traceback for a user's mistake.
"""

import json
import math
import os
import shlex
import signal
import sys
import warnings
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import Any, NoReturn

import click

from hicp_lib import __version__
from hicp_lib.cli.calibration import calibration
from hicp_lib.cli.looking import draw, inspect_
from hicp_lib.cli.models import models
from hicp_lib.cli.options import (
    PATH,
    FiniteRange,
    detector_options,
    given,
    people_option,
    say,
    tell_assumed,
    tell_notes,
    text_table,
    worker_options,
)
from hicp_lib.cli.recordings import lift, record
from hicp_lib.core.errors import InputError, one_line, printable

_MOST_SHOWN = 1000  # characters of a message: a file may hold a name of megabytes
_keypoint_map_option = click.option(
    "--keypoint-map", type=PATH, metavar="FILE.json",
    help="Meaning of the annotations' keypoint names: theirs to ours, or null to leave one out.",
)  # fmt: skip


def main() -> NoReturn:
    """Run the command line and exit."""
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:  # closed by the caller: the next file opened would take its place
            os.dup2(os.open(os.devnull, os.O_RDWR), descriptor)
            setattr(sys, name, open(descriptor, "w" if descriptor else "r"))
    # Damaged input is reported in one line by us: discard the messages of C libraries.
    sys.stderr = os.fdopen(os.dup(2), "w", 1, sys.stderr.encoding, "backslashreplace")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    warnings.filterwarnings("ignore", module="PIL")
    signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))  # cleaned up as after an error
    code = run(sys.argv[1:])
    try:
        sys.stdout.flush()
    except OSError:  # the reader is gone, or the disk is full: nothing more can be written there
        sys.stdout, code = None, code or 2
    sys.exit(code)


def run(arguments: list[str]) -> int:
    """Run one command; its exit code. A user's mistake is reported in one line on standard error.

    Parameters
    ----------
    arguments : list of str
        The arguments after `hicp` on the command line.

    Returns
    -------
    int
        0 done, 1 a notebook or the book failed, 2 bad input or usage, 130 stopped, 143 terminated.

    Examples
    --------
    >>> run(["no-such-command"])
    2
    """
    shown = _Shown(sys.stdout, kept="\n\t"), _Shown(sys.stderr, kept="\n\r\t")  # bars return to their start
    with redirect_stdout(shown[0]), redirect_stderr(shown[1]):
        return _run(arguments)


class _Shown:
    """A stream that escapes control characters, since names and messages may be external."""

    def __init__(self, stream: Any, kept: str) -> None:
        self._stream, self._kept = stream, kept

    def write(self, text: str) -> int:
        self._stream.write(printable(text, kept=self._kept))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _run(arguments: list[str]) -> int:
    try:
        return hicp(arguments, prog_name="hicp", standalone_mode=False) or 0
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        return 2
    except click.ClickException as error:
        context = getattr(error, "ctx", None)
        where = context.command_path if context else "hicp"
        return _fail(f"{' '.join(error.format_message().split())} See: {where} --help", 2)
    except (click.Abort, KeyboardInterrupt, SystemExit) as error:
        return _fail("stopped; run the same command again to continue", getattr(error, "code", 130))
    except InputError as error:
        return _fail(error, 2)
    except OSError as error:
        name = error.filename2 or error.filename  # of two, the one to be written
        what = one_line(error) if name is None else f"{name}: {error.strerror}"
        return _fail(f"{what}; check the path, the rights and the disk space", 2)
    except MemoryError:
        return _fail("the memory is not enough; process less at once, or use fewer --workers", 2)


def _fail(message: object, code: int) -> int:
    say(f"hicp: {message}"[:_MOST_SHOWN])
    return code


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__)
def hicp() -> None:
    """Human keypoint detection at close range: data, detectors, evaluation, report."""


for _command in (record, lift, calibration, models, draw, inspect_):
    hicp.add_command(_command)


@hicp.group()
def scenes() -> None:
    """Rendered people."""


@scenes.command("render")
@click.argument("out", type=PATH)
@click.option("--n", default=100, show_default=True, type=click.IntRange(min=1), help="Number of images.")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(min=0))
@people_option
@worker_options("Processes")
def scenes_render(out: Path, n: int, seed: int, people: str, workers: int | str | None) -> None:
    """Render people at 1-5 m into the folder OUT, with annotations in Halpe's layout."""
    from hicp_lib.simulation.world.scenes import render_dataset

    render_dataset(out, n=n, seed=seed, workers=workers, split=people.replace("-", " "))
    click.echo(f"{out}: {n} images")


@hicp.group()
def dataset() -> None:
    """HiCP data sets: Basic and Headless crops."""


@dataset.command("create")
@click.option("--annotations", type=PATH, required=True, help="Annotations in COCO's layout.")
@click.option("--images", type=PATH, required=True, help="Folder of the images.")
@_keypoint_map_option
@click.option("--out", type=PATH, required=True, help="Where basic/ and headless/ are written.")
@click.option("--min-pixels", default=20_000, show_default=True, type=click.IntRange(min=1))
@click.option("--orientation", type=click.Choice(["stored", "seen"]), help="Of images with a rotation flag.")
def dataset_create(out: Path, annotations: Path, images: Path, **options) -> None:
    """Crop people from annotated images: Basic, and Headless without their heads."""
    from hicp_lib.datasets.subsets import create_hicp, notes

    counts = create_hicp(annotations, images, out, progress=sys.stderr.isatty(), **options)
    tell_notes(annotations, counts.get("notes", {}))
    click.echo(json.dumps(counts, indent=2))
    for note in notes(counts):
        say(note)


@hicp.command()
@detector_options
@click.option("--dataset", "dataset_dir", type=PATH, help="Folder with images/ and annotations.json.")
@click.option("--images", "images_dir", type=PATH, help="Folder of images without annotations, or a video.")
@click.option("--out", type=PATH, required=True, help="To write: .json (COCO results), .csv or .parquet.")
@click.option("--by-image", is_flag=True, help="Print a line per image: people, scores (keypoints of each).")
@click.option("--strict", is_flag=True, help="Stop at an image that cannot be read.")
@worker_options("Threads")
def detect(
    detector: str, dataset_dir: Path | None, images_dir: Path | None, out: Path, by_image: bool, strict: bool,
    workers: int | str | None, **chosen,
) -> None:  # fmt: skip
    """Find people and their keypoints in images.

    Results are cached: after an interruption, the same command does only the rest. An image that cannot be
    read is reported and skipped; if none can be read, the exit code is 2.
    """
    from hicp_lib.detectors.registry import describe, make_detector
    from hicp_lib.detectors.runtime.to_file import detect_to_file, open_dataset, open_pictures
    from hicp_lib.formats.detection_files import refuse_other_suffix

    source = dataset_dir or images_dir
    if source is None or (dataset_dir and images_dir):
        raise click.UsageError("Give either --dataset DIR or --images DIR.", click.get_current_context())
    refuse_other_suffix(out)
    options = given(**chosen)
    pictures = open_pictures(source) if dataset_dir is None else open_dataset(source)
    made = make_detector(detector, **options)  # kept until the end: the runs share its open network
    lines = partial(say, err=False) if by_image else None
    options |= {"workers": workers, "strict": strict}
    n_people, n_images, n_broken = detect_to_file(detector, pictures, out, say, lines, **options)
    passed_over = f"; {n_broken} could not be read" * bool(n_broken)
    click.echo(f"{out}: {n_people} people in {n_images} images{passed_over}")
    if source.is_dir():
        images = shlex.quote(str(source if dataset_dir is None else source / "images"))
        page = shlex.quote(str(out.with_suffix(".html")))
        click.echo(f"look: hicp draw --detections {shlex.quote(str(out))} --images {images} --out {page}")
    tell_assumed(describe(made))


@hicp.command("import")
@click.option("--format", "kind", required=True, help="openpose, alphapose, mmpose, detectron2 or coco.")
@click.option("--predictions", type=PATH, required=True, help="The folder or file the tool wrote.")
@click.option("--annotations", type=PATH, required=True, help="Annotations of the images the tool saw.")
@_keypoint_map_option
@click.option("--out", type=PATH, required=True, help="COCO keypoint results to write.")
@click.option("--score-scale", type=FiniteRange(0, min_open=True), help="Divides scores; else the format's.")
@click.option("--json", "as_json", is_flag=True, help="Print the summary as JSON.")
def import_(
    kind: str, predictions: Path, annotations: Path, keypoint_map, out: Path, score_scale, as_json: bool
) -> None:
    """Read the predictions another tool wrote."""
    from hicp_lib.formats.annotations import read_annotations
    from hicp_lib.formats.detections import write_detections
    from hicp_lib.formats.importers.importing import import_predictions, summary_lines

    people = read_annotations(annotations, keypoint_map)
    imported = import_predictions(kind, predictions, people, score_scale)
    tell_notes(annotations, people.notes, "")
    write_detections(out, imported.detections, imported.extras)
    summary = imported.summary
    click.echo(json.dumps(summary, indent=2) if as_json else "\n".join(summary_lines(summary)))


@hicp.command("export")
@click.option("--detections", type=PATH, required=True, help="COCO keypoint results.")
@click.option("--format", "kind", required=True, help="coco (results) or fiftyone (a COCO data set).")
@click.option("--layout", default="halpe136", show_default=True, help="Or halpe26, coco17, wholebody133.")
@click.option("--annotations", type=PATH, help="Annotations of the images; fiftyone needs them.")
@click.option("--out", type=PATH, required=True)
def export(detections: Path, kind: str, layout: str, annotations: Path | None, out: Path) -> None:
    """Write detections for other tools."""
    from hicp_lib.formats.annotations import read_annotations
    from hicp_lib.formats.detections import read_detections
    from hicp_lib.formats.exporters import export_detections

    people = None if annotations is None else read_annotations(annotations)
    extras: dict[int, list[dict]] = {}
    n = export_detections(kind, read_detections(detections, people, extras), out, people, layout, extras)
    click.echo(f"{out}: {n} people")


@hicp.command()
@click.option("--annotations", type=PATH, required=True, help="Annotations in COCO's layout.")
@click.option("--detections", type=PATH, required=True, help="COCO keypoint results.")
@_keypoint_map_option
@click.option("--group", help="body (17 points) or hand (42, and each hand alone); both if not given.")
@click.option("--sigmas", help="halpe or wholebody; default: halpe, for each hand alone wholebody.")
@click.option("--area", default="segment", show_default=True, help="Or box, box53 (0.53 x box), source.")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(min=0), help="Of the bootstrap.")
@click.option("--by-image", is_flag=True, help="Also the OKS of each image's people; worst first.")
@click.option("--out", type=PATH, help="To write: .json, .csv or .parquet.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def evaluate(
    annotations: Path, detections: Path, keypoint_map, group: str | None, sigmas: str | None, area: str,
    seed: int, by_image: bool, out: Path | None, as_json: bool,
) -> None:  # fmt: skip
    """Average precision and recall by OKS, with 95 % bootstrap intervals over images.

    Over all labelled keypoints, and over the visible ones only; by extended OKS, if the annotations have
    keypoints outside the picture; for hands, both as one object and each alone.
    """
    from hicp_lib.core.keypoints import GROUPS
    from hicp_lib.evaluation.ap import judgement
    from hicp_lib.formats.annotations import read_annotations
    from hicp_lib.formats.detection_files import refuse_other_suffix
    from hicp_lib.formats.detections import detections_in_parts

    if out is not None:
        refuse_other_suffix(out)
    people = read_annotations(annotations, keypoint_map)
    doubts: dict[str, str] = {}
    parts = detections_in_parts(detections, people, doubts)
    found = list(islice(parts, 1))
    tell_notes(annotations, people.notes, area)
    options = {"area": area} | ({} if sigmas is None else {"sigmas": sigmas})
    groups = GROUPS if group is None else [group]
    judged = judgement.judge(people, chain(found, parts), groups, by_image, seed, **options)
    tell_notes(detections, doubts)
    if out is not None:
        judgement.write_judgement(out, judged)
    if as_json:
        click.echo(json.dumps(judged, indent=2))
        return
    if not found:
        click.echo(f"{detections}: an empty list: nobody was found in any image")
    rows = (judged, *judged["other_definitions"])
    for row in rows:
        _tell_evaluation(row)
    click.echo("".join(f"{lacking}\n" for lacking in dict.fromkeys(map(_lacking, rows)) if lacking), nl=False)
    if images := judged.get("by_image"):
        cells = [[f"{v:.3f}" if isinstance(v, float) else str(v) for v in image.values()] for image in images]
        click.echo(text_table([list(images[0]), *cells]))


def _lacking(row: dict[str, Any]) -> str:
    """Which of annotations and detections lack a group, in words; empty if neither does."""
    if row["AP"] is not None:
        return ""
    who = "the detections give" if row["n_people"] else "the annotations give"
    return f"{who} no {'hands' if 'hand' in row['group'] else 'bodies'}"


def _tell_evaluation(row: dict[str, Any]) -> None:
    from hicp_lib.evaluation.statistics.resampling import MIN_DRAWN

    if _lacking(row):
        return
    of = "all labelled" if row["labelled"] == "all" else "visible"
    of += " and outside" if row["outside"] == "count" else ""
    where = "{n_people} in {n_images} images; {sigmas} sigmas, {area} area".format(**row)
    click.echo(f"{row['group']}, {of} keypoints: {where}")
    if all(metric["low"] is None for metric in row["metrics"].values()):
        click.echo(f"no intervals: they ask for {MIN_DRAWN} source images at least")
    for name, metric in row["metrics"].items():
        value, *bounds = (math.nan if number is None else number for number in metric.values())
        interval = "" if metric["low"] is None else "  [{:.3f}, {:.3f}]".format(*bounds)
        click.echo(f"{name:<5} {value:.3f}{interval}")


@hicp.command()
@click.option("--profile", default="full", show_default=True, help="A profile of notebooks/profiles.toml.")
@click.option("-p", "--parameter", "pairs", nargs=2, multiple=True, metavar="NAME VALUE",
              help="A notebook parameter; may be repeated.")  # fmt: skip
@click.option("--only", metavar="NOTEBOOK", help="Run this notebook and those it needs; build no book.")
@click.option("--results", "root", type=PATH,
              help="Where results/ and _build/ are written; the working folder if not given.")  # fmt: skip
@click.option("--dask", metavar="ADDRESS", envvar="HICP_DASK",
              help="Scheduler of a Dask cluster, which renders, simulates and detects.")  # fmt: skip
def report(
    profile: str, pairs: tuple[tuple[str, str], ...], only: str | None, root: Path | None, dask: str | None
) -> int:
    """Run the notebooks and build the book; unchanged parts are not run again."""
    from hicp_lib.core.checkout import sources, working_folder
    from hicp_lib.report.build import make_report
    from hicp_lib.report.run import RunError

    if dask is not None:
        from hicp_lib.core.cluster import connected

        with connected(dask):  # fail before any notebook runs
            os.environ["HICP_DASK"] = dask  # where the notebooks' processes look
    try:
        make_report(profile, list(pairs), click.echo, sources(), root or working_folder(), only)
    except RunError as error:
        return _fail(error, 1)
    return 0


@hicp.command()
def doctor() -> int:
    """Check the installation: one line each, with the remedy."""
    from hicp_lib.cli.doctor import run_checks

    checks = run_checks()
    click.echo("\n".join(map(str, checks)))
    return 2 if any(check.is_ok is False for check in checks) else 0
