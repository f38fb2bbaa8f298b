"""Render development people and draw the squares to train on.

    python tools/closerange/make_samples.py FOLDER [--n-scenes 2000] [--n-near 1000] [--rounds 4]
                                            [--dask ADDRESS]

writes FOLDER/scenes and FOLDER/near (pictures with annotations), and FOLDER/people and FOLDER/hands (a file
of squares for every picture and round). What was finished before is kept, unless pictures or code changed.
`--dask` renders on an existing cluster. Identities are development ones; the seeds differ from every seed
that another part of the project uses for tuning or for evaluation.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from closerange.frozen import SETS, SIDE_PX  # noqa: E402
from closerange.samples import draw_sample  # noqa: E402
from hicp_lib.core.executor import run_jobs  # noqa: E402
from hicp_lib.core.files import atomic_path, read_json, sha256_file, write_json  # noqa: E402
from hicp_lib.core.images import read_image  # noqa: E402
from hicp_lib.experiments.near import near_stage  # noqa: E402
from hicp_lib.formats.annotations import Annotations, read_annotations  # noqa: E402
from hicp_lib.simulation.world.scenes import render_dataset  # noqa: E402
from hicp_lib.simulation.world.staging import random_stage  # noqa: E402

SEEDS = {"scenes": 900_001, "near": 900_002}
STAGES = {"scenes": random_stage, "near": near_stage}
DEVELOPMENT = "development"
_TRIES = 4
_PER_PERSON = 2
_N_FILLERS = 8


def draw_image(
    images: Path, people: Annotations, image_id: int, fillers: list[str], seed: int, round_: int, out: Path
) -> None:
    """Write the squares of one picture's people, or of their hands, as `out`."""
    of_hand = out.parent.name == "hands"
    name = people.images[image_id].file_name
    image = read_image(images / name)
    patches = [partial(read_image, images / filler) for filler in fillers]
    rng = np.random.default_rng([seed, image_id, round_, of_hand])
    found = []
    for row in np.flatnonzero((people.image_ids == image_id) & ~people.is_crowd):
        for _ in range(_PER_PERSON):
            points, visibility = people.keypoints_px[row], people.visibility[row]
            drawn = (draw_sample(rng, image, points, visibility, patches, of_hand) for _ in range(_TRIES))
            sample = next((s for s in drawn if s is not None), None)
            if sample is not None:
                found.append((sample, people.extras[row]["identity"]["body"]))
    with atomic_path(out) as path, path.open("wb") as file:
        np.savez(
            file,
            squares=np.array([s.square for s, _ in found], np.uint8).reshape(-1, SIDE_PX, SIDE_PX, 3),
            keypoints_px=np.array([s.keypoints_px for s, _ in found], np.float32).reshape(-1, 136, 2),
            seen=np.array([s.seen for s, _ in found], np.uint8).reshape(-1, 136),
            body=np.array([body for _, body in found], "U40"),
            picture=np.full(len(found), out.stem.rpartition("_")[0], "U40"),
            view=np.array([s.view for s, _ in found], "U20"),
        )


def jobs(folder: Path, of: str, kind: str, rounds: int) -> Iterator[tuple[str, partial]]:
    """What is not there yet, of "people" or "hands"."""
    people = read_annotations(folder / kind / "annotations.json")
    names = sorted(image.file_name for image in people.images.values())
    for image_id in people.images:
        for round_ in range(rounds):
            out = folder / of / f"{kind}_{image_id:06d}_{round_}.npz"
            if not out.exists():
                chosen = np.random.default_rng([SEEDS[kind], image_id, round_, 1]).choice(names, _N_FILLERS)
                its = people.of_images({image_id})
                of_image = (folder / kind / "images", its, image_id, chosen.tolist(), SEEDS[kind], round_)
                yield out.name, partial(draw_image, *of_image, out)


def drop_others(squares: Path, kind: str, made_of: list) -> None:
    """Delete squares that were drawn from other pictures, or by other code."""
    stamp = [*made_of, sha256_file(Path(__file__)), sha256_file(Path(__file__).with_name("samples.py"))]
    file = squares / f"{kind}.json"
    if not file.is_file() or read_json(file) != stamp:
        for path in squares.glob(f"{kind}_*.npz"):
            path.unlink()
        write_json(file, stamp)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--n-scenes", type=int, default=2000)
    parser.add_argument("--n-near", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--dask")
    arguments = parser.parse_args()
    folder, numbers = arguments.folder, {"scenes": arguments.n_scenes, "near": arguments.n_near}
    cv2.setNumThreads(1)
    for kind, n in numbers.items():
        place = folder / kind
        render_dataset(place, n, SEEDS[kind], arguments.dask, split=DEVELOPMENT, staged=STAGES[kind])
        print(kind, sha256_file(place / "annotations.json"))
        for of in SETS:
            (folder / of).mkdir(exist_ok=True)
            drop_others(folder / of, kind, [sha256_file(place / "annotations.json"), arguments.rounds])
            for _ in run_jobs(jobs(folder, of, kind, arguments.rounds)):
                pass
    print({of: len(list((folder / of).glob("*.npz"))) for of in SETS}, "files of squares")


if __name__ == "__main__":
    main()
