"""Where the study's people come from: rendered scenes, or COCO images with Halpe annotations."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from hicp_lib.datafiles import DATA_DIR
from hicp_lib.errors import InputError
from hicp_lib.files import cache_dir, read_json, sha256_file
from hicp_lib.hicp_dataset import create_hicp
from hicp_lib.provenance import LIBRARY_DIR, digest, files_sha256, input_sha256

# What annotations and crops are written by: a change there makes scenes and crops anew.
_WRITING_MODULES = (
    "annotations.py",
    "coco_rows.py",
    "files.py",
    "hicp_crops.py",
    "hicp_dataset.py",
    "images.py",
    "keypoints.py",
)
SOURCES = ("rendered", "halpe")


@dataclass(frozen=True)
class Source:
    """Whole images, and the HiCP subsets made of them.

    Attributes
    ----------
    kind : "rendered" or "halpe"
    note : what the people are, in the words of captions
    annotations, images : the whole images' annotation file and folder
    basic, headless : dataset folders (`images/` and `annotations.json`)
    summary : what `create_hicp` kept and left out, and why
    """

    kind: str
    note: str
    annotations: Path
    images: Path
    basic: Path
    headless: Path
    summary: dict

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
    """Open the study's people; what is missing in the cache is rendered and cropped first.

    Parameters
    ----------
    source : "rendered" (uses `n_scenes`, `seed`) or "halpe" (uses `annotations_path`, `images_dir`)
    min_pixels : the smallest crop that is kept

    Raises
    ------
    InputError
        For an unknown source, or Halpe annotations or images that are not there.
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
    folder = _crops(annotations, images, min_pixels)
    summary = read_json(folder / "summary.json")
    return Source(source, note, annotations, images, folder / "basic", folder / "headless", summary)


def _rendered(n_scenes: int, seed: int) -> tuple[Path, Path]:
    renderer = files_sha256((LIBRARY_DIR / "simulation").glob("*.py"), LIBRARY_DIR)
    body = files_sha256(DATA_DIR.glob("body*"), DATA_DIR)
    key = digest([n_scenes, seed, renderer, body, _writing_rules()])
    folder = cache_dir() / "scenes" / key[:16]
    if not (folder / "annotations.json").is_file():
        from hicp_lib.simulation.scenes import render_dataset  # Open3D takes a second to load

        render_dataset(folder, n=n_scenes, seed=seed, progress=sys.stderr.isatty())
    return folder / "annotations.json", folder / "images"


def _writing_rules() -> str:
    return files_sha256((LIBRARY_DIR / name for name in _WRITING_MODULES), LIBRARY_DIR)


def _crops(annotations: Path, images: Path, min_pixels: int) -> Path:
    if not annotations.is_file():
        raise InputError(f"{annotations}: is not there; give the path of the annotation file")
    if not images.is_dir():
        raise InputError(f"{images}: is not there; give the folder that holds the annotated images")
    made_of = [sha256_file(annotations), str(images.resolve()), input_sha256(images), min_pixels]
    key = digest([*made_of, _writing_rules()])
    folder = cache_dir() / "hicp" / key[:16]
    if not (folder / "summary.json").is_file():
        create_hicp(annotations, images, folder, min_pixels=min_pixels, progress=sys.stderr.isatty())
    return folder
