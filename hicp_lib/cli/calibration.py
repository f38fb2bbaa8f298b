"""`hicp calibration`: keypoint scores that are comparable between detectors."""

from pathlib import Path

import click

from hicp_lib.cli.options import PATH, tell_notes


@click.group()
def calibration() -> None:
    """Convert keypoint scores to expected hit rates."""


@calibration.command("fit")
@click.option("--annotations", type=PATH, required=True, help="Annotations in Halpe's layout.")
@click.option("--detections", type=PATH, required=True, help="COCO keypoint results on these images.")
@click.option("--detector", default="detector", show_default=True, help="Name kept in the file.")
@click.option("--out", type=PATH, required=True, help="CSV file to write.")
def calibration_fit(annotations: Path, detections: Path, detector: str, out: Path) -> None:
    """Fit hit rates to scores, on images not used for evaluation later."""
    from hicp_lib.evaluation.calibration.files import fit_calibrations, write_calibrations
    from hicp_lib.formats.annotations import read_annotations
    from hicp_lib.formats.detections import read_detections

    people = read_annotations(annotations)
    table, counts = fit_calibrations(people, read_detections(detections, people), detector)
    tell_notes(annotations, people.notes)
    write_calibrations(out, table)
    none = "not fitted: the annotations label none"
    told = (f"{group} {f'fitted to {n} keypoints' if n else none}" for group, n in counts.items())
    click.echo(f"{out}: {', '.join(told)}")


@calibration.command("apply")
@click.option("--calibrations", type=PATH, required=True, help="From `calibration fit` or the report.")
@click.option("--detector", help="Detector; needed if the file has several.")
@click.option("--detections", type=PATH, required=True, help="COCO keypoint results.")
@click.option("--out", type=PATH, required=True, help="Results to write; keeps the original scores too.")
def calibration_apply(calibrations: Path, detector: str | None, detections: Path, out: Path) -> None:
    """Write results with calibrated keypoint scores; the original scores are kept too."""
    from hicp_lib.evaluation.calibration.files import apply_calibrations, read_calibrations

    n = apply_calibrations(detections, read_calibrations(calibrations, detector), out)
    click.echo(f"{out}: {n} people")
