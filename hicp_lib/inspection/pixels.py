"""Describe images, videos, sets of them and networks."""

import zipfile
from collections import Counter
from itertools import islice
from pathlib import Path

import numpy as np
from PIL import Image

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_bytes, read_json
from hicp_lib.core.folders import listed_and_others
from hicp_lib.core.images import image_header, refuse_too_large
from hicp_lib.core.video import open_video
from hicp_lib.detectors.mediapipe.bundles import BUNDLES
from hicp_lib.detectors.onnx.model_file import read_model
from hicp_lib.detectors.runtime.to_file import IMAGE_SUFFIXES
from hicp_lib.inspection.facts import Facts, about_times
from hicp_lib.inspection.people import MOST_HEADERS, describe_annotations


def describe_image(path: Path) -> Facts:
    """Say what a picture is; its pixels are read to the end."""
    refuse_too_large(path, *image_header(path)[:2])
    with Image.open(path) as image:
        values = np.asarray(image)  # to the end, to find truncated files
    says = {"size": f"{image.width} x {image.height} pixels, {image.mode}"}
    if image.mode.startswith("I"):
        middle = np.median(values[values > 0]) if values.any() else 0
        says["depth"] = f"16 bits, raw units; {100 * np.mean(values > 0):.0f} % measured, median {middle:.0f}"
        return Facts(says, needs={"hicp record import": "--depth-scale"}, kind="depth image")
    flag = image_header(path)[2]
    turned = f"rotation flag {flag} (EXIF): viewers turn it, here it is taken as stored"
    return Facts(says, [turned] * (flag > 1))


def describe_video(path: Path) -> Facts:
    """Say what a video is."""
    n_frames, frames = open_video(path)
    seen = list(islice(frames, 2))
    if not seen:
        raise InputError(f"{path}: OpenCV decodes no frame of it; is it cut off?")
    height_px, width_px = seen[0][1].shape[:2]
    says = {"size": f"{width_px} x {height_px} pixels, turned as players show it"}
    says["frames"] = f"{n_frames or 'not known'}, as the file says"
    says["times"] = about_times(np.array([time_s for time_s, _ in seen]), "of the file; of its first frames")
    return Facts(says)


def describe_images(folder: Path) -> Facts:
    """Say what images a folder holds; pixels are not read."""
    names, rest = listed_and_others(folder, IMAGE_SUFFIXES)
    paths = [folder / name for name in names]
    headers = [image_header(path) if path.is_file() else (0, 0, 1) for path in paths[:MOST_HEADERS]]
    sizes = Counter(f"{width} x {height}" for width, height, _ in headers if width)
    shown = ", ".join(f"{size} ({n})" for size, n in sizes.most_common(3)) + ", ..." * (len(sizes) > 3)
    turned = "have a rotation flag (EXIF): viewers turn them, here they are as stored"
    counts = {
        turned: sum(flag > 1 for *_, flag in headers),
        "cannot be read": sum(not width for width, *_ in headers),
        "were not looked into": len(paths) - len(headers),
    }  # fmt: skip
    notes = [*(f"{n} images {what}" for what, n in counts.items() if n), *[rest] * bool(rest)]
    return Facts({"images": f"{len(paths)}; pixels: {shown or 'none'}"}, notes)


def describe_dataset(folder: Path) -> Facts:
    """Say what a folder with `images/` and `annotations.json` holds."""
    images = describe_images(folder / "images")
    facts = describe_annotations(folder / "annotations.json", folder / "images")
    return Facts(facts.says | images.says, [*images.notes, *facts.notes], facts.needs)


def describe_subsets(folder: Path) -> Facts:
    """Say what Basic and Headless hold."""
    parts = {name: describe_dataset(folder / name) for name in ("basic", "headless")}
    says = {name: f"{of.says['people']}; images {of.says['images']}" for name, of in parts.items()}
    notes = [f"{name}: {note}" for name, of in parts.items() for note in of.notes]
    return Facts(says | {"layout": parts["basic"].says["layout"]}, notes)


def describe_network(path: Path) -> Facts:
    """Say what network an ONNX file holds."""
    model = read_model(path, read_bytes(path, "expected an ONNX file"))
    if not model.operators:
        raise InputError(f"{path}: has no operators; expected a network")
    said = {name: str(value)[:80] for name, value in list(model.metadata.items())[:5]}
    return Facts({"kinds of operators": str(len(model.operators)), **said})


def describe_task(path: Path) -> Facts:
    """Say which task a bundle of MediaPipe's is for."""
    with zipfile.ZipFile(path) as archive:
        members = archive.namelist()
    tasks = [task for task, needed in BUNDLES.items() if set(needed) <= set(members)]
    if not tasks:
        raise InputError(f"of no kind that is known; it holds {', '.join(members[:4]) or 'nothing'}")
    needs = {"hicp detect": f"--detector mediapipe-{tasks[0].replace('hand', 'hands')}, this file as --model"}
    return Facts({"task": tasks[0], "networks": ", ".join(members)}, (), needs, kind="MediaPipe task bundle")


def describe_count(path: Path) -> Facts:
    """Say how long a list in JSON is."""
    return Facts({"objects": str(len(read_json(path)))})
