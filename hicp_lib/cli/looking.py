"""`hicp inspect` and `hicp draw`: identify files, and draw detections."""

import json
from dataclasses import asdict
from pathlib import Path

import click

from hicp_lib.cli.options import PATH, FiniteRange, say
from hicp_lib.core.errors import InputError
from hicp_lib.core.folders import filled_folder


@click.command("inspect")
@click.argument("path", type=PATH, metavar="FILE_OR_FOLDER")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def inspect_(path: Path, as_json: bool) -> int:
    """Say what a file or a folder is: tool, layout, units, scores, times, counts, and what it needs.

    Exit code 2 if it cannot be used.
    """
    from hicp_lib.inspection.inspect import inspect

    facts = inspect(path)
    click.echo(json.dumps(asdict(facts), indent=2) if as_json else "\n".join(facts.lines()))
    return 2 if facts.problem else 0


@click.command()
@click.option("--detections", type=PATH, required=True, help="What `hicp detect` or `hicp import` wrote.")
@click.option("--images", type=PATH, required=True, help="Folder of the images.")
@click.option("--annotations", type=PATH, help="Annotations: drawn too, and used to sort.")
@click.option("--out", type=PATH, required=True, help="An .html page, or a new folder for PNG files.")
@click.option("--limit", default=100, show_default=True, type=click.IntRange(min=1),
              help="Maximum number of images, worst first.")  # fmt: skip
@click.option("--min-score", default=0.1, show_default=True, type=FiniteRange(0, 1),
              help="In PNG files, keypoints below it are left out; a page has a slider.")  # fmt: skip
def draw(
    detections: Path, images: Path, annotations: Path | None, out: Path, limit: int, min_score: float
) -> None:
    """Draw detections over their images, worst first: an HTML page, or PNG files."""
    from hicp_lib.formats.annotations import read_annotations
    from hicp_lib.formats.detections import read_detections
    from hicp_lib.inspection.gallery import image_paths, pictures, write_page, write_pngs

    if out.suffix not in ("", ".html"):
        raise InputError(f"{out}: expected a name that ends in .html, or a folder for PNG files")
    people = None if annotations is None else read_annotations(annotations)
    found = read_detections(detections, people)
    chosen = pictures(image_paths(detections, images, found, people), found, people)
    first = chosen[:limit]
    if out.suffix:
        write_page(first, out, f"{detections.name} over {images.name}", say)
    else:
        with filled_folder(out) as inner:
            write_pngs(first, inner, min_score, say)
    rest = f" of {len(chosen)}, worst first; --limit N for more" if len(chosen) > limit else ""
    click.echo(f"{out}: {len(first)} pictures{rest}")
