"""Small inputs for `tools/wheel_check.sh`: annotated images, a network and a recording, into a folder."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import cv2
import numpy as np

from hicp_lib.core.camera import Camera
from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.formats.annotations import read_annotations
from hicp_lib.recordings.writer import write_recording

sys.path.append(str(Path(__file__).parents[1]))
from tests.detectors.onnx.onnx_models import colour_maps_model  # noqa: E402


def main(out: Path) -> None:
    """Write `native/`, `images/`, `net.onnx` and `rec/` into the folder `out`."""
    shutil.copytree(DATA_DIR / "examples" / "native", out / "native")
    (out / "images").mkdir()
    noise = np.random.default_rng(0)
    for image in read_annotations(out / "native" / "annotations.json").images.values():
        pixels = noise.integers(0, 256, (image.height_px, image.width_px, 3), np.uint8)
        cv2.imwrite(str(out / "images" / image.file_name), pixels)
    colour_maps_model(out / "net.onnx", (192, 256), 133)
    depth_m, stands = np.full((48, 64), 1.0), (np.zeros(1), np.eye(4)[None])
    colours = [noise.integers(0, 256, (48, 64, 3), np.uint8) for _ in range(3)]
    frames = [(100 + k / 10, colour, depth_m) for k, colour in enumerate(colours)]
    write_recording(out / "rec", Camera(64, 48, 60.0, 60.0, 31.5, 23.5), 1000, frames, stands)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
