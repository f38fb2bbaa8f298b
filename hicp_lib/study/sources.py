"""Sources of people: rendered scenes, or COCO images with Halpe annotations."""

import sys
from dataclasses import dataclass
from pathlib import Path

from hicp_lib.core.cache import key
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import cache_dir, read_json, sha256_file
from hicp_lib.core.keypoints import COCO_17, HANDS
from hicp_lib.datasets.subsets import create_hicp, notes
from hicp_lib.evaluation.statistics.resampling import MIN_DRAWN
from hicp_lib.formats.annotations import read_annotations, source_images

SOURCES = ("rendered", "halpe")


@dataclass(frozen=True)
class Source:
    """Whole images, and the HiCP subsets made of them.

    Attributes
    ----------
    kind : str
        "rendered", "halpe" or "near".
    note : str
        Description of the people, for captions.
    annotations, images : Path
        The whole images' annotation file and folder.
    basic, headless : Path
        Dataset folders (`images/` and `annotations.json`).
    summary : dict
        What `create_hicp` kept and dropped, and why.
    """

    kind: str
    note: str
    annotations: Path
    images: Path
    basic: Path
    headless: Path
    summary: dict

    @property
    def limits(self) -> list[str]:
        """Limits of these data, a sentence each."""
        basic = read_annotations(self.basic / "annotations.json")
        n_images = len(set(source_images(basic).values()))
        some = (basic.visibility[~basic.is_crowd] > 0).any(axis=0)
        said = {
            "Nobody is in Headless: what is about it is empty.": not self.summary["headless"]["kept"],
            "Nobody has a labelled hand: what is about hands is empty or a dash.": not some[HANDS].any(),
            "Nobody has a labelled body: what is about bodies is empty or a dash.": not some[COCO_17].any(),
            f"Intervals need {MIN_DRAWN} images, calibrations 2, here are {n_images}.": n_images < MIN_DRAWN,
        }
        return notes(self.summary) + [sentence for sentence, holds in said.items() if holds]

    @property
    def subsets(self) -> dict[str, Path]:
        """The dataset folders by name."""
        return {"basic": self.basic, "headless": self.headless}


def open_source(
    source: str = "rendered",
    annotations_path: str | Path = "",
    images_dir: str | Path = "",
    n_scenes: int = 160,
    seed: int = 0,
    min_pixels: int = 20_000,
) -> Source:
    """Open a source of people; if not cached, scenes are rendered and cropped first.

    Parameters
    ----------
    source : str
        "rendered" (uses `n_scenes`, `seed`) or "halpe" (uses `annotations_path`, `images_dir`).
    annotations_path, images_dir : str or Path
        Halpe's annotation file, and the folder of COCO's images.
    n_scenes, seed : int
        Of the rendered scenes.
    min_pixels : int
        The smallest crop that is kept.

    Returns
    -------
    Source

    Raises
    ------
    InputError
        For an unknown source, or Halpe annotations or images that are not there.

    Examples
    --------
    >>> open_source("photographs")
    Traceback (most recent call last):
        ...
    hicp_lib.core.errors.InputError: source='photographs' is unknown; use one of rendered, halpe
    """
    if source == "rendered":
        annotations, images = _rendered(n_scenes, seed)
        note = f"rendered people ({n_scenes} scenes)"
    elif source == "halpe":
        if not (annotations_path and images_dir):
            raise InputError(
                "source=halpe needs annotations_path=HALPE.json and images_dir=DIR of the COCO images"
            )
        annotations, images = Path(annotations_path), Path(images_dir)
        note = f"COCO images with Halpe annotations ({annotations.name})"
    else:
        raise InputError(f"source={source!r} is unknown; use one of {', '.join(SOURCES)}")
    return _source(source, note, annotations, images, min_pixels)


def open_near(data: Source, n_scenes: int, seed: int, min_pixels: int) -> Source | None:
    """Rendered people as a robot's camera sees them from near; their crops are cut as Basic's.

    Parameters
    ----------
    data : Source
        From `open_source`.
    n_scenes : int
        From how many of its scenes, from the first.
    seed, min_pixels : int
        As of `open_source`.

    Returns
    -------
    Source or None
        None for photographs: they cannot be taken from elsewhere.
    """
    if data.kind != "rendered":
        return None
    return _source("near", "rendered people from near", *_rendered(n_scenes, seed, near=True), min_pixels)


def _source(kind: str, note: str, annotations: Path, images: Path, min_pixels: int) -> Source:
    folder = _crops(annotations, images, min_pixels)
    summary = read_json(folder / "summary.json")
    if not summary["basic"]["kept"]:
        raise InputError(f"{annotations}: nobody becomes a crop {summary['basic']}; is min_pixels too large?")
    return Source(kind, note, annotations, images, folder / "basic", folder / "headless", summary)


def _rendered(n_scenes: int, seed: int, near: bool = False) -> tuple[Path, Path]:
    made_by = ["hicp_lib.simulation.world.scenes", *(["hicp_lib.experiments.near"] if near else [])]
    folder = cache_dir() / "scenes" / key(made_by, n=n_scenes, seed=seed)[:16]
    if not (folder / "annotations.json").is_file():
        from hicp_lib.experiments.near import near_stage  # Open3D takes a second to load
        from hicp_lib.simulation.world.scenes import render_dataset
        from hicp_lib.simulation.world.staging import random_stage

        shown, staged = sys.stderr.isatty(), near_stage if near else random_stage
        render_dataset(folder, n=n_scenes, seed=seed, progress=shown, staged=staged)
    return folder / "annotations.json", folder / "images"


def _crops(annotations: Path, images: Path, min_pixels: int) -> Path:
    if not annotations.is_file():
        raise InputError(f"{annotations}: is not there; give the path of the annotation file")
    if not images.is_dir():
        raise InputError(f"{images}: is not there; give the folder that holds the annotated images")
    sha256, resolved = sha256_file(annotations), str(images.resolve())
    crops = key([create_hicp], annotations=sha256, folder=resolved, images=images, min_pixels=min_pixels)
    folder = cache_dir() / "hicp" / crops[:16]
    if not (folder / "summary.json").is_file():
        create_hicp(annotations, images, folder, min_pixels=min_pixels, progress=sys.stderr.isatty())
    return folder
