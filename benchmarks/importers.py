"""What importing other tools' predictions costs beside parsing their JSON alone.

Two people an image, with all the keypoints the tool can write, random coordinates in full length. The
baseline reads the same files with `json.loads` and does nothing with them. Writing what was imported, with
the tool's own scores beside it, is compared with `json.dumps` of the file's content. All is done by one
thread and timed as processor time, which other work on the machine hardly lengthens.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from timing import Comparison, best_seconds, run

from hicp_lib.formats.annotations import Annotations, ImageInfo
from hicp_lib.formats.detections import write_detections
from hicp_lib.formats.importers.importing import import_predictions

sys.path.insert(0, str(Path(__file__).parents[1] / "tools"))

from native_files import (  # noqa: E402
    Person,
    write_alphapose,
    write_coco,
    write_detectron2,
    write_mmpose,
    write_openpose,
)


def make_people(n: int) -> tuple[Annotations, dict[str, list[Person]]]:
    """`n` people, two in each image."""
    rng = np.random.default_rng(0)
    images = {i: ImageInfo(i, f"{i:012d}.jpg", 640, 480) for i in range(1, n // 2 + 1)}
    none = np.zeros(0, dtype=int)
    annotations = Annotations(
        images, none, none, np.zeros((0, 4)), np.zeros(0), none.astype(bool), np.zeros((0, 136, 2)),
        np.zeros((0, 136)), [],
    )  # fmt: skip
    found = {
        image.file_name: [
            Person(rng.uniform(0, 470, (136, 2)), rng.uniform(0.05, 1, 136), rng.random()) for _ in "ab"
        ]
        for image in images.values()
    }
    return annotations, found


def parse(path: Path) -> None:
    """The baseline."""
    for file in sorted(path.iterdir()) if path.is_dir() else [path]:
        json.loads(file.read_bytes())


def measure(options) -> Iterator[Comparison]:
    annotations, found = make_people(options.people)
    ids = {image.file_name: image.id for image in annotations.images.values()}
    writers: dict[str, Callable[[Path], None]] = {
        "openpose": lambda path: write_openpose(path, found),
        "alphapose": lambda path: write_alphapose(path, found),
        "mmpose": lambda path: write_mmpose(path, found),
        "detectron2": lambda path: write_detectron2(path, found, ids),
        "coco": lambda path: write_coco(path, found, ids),
    }
    for format, write in writers.items():
        with tempfile.TemporaryDirectory() as folder:
            path, out = Path(folder) / "native", Path(folder) / "detections.json"
            write(path)
            yield from compare(format, path, out, annotations)


def compare(format: str, path: Path, out: Path, annotations: Annotations) -> Iterator[Comparison]:
    """Import from `path`, write to `out`."""
    ours_s, base_s = best_seconds(lambda: import_predictions(format, path, annotations), lambda: parse(path))
    yield Comparison(f"import from {format}", ours_s, "`json.loads` of the same files", base_s)
    imported = import_predictions(format, path, annotations)
    (ours_s,) = best_seconds(lambda: write_detections(out, imported.detections, imported.extras))
    content = json.loads(out.read_bytes())
    (base_s,) = best_seconds(lambda: json.dumps(content))
    yield Comparison(f"write what {format} found", ours_s, "`json.dumps` of its content", base_s)


if __name__ == "__main__":
    run(measure, __doc__, people=(10_000, 4))
