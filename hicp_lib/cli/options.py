"""Shared options of the `hicp` command's parts."""

import errno
import math
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import Any

import click

from hicp_lib.core.errors import InputError, printable
from hicp_lib.core.files import json_or_text

_READ_OF_FOLDERS = ("annotations.json", "truth.parquet", "joints.parquet", "clicks.csv")


class _Path(click.Path):
    """A path; refuses an empty one, and an input that is also the output, `out`."""

    def convert(self, value: Any, param: Any, ctx: Any) -> Path:
        if value == "":  # as of a variable that is not set; it would be the working folder
            self.fail("it is empty; give a path.", param, ctx)
        path = Path(str(super().convert(value, param, ctx)))
        try:
            path.stat()
        except (OSError, ValueError) as error:  # most are told by who opens it, or are names to be written
            if getattr(error, "errno", None) == errno.ELOOP:
                raise InputError(f"{path}: leads to itself, as a link or through one; give another") from None
        paths = {name: of for name, of in (ctx.params | {param.name: path}).items() if isinstance(of, Path)}
        out, given = paths.pop("out", None), [*paths.values()]
        read = given + [of / name for of in given for name in _READ_OF_FOLDERS]
        if out and out.exists() and any(of.exists() and of.samefile(out) for of in read):
            raise InputError(f"{out}: is read by this command; give another name to write to")
        return path


PATH = _Path()


class FiniteRange(click.FloatRange):
    """Numbers in a range; click accepts NaN, and infinity without a bound."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """As click's, for finite numbers only.

        Parameters
        ----------
        value : Any
        param : click.Parameter, optional
        ctx : click.Context, optional

        Returns
        -------
        float
        """
        number = super().convert(value, param, ctx)
        return number if math.isfinite(number) else self.fail(f"{value} is no finite number.", param, ctx)


people_option = click.option(
    "--people", default="held-out", show_default=True, type=click.Choice(["development", "held-out"]),
    help="Split of the identities; tune methods on development only.",
)  # fmt: skip


def worker_options(kind: str) -> Callable[[Callable], Callable]:
    """The options for parallel work; they arrive as `workers`, a number, an address or None.

    Parameters
    ----------
    kind : str
        Kind of workers on this machine, for the help.
    """

    def decorate(command: Callable) -> Callable:
        @click.option("--workers", type=click.IntRange(1, 1024), help=f"{kind}; all cores if not given.")
        @click.option("--dask", metavar="ADDRESS", help="Scheduler of a Dask cluster, which does the work.")
        @wraps(command)
        def chosen(*arguments: Any, workers: int | None, dask: str | None, **named: Any) -> Any:
            if workers is not None and dask is not None:
                raise click.UsageError(
                    "Give either --workers N or --dask ADDRESS.", click.get_current_context()
                )
            return command(*arguments, workers=workers if dask is None else dask, **named)

        return chosen

    return decorate


def detector_options(command: Callable) -> Callable:
    """The options of the detector and its weights; they arrive as `**chosen`."""
    for option in (
        click.option("-o", "--option", "pairs", nargs=2, multiple=True, metavar="NAME VALUE",
                     help="A further option of the detector; may be repeated."),
        click.option("--boxes", help="Where people's boxes come from: gt, image or detected."),
        click.option("--person-model", type=PATH, help="ONNX file that finds the boxes (YOLOX, RTMDet)."),
        click.option("--model", type=PATH, help="The detector's weights, for those that run on yours."),
        click.option("--detector", required=True, help="Name of the detector; an unknown one lists all."),
    ):  # fmt: skip
        command = option(command)
    return command


def text_table(rows: Sequence[Sequence[str]]) -> str:
    """Rows as lines of text, columns one below the other.

    Examples
    --------
    >>> print(text_table([("name", "MB"), ("a", "1.5")]))
    name  MB
    a     1.5
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    padded = ([f"{cell:<{n}}" for cell, n in zip(row, widths, strict=True)] for row in rows)
    return "\n".join("  ".join(cells).rstrip() for cells in padded)


def tell_notes(path: Path, notes: Mapping[str, str], area: str = "segment") -> None:
    """Print a file's notes; those on areas only if these are used.

    Parameters
    ----------
    path : Path
    notes : mapping of str to str
        By topic.
    area : str, optional
        What is taken for areas.
    """
    for about, note in notes.items():
        if about != "area" or area == "segment":
            say(f"{path}: {note}")


def say(message: object, err: bool = True) -> None:
    """Print one line, with special characters escaped; on the error stream unless `err` is false."""
    click.echo(printable(str(message)), err=err)


def tell_assumed(facts: list[tuple[str, str, str]]) -> None:
    """Print on the error stream what is assumed about a detector's model.

    Parameters
    ----------
    facts : list of (str, str, str)
        As from `hicp_lib.detectors.registry.describe`.
    """
    for what, value, why in facts:
        if why.startswith("ASSUMED"):
            say(f"{what}: {value} ({why})")


def given(model: Path | None, person_model: Path | None, boxes: str | None, pairs) -> dict[str, Any]:
    """The detector's options from the command line.

    Parameters
    ----------
    model, person_model : Path or None
    boxes : str or None
    pairs : sequence of (str, str)
        Further options, values as text: JSON's numbers, booleans and lists are read as such.

    Examples
    --------
    >>> given(None, None, "gt", [("min_score", "0.5"), ("sides", "left")])
    {'boxes': 'gt', 'min_score': 0.5, 'sides': 'left'}
    """
    named = {"model": model, "person_model": person_model, "boxes": boxes}
    options = {name: value for name, value in named.items() if value is not None}
    for name, text in pairs:
        if name in options:
            raise InputError(f"option {name!r} of the detector is given twice; give it once")
        options[name] = json_or_text(text)
    return options
