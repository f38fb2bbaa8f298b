"""What a folder is, by what lies in it."""

from pathlib import Path

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.inspection.facts import Facts
from hicp_lib.inspection.json_files import inspect_json, inspect_predictions
from hicp_lib.inspection.recordings import inspect_bag, inspect_recording

_RESULTS = {
    "alphapose-results.json": "alphapose", "coco_instances_results.json": "detectron2", "results.json": "coco",
}  # fmt: skip
_ONE_FILE_AN_IMAGE = {"people": "openpose", "instance_info": "mmpose", "keypoint_scores": "mmpose"}
_CAMERA_FILES = ("intrinsic.json", "camera_intrinsic.json")
IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp", ".webp", ".tif", ".tiff")


def inspect_folder(folder: Path) -> Facts:
    """Say what a folder is.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    Facts

    Raises
    ------
    InputError
        If nothing in it is of a kind that is known.
    """
    names = {path.name for path in folder.iterdir()}
    if "metadata.yaml" in names:
        return inspect_bag(folder)
    if "rgb.txt" in names or {"camera.json", "rgb"} <= names:
        return inspect_recording(folder)
    if {"color", "depth"} <= names:
        return _open3d(folder)
    if {"basic", "headless"} <= names:
        return _subsets(folder)
    if {"images", "annotations.json"} <= names:
        return _dataset(folder)
    images = [name for name in names if Path(name).suffix.lower() in IMAGE_SUFFIXES]
    if images:
        says = {"images": str(len(images)), "annotations": "none in the folder"}
        needs = {"hicp detect": "", "hicp dataset create": "--annotations"}
        return Facts(folder, "folder of images", says, needs=needs)
    return _predictions(folder, names)


def _dataset(folder: Path) -> Facts:
    facts = inspect_json(folder / "annotations.json")
    needs = {"hicp detect": "", "hicp evaluate": "--detections"}
    return Facts(folder, "data set: images and annotations", facts.says, facts.notes, needs, facts.problem)


def _subsets(folder: Path) -> Facts:
    says, notes = {}, []
    for name in ("basic", "headless"):
        facts = _dataset(folder / name)
        says[name] = facts.says.get("people", facts.problem)
        notes += facts.notes
    needs = {"hicp detect": "--dataset, one of the two"}
    return Facts(folder, "HiCP crops: Basic and Headless", says, notes, needs)


def _open3d(folder: Path) -> Facts:
    counts = {name: len(list((folder / name).iterdir())) for name in ("color", "depth")}
    says = {"images": ", ".join(f"{name} {n}" for name, n in counts.items())}
    camera_file = next((folder / name for name in _CAMERA_FILES if (folder / name).is_file()), None)
    if camera_file is None:
        return Facts(folder, "RGB-D folder", says, needs={"hicp record import": "intrinsic.json in it"})
    facts = inspect_json(camera_file)
    content, options = read_json(camera_file), {"fps": "--rate", "depth_scale": "--depth-scale"}
    missing = [option for key, option in options.items() if key not in content]
    if "fps" in content:
        says["times"] = f"{content['fps']} per second, as the file says"
    needs = {"hicp record import": f"--open3d, {', '.join([*missing, '--poses unless it stands still'])}"}
    says |= facts.says
    return Facts(folder, "RGB-D folder of Open3D's tools", says, facts.notes, needs, facts.problem)


def _predictions(folder: Path, names: set[str]) -> Facts:
    for name in sorted(names):
        if name.endswith(".json"):
            if name in _RESULTS:
                return inspect_predictions(folder / name, _RESULTS[name])
            value = read_json(folder / name)
            first = value[0] if isinstance(value, list) and value else value
            for key, tool in _ONE_FILE_AN_IMAGE.items():
                if isinstance(first, dict) and key in first:
                    return inspect_predictions(folder, tool)
    listed = ", ".join(sorted(names)[:5]) or "nothing"
    raise InputError(f"{folder}: a folder of no kind that is known; it holds {listed}")
