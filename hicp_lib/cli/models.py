"""`hicp models`: the detectors' weights, those of the study and the user's own."""

import click

from hicp_lib.cli.options import detector_options, given, tell_assumed, text_table
from hicp_lib.core.errors import InputError
from hicp_lib.core.folders import locked_folder


@click.group()
def models() -> None:
    """The detectors' weights."""


@models.command("list")
def models_list() -> None:
    """List the weight files, their licences, and whether they are present."""
    from hicp_lib.detectors.weights import default
    from hicp_lib.detectors.weights.published import published, status
    from hicp_lib.detectors.weights.user import all_user_options

    rows = [("name", "state", "MB", "licence", "for")]
    for weight in default.registry().values():
        used_by = ", ".join(weight.used_by)
        rows.append((weight.name, default.status(weight), _mb(weight.size_bytes), weight.licence, used_by))
    for model in published().values():
        size = model.path.stat().st_size if model.path.is_file() else model.size_bytes
        used_by = f"{model.use or 'not run here'}: {model.note}"
        rows.append((model.name, status(model), _mb(size), model.licence or "-", used_by))
    click.echo(text_table(rows))
    click.echo("- is unknown, a size until the file is present; published models are fetched by name only")
    for name, options in all_user_options().items():
        click.echo(f"yours: {name} with {', '.join(f'{key} {value}' for key, value in options.items())}")


def _mb(size_bytes: int | None) -> str:
    return "-" if size_bytes is None else f"{size_bytes / 1e6:.1f}"


@models.command("fetch")
@click.argument("names", nargs=-1, metavar="[NAME]...")
def models_fetch(names: tuple[str, ...]) -> None:
    """Fetch the missing weight files, and check each against its hash.

    NAME is a weight file, a detector, or a published model; without any, all weight files are fetched,
    and no published model. MediaPipe itself comes with its detectors' weights.
    """
    from hicp_lib.detectors.mediapipe.program import fetch_program, is_wanted
    from hicp_lib.detectors.weights.default import fetch, weights_dir
    from hicp_lib.detectors.weights.published import fetch_published, published

    by_name = [name for name in names if name in published()]
    others = [name for name in names if name not in by_name]
    with locked_folder(weights_dir()):
        if others or not names:
            for name in fetch(others or None):
                click.echo(f"fetched {name}")
            if is_wanted(others) and fetch_program():
                click.echo("fetched MediaPipe")
        fetched = [(name, fetch_published(name)) for name in by_name]
    for name, model in fetched:
        how = f"hicp detect --detector {model.use} {model.path} ..." if model.use else model.note
        click.echo(f"fetched {name}: {model.path} ({how})")


@models.command("show")
@detector_options
def models_show(detector: str, **chosen) -> None:
    """Print everything that is assumed about a detector and its model file."""
    from hicp_lib.detectors.registry import describe, make_detector

    rows = describe(make_detector(detector, **given(**chosen)))
    click.echo(text_table([("what", "value", "why"), *rows]))


@models.command("use")
@detector_options
def models_use(detector: str, **chosen) -> None:
    """Register a detector's model file once; notebooks and commands then use it by the detector's name."""
    from hicp_lib.detectors.registry import COMBINED, DETECTORS, describe, make_detector
    from hicp_lib.detectors.weights.user import keep_user_options

    options = given(**chosen)
    if detector in DETECTORS and not DETECTORS[detector].needs_model:
        raise InputError(
            f"detector {detector!r} has weights of its own; it takes none of yours for good, and where it "
            "has an option model, at each call"
        )
    if detector.startswith(COMBINED):
        raise InputError(f"detector {detector!r} is made of two; name the weights of each by itself")
    made = make_detector(detector, **options)
    if "model" not in options:
        raise InputError(f"detector {detector!r}: no model is named; give it with --model FILE.onnx")
    keep_user_options(detector, options)
    command = f"hicp report -p detectors {detector}"
    click.echo(f"{detector}: {options['model']}; run it in the report with: {command}")
    tell_assumed(describe(made))
