"""Whether small people are found better in enlarged pictures.

    python tools/closerange/resolution.py FOLDER PEOPLE.onnx HANDS.onnx --out TABLES [--steps 1500]

Crops of held-out people are made three times smaller. Then they are enlarged again: by interpolation, and by
a small network that was trained on rendered pictures of development people (FOLDER/scenes of
`make_samples.py`); and the original crop is what enlarging could bring at best. The annotations stay as they
are. Writes TABLES/resolutions.csv, average precision of bodies and hands by the closerange network and, for
bodies, by MoveNet Lightning.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import torch
from torch import nn
from torch.nn import functional

sys.path.insert(0, str(Path(__file__).parents[1]))

from closerange.evaluate import held_out  # noqa: E402
from hicp_lib.core.images import read_image  # noqa: E402
from hicp_lib.detectors.runtime.results import detections_of  # noqa: E402
from hicp_lib.detectors.runtime.run import detect_images  # noqa: E402
from hicp_lib.evaluation.ap import metric_table  # noqa: E402
from hicp_lib.evaluation.statistics.resampling import Draws  # noqa: E402
from hicp_lib.formats.annotations import read_annotations  # noqa: E402

TIMES = 3
"""Smaller, along each side."""
PATCH_PX, BATCH, RATE, CHANNELS = 96, 16, 1e-3, 32
SUBSETS = ("basic", "headless")
Enlarge = Callable[[np.ndarray], np.ndarray]


class Enlarger(nn.Module):
    """Interpolation, and what three convolutions add (after Shi et al., "Real-time single image and video
    super-resolution using an efficient sub-pixel convolutional neural network", CVPR 2016)."""

    def __init__(self) -> None:
        super().__init__()
        self.added = nn.Sequential(
            nn.Conv2d(3, CHANNELS, 5, padding=2), nn.ReLU(), nn.Conv2d(CHANNELS, CHANNELS, 3, padding=1),
            nn.ReLU(), nn.Conv2d(CHANNELS, 3 * TIMES**2, 3, padding=1), nn.PixelShuffle(TIMES),
        )  # fmt: skip

    def forward(self, small: torch.Tensor) -> torch.Tensor:
        return functional.interpolate(small, scale_factor=TIMES, mode="bicubic") + self.added(small)


def smaller(image: np.ndarray) -> np.ndarray:
    """The picture without the last rows and columns that do not fill a pixel, three times smaller."""
    height, width = (side // TIMES for side in image.shape[:2])
    return cv2.resize(image[: height * TIMES, : width * TIMES], (width, height), interpolation=cv2.INTER_AREA)


def trained(images: list[Path], steps: int, seed: int = 0) -> Enlarger:
    """The network, trained on random patches."""
    torch.manual_seed(seed)
    torch.use_deterministic_algorithms(True)
    rng, network = np.random.default_rng(seed), Enlarger()
    optimizer = torch.optim.Adam(network.parameters(), RATE)
    for step in range(steps):
        patches = np.stack([_patch(rng, read_image(images[rng.integers(len(images))])) for _ in range(BATCH)])
        small = _tensor(np.stack([smaller(patch) for patch in patches]))
        loss = functional.l1_loss(network(small), _tensor(patches))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        if step % 500 == 0 or step == steps - 1:
            print(f"step {step}: {255 * loss.item():.2f} grey levels", flush=True)
    return network.eval()


def _patch(rng: np.random.Generator, image: np.ndarray) -> np.ndarray:
    top, left = (int(rng.integers(side - PATCH_PX)) for side in image.shape[:2])
    return image[top : top + PATCH_PX, left : left + PATCH_PX]


def _tensor(images: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(np.ascontiguousarray(images.transpose(0, 3, 1, 2))).float() / 255


def by_network(network: Enlarger) -> Enlarge:
    """Enlarges a picture three times."""

    def enlarge(image: np.ndarray) -> np.ndarray:
        with torch.no_grad():
            pixels = network(_tensor(image[None]))[0].clamp(0, 1).numpy().transpose(1, 2, 0)
        return np.ascontiguousarray((255 * pixels + 0.5).astype(np.uint8))

    return enlarge


def by_interpolation(image: np.ndarray) -> np.ndarray:
    """Enlarges a picture three times."""
    return cv2.resize(image, None, fx=TIMES, fy=TIMES, interpolation=cv2.INTER_CUBIC)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("hand_model", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=1500)
    arguments = parser.parse_args()
    detectors = {
        "closerange": {"model": arguments.model, "hand_model": arguments.hand_model},
        "movenet-lightning": {},
    }
    network = trained(sorted((arguments.folder / "scenes" / "images").glob("*.jpg")), arguments.steps)
    ways: dict[str, Enlarge | None] = {
        "interpolated": by_interpolation, "by a small network": by_network(network), "as rendered": None,
    }  # fmt: skip
    folders = {subset: held_out()[0][subset] for subset in SUBSETS}
    truth = {subset: read_annotations(folder / "annotations.json") for subset, folder in folders.items()}
    found = {}
    for subset, people in truth.items():
        images = {
            i: read_image(folders[subset] / "images" / one.file_name) for i, one in people.images.items()
        }
        for way, enlarge in ways.items():
            shown = {i: enlarge(smaller(image)) if enlarge else image for i, image in images.items()}
            for name, options in detectors.items():
                found[subset, f"{name}, {way}"] = detections_of(detect_images(name, shown, **options))
    table = metric_table.metric_table(metric_table.draw_cases(truth, found, Draws(1000, 0)))
    table = table[table["metric"] == "AP"].rename(columns={"detector": "variant"})
    table = table[["variant", "subset", "group", "value", "low", "high"]].dropna(subset="value")
    arguments.out.mkdir(parents=True, exist_ok=True)
    write = {"index": False, "float_format": "%.4f", "lineterminator": "\n"}
    table.to_csv(arguments.out / "resolutions.csv", **write)
    print(pd.pivot_table(table, "value", "variant", ["group", "subset"]).round(3).to_string())


if __name__ == "__main__":
    main()
