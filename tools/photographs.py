"""Run the default detectors on photographs of public data sets, and keep the figures.

    python tools/photographs.py CHECKOUT

CHECKOUT is one of github.com/open-mmlab/mmpose: its folder `tests/data` holds a few photographs each of many
data sets, with annotations in their own layouts. The photographs' licences differ, so none is kept: only
figures, and the SHA-256 of each photograph. Nothing of the study was ever tuned on them. Writes
`data/reference/photographs/`:

- `metrics.parquet`: AP of bodies, by subset and detector, with intervals over photographs;
- `draws.parquet`: that AP on each draw of photographs, the same for all detectors;
- `head_loss.parquet`: its change without the head, on the people who are in both subsets;
- `people.parquet`: size and labels of everybody who is looked at;
- `images.parquet`: SHA-256, data set, people of every photograph;
- `provenance.json`: version, commit, settings.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import sha256_file, write_json
from hicp_lib.core.keypoints import COCO_17
from hicp_lib.datasets.subsets import SUBSETS, create_hicp
from hicp_lib.detectors.registry import DETECTORS, default_detector_names
from hicp_lib.detectors.runtime.results import detections_of
from hicp_lib.detectors.runtime.run import time_dataset
from hicp_lib.evaluation.ap import metric_table
from hicp_lib.formats.annotations import Annotations, ImageInfo, read_annotations, write_annotations
from hicp_lib.study.photographs import FOLDER, people_table
from hicp_lib.study.provenance import git_state

# Annotations of photographs of people, and the folder of their images. Of photographs that two data sets
# share the first counts: it labels more.
SOURCES = {
    "Halpe": ("halpe/test_halpe.json", "coco"),
    "COCO": ("coco/test_coco.json", "coco"),
    "OCHuman": ("ochuman/test_ochuman.json", "ochuman"),
    "CrowdPose": ("crowdpose/test_crowdpose.json", "crowdpose"),
    "AI Challenger": ("aic/test_aic.json", "aic"),
    "MPII": ("mpii/test_mpii.json", "mpii"),
    "PoseTrack18": ("posetrack18/annotations/test_posetrack18_val.json", "posetrack18"),
    "MHP": ("mhp/test_mhp.json", "mhp"),
    "ExLPose": ("exlpose/test_exlpose.json", "exlpose"),
    "JHMDB": ("jhmdb/test_jhmdb_sub1.json", "jhmdb"),
    "Human3.6M": ("h36m/h36m_coco.json", "h36m"),
    "Human-Art": ("humanart/test_humanart.json", "humanart"),
}
DRAWN = {"2D_virtual_human", "3D_virtual_human"}  # folders of Human-Art that hold no photographs
MIN_PIXELS = 4000  # of a crop: a fifth of the study's, as people are smaller here
MIN_LABELLED = 4  # points of COCO's 17, of a person who is looked at


def join(data: Path, images_dir: Path) -> tuple[Annotations, pd.DataFrame]:
    """People of all sources, photographs copied to `images_dir` under their hashes."""
    parts, images, rows = [], {}, []
    for name, (file, folder) in SOURCES.items():
        try:
            people = read_annotations(data / file)
        except InputError as error:
            print(f"left out: {error}")
            continue
        n_labelled = (people.visibility[:, COCO_17] > 0).sum(axis=1)
        for image in people.images.values():
            path = find(data / folder, image.file_name)
            digest = sha256_file(path) if path is not None else ""
            number = int(digest[:12] or "0", 16)
            of_image = people.take((people.image_ids == image.id) & (n_labelled >= MIN_LABELLED))
            if not digest or number in images or not len(of_image):
                continue
            file_name = digest[:16] + path.suffix
            shutil.copy(path, images_dir / file_name)
            images[number] = ImageInfo(number, file_name, image.width_px, image.height_px)
            parts.append(
                replace(of_image, image_ids=np.full(len(of_image), number), extras=[{}] * len(of_image))
            )
            rows.append((digest, name, len(of_image)))
    known = pd.DataFrame(rows, columns=["sha256", "data_set", "n_people"])
    return Annotations.concatenate(parts, images).numbered(), known


def find(folder: Path, name: str) -> Path | None:
    """A photograph: where the annotations say, or the only one of that name; None if it is no photograph."""
    if DRAWN & set(Path(name).parts):
        return None
    if (folder / name).is_file():
        return folder / name
    same = list(folder.rglob(Path(name).name))
    return same[0] if len(same) == 1 else None


def make_subsets(checkout: Path, folder: Path) -> tuple[dict[str, Path], pd.DataFrame]:
    """Cut the people out: the subsets' folders, and a table of the photographs."""
    data = checkout / "tests" / "data"
    if not data.is_dir():
        sys.exit(f"{data}: is not a folder; give a checkout of github.com/open-mmlab/mmpose")
    joined = folder / "joined"
    (joined / "images").mkdir(parents=True)
    people, images = join(data, joined / "images")
    write_annotations(joined / "annotations.json", people)
    create_hicp(joined / "annotations.json", joined / "images", folder / "hicp", MIN_PIXELS)
    return {subset: folder / "hicp" / subset for subset in SUBSETS}, images


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("checkout", type=Path, help="of github.com/open-mmlab/mmpose")
    checkout = parser.parse_args().checkout
    with tempfile.TemporaryDirectory() as folder:
        folders, images = make_subsets(checkout, Path(folder))
        truth = {subset: read_annotations(of / "annotations.json") for subset, of in folders.items()}
        names = [name for name in default_detector_names() if "body" in DETECTORS[name].groups]
        runs = {(s, d): time_dataset(d, of) for s, of in folders.items() for d in names}
    found = {case: detections_of(run) for case, run in runs.items()}
    drawn = metric_table.draw_cases(truth, found, groups=["body"])
    FOLDER.mkdir(parents=True, exist_ok=True)
    metrics = metric_table.metric_table(drawn)
    metrics[metrics["metric"].isin(["AP", "AR"])].to_parquet(FOLDER / "metrics.parquet", index=False)
    draws = {f"{subset} {detector}": samples["AP"] for (subset, detector, _), (_, samples) in drawn.items()}
    pd.DataFrame(draws).round(4).astype(np.float32).to_parquet(FOLDER / "draws.parquet", index=False)
    people_table(truth).to_parquet(FOLDER / "people.parquet", index=False)
    same = metric_table.same_people(truth, found)
    loss = metric_table.head_loss(metric_table.draw_cases(*same, groups=["body"]))
    loss.to_parquet(FOLDER / "head_loss.parquet", index=False)
    images.to_parquet(FOLDER / "images.parquet", index=False)
    settings = {"min_pixels": MIN_PIXELS, "min_labelled": MIN_LABELLED, "detectors": names}
    write_json(FOLDER / "provenance.json", {"settings": settings, "git": git_state()}, indent=1)
    print(metrics[metrics["metric"] == "AP"].round(3).to_string(index=False))


if __name__ == "__main__":
    main()
