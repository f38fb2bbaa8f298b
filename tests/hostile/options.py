"""Options that are no numbers, not of this world, or empty."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from tests.hostile.case import Case
from tests.hostile.good import APPLY, CREATE, DETECT, DRAW, EVALUATE, FIT, IMPORT, IMPORT_OPEN3D, LIFT, MMPOSE

ANY = "detect --images pictures --out out.json --detector"
NUMBERS = ("nan", "inf", "-inf", "-1", "NaN", "Infinity", "1e400", "", "text", "[1]", "null", "true", "1e300",
           "9" * 400)  # fmt: skip
# Detector, option, and the numbers of these that are right.
OF_DETECTORS = (
    ("mediapipe", "min_score", ()), ("mediapipe", "num_people", ()), ("mediapipe", "tracking_hz", ()),
    ("mediapipe-hands", "num_hands", ()), ("mediapipe-pose", "num_poses", ()),
    ("movenet-lightning", "padding", ()), ("movenet-lightning", "person_min_score", ()),
    ("movenet-lightning", "threads", ()), ("movenet-multipose", "min_person_score", ()),
    ("openpose-mobilenet", "net_height_px", ()), ("posenet", "min_root_score", ()),
    ("mmpose --model model.onnx", "score_scale", ("null",)),
    ("mmpose --model model.onnx", "input_size_px", ("null",)),
    ("mmpose --model model.onnx", "flip_test", ("true",)),
    ("mmpose --model model.onnx", "person_max_overlap", ()),
)  # fmt: skip
MORE = {"min_score": ("5",), "num_hands": ("0", "1.5", "1000000000"), 
        "num_people": ("0", "1.5", "1000000000"),
        "num_poses": ("0", "1.5"), "threads": ("0", "1.5", "1000000000"),
        "padding": ("0", "1e9")}  # fmt: skip
NULL_IS_DEFAULT = ("person_min_score", "person_max_overlap", "score_scale", "input_size_px")
MAY_BE_MANY = ("--seed", "--limit", "--min-pixels", "--workers", "--score-scale", "--rate", "--depth-scale",
               "--subject")  # fmt: skip
OF_COMMANDS = {
    "--score-scale": f"{IMPORT} --out out.json",
    "--min-pixels": f"{CREATE} --out out",
    "--seed": f"{EVALUATE} --group body",
    "--limit": f"{DRAW} --out out.html",
    "--min-score": f"{DRAW} --out out",
    "--rate": IMPORT_OPEN3D,
    "--depth-scale": IMPORT_OPEN3D,
    "--workers": f"{DETECT} --out out.json",
    "--n": "scenes render out",
    "--n-frames": "record simulate mocap out",
    "--subject": "record simulate mocap out --n-frames 1",
    "--seconds": "record camera out",
}
TEXT_OPTIONS = {
    "--area": f"{EVALUATE} --group body",
    "--sigmas": f"{EVALUATE} --group body",
    "--group": EVALUATE,
    "--format": "import --predictions results.json --annotations annotations.json --out out.json",
    "--layout": "export --detections results.json --format coco --out out.json",
    "--boxes": f"{DETECT} --out out.json",
    "--detector": f"{APPLY} --out out.json",
    "--method": f"{LIFT} --out out.parquet",
    "--depth-camera": "record simulate mocap out --n-frames 1",
    "--people": "scenes render out --n 1",
    "--mount": f"{IMPORT_OPEN3D} --poses poses.txt",
    "--orientation": f"{CREATE} --out out",
    "--profile": "report --results out",
    "--only": "report --results out",
    "--model": "detect --detector mmpose --images pictures --out out.json",
    "--person-model": f"{MMPOSE} --out out.json",
    "--images": "detect --detector movenet-lightning --out out.json",
    "--dataset": "detect --detector movenet-lightning --out out.json",
    "--annotations": "dataset create --images pictures --out out",
    "--keypoint-map": f"{CREATE} --out out",
    "--bag": "record import out",
    "--open3d": "record import out",
    "--poses": IMPORT_OPEN3D,
    "--base-frame": "record import out --bag x.bag",
    "--color-topic": "record import out --bag x.bag",
    "--recording": "lift --detector movenet-lightning --out out.parquet",
}
TEXTS_OF_DETECTORS = {
    "movenet-lightning": ("boxes", "person_model"),
    "mediapipe-pose": ("model",),
    "mmpose --model model.onnx": ("boxes", "person_model", "person_family", "hand"),
    "alphapose --model model.onnx": ("decoding",),
    "detectron2 --model model.onnx": ("family",),
}
OUTPUTS = {
    "detect": DETECT,
    "create": CREATE,
    "import": IMPORT,
    "export": "export --detections results.json --format coco",
    "draw": DRAW,
    "fit": FIT,
    "lift": LIFT,
    "evaluate": EVALUATE,
}
SUFFIXES = {"draw": ".html", "lift": ".csv"}  # of what the others write: .json
PLACES = {"nowhere": "", "of 5,000 characters": "a" * 5000 + "{}", "below a file": "results.json/out{}",
          "in /proc": "/proc/out{}", "in /dev": "/dev/null/out{}",
          "with a line": "out\n.xyz"}  # fmt: skip
# What the library calls its own arguments.
NO_OPTIONS = "name images workers self detector boxes_px progress options out tell".split()
WITH_DETECTORS = {
    "detect": f"{DETECT} --out out.json",
    "lift": f"{LIFT} --out out.parquet",
    "models show": "models show --detector movenet-lightning",
    "models use": "models use --detector mmpose --model model.onnx",
    "combined": f"{ANY} combined:movenet-lightning+mediapipe-hands",
}
EMPTY_FOLDERS = ("scenes render '' --n 1", "record simulate mocap '' --n-frames 1", "record check ''",
                 "inspect ''", "record import '' --bag x.bag",
                 "report --profile quick --results ''")  # fmt: skip
PARAMETERS = {"detectors": ("", "[]", "nonsense", '["mediapipe", 7]', "NaN", "mediapipe,mediapipe"),
              "seed": ("nan", "inf", "-1", "1.5", "", "text", "1e300"),
              "n_images": ("0", "-1", "nan", "1e9", "inf", "", "1.5")}  # fmt: skip
# Of the environment, and what is right with them beside a refusal.
VARIABLES = {
    "HICP_CACHE": ("", "/dev/null", "results.json", "/proc/x", "circle", "out\nb", "out" * 100),
    "HICP_LIMITS": ("", "nan", "inf", "-1", "0", "1e999", "x", "9" * 5000),
    "HICP_DASK": ("", "nonsense", "tcp://127.0.0.1:9", "/dev/zero"),
    "TMPDIR": ("", "/nowhere", "/dev/null", "circle"),
}
UNDER_VARIABLES = {
    "detect": f"{DETECT} --out out.json", "import": "record import out --bag x.bag", "models": "models list",
    "draw": f"{DRAW} --out out", "create": f"{CREATE} --out out",
}  # fmt: skip
PROVIDERS = ("CPU", "cpu2", "../x", "", "CPUExecutionProvider", "nan", "/dev/zero", "<svg onload=x()>")


def _circle(folder: Path) -> None:
    (folder / "circle").symlink_to("circle")


def cases() -> Iterator[Case]:
    for variable, values in VARIABLES.items():
        for value in values:
            shown = value if len(value) < 20 else f"{len(value)} characters"
            for name, command in UNDER_VARIABLES.items():
                told = {"exits": (0, 2), "notes": True, "fresh": variable == "TMPDIR"}
                yield Case(
                    f"variable: {variable}={shown!r}: {name}", command, _circle,
                    environment=((variable, value),), **told,
                )  # fmt: skip
    for detector, option, right in OF_DETECTORS:
        allowed = (*right, *(["null"] if option in NULL_IS_DEFAULT else []))
        for number in (*NUMBERS, *MORE.get(option, ())):
            if number not in allowed:
                # true is 1 to Python; what is asked is that nothing breaks
                exits = (0, 2) if number in ("true", "1e300", "1e9", "1000000000") else (2,)
                command = [*f"{ANY} {detector}".split(), "-o", option, number]
                shown = number if len(number) < 20 else f"{len(number)} digits"
                yield Case(
                    f"option: {detector.split()[0]} {option} {shown!r}", command, exits=exits, notes=True
                )
    for provider in PROVIDERS:
        for detector in ("movenet-lightning", "mmpose --model model.onnx"):
            exits = (0, 2) if "CPU" in provider else (2,)
            command = [*f"{ANY} {detector}".split(), "-o", "provider", provider]
            yield Case(
                f"option: {detector.split()[0]} provider {provider!r}", command, exits=exits, notes=True
            )
    for option, command in OF_COMMANDS.items():
        for number in ("nan", "inf", "-inf", "-1", "", "text", "1e400", "9" * 30, "9" * 5000):
            many = number.startswith("9") and option in MAY_BE_MANY
            shown = number if len(number) < 20 else f"{len(number)} digits"
            exits = (0, 2) if many else (2,)
            yield Case(
                f"option: {option} {shown!r}", [*command.split(), option, number], exits=exits, notes=True
            )
    for option, command in TEXT_OPTIONS.items():
        for text in ("", "nonsense", "nan", "a" * 5000, "\x1b[2J", "/dev/zero"):
            shown = text if len(text) < 20 else f"{len(text)} characters"
            yield Case(f"option: {option} {shown!r}", [*command.split(), option, text])
    for name, command in OUTPUTS.items():
        for kind, place in PLACES.items():
            yield Case(
                f"option: {name} --out {kind}",
                [*command.split(), "--out", place.format(SUFFIXES.get(name, ".json"))],
                exits=(0, 2) if "line" in kind else (2,),
            )
    for name, command in WITH_DETECTORS.items():
        for option in NO_OPTIONS:
            yield Case(f"option: {name} -o {option}", [*command.split(), "-o", option, "3"])
    for command in EMPTY_FOLDERS:
        yield Case(f"option: {command}", command)
    for detector, options in TEXTS_OF_DETECTORS.items():
        for option in options:
            command = [*f"{ANY} {detector} -o {option}".split(), ""]
            yield Case(f"option: {detector.split()[0]} {option} ''", command)
    for parameter, values in PARAMETERS.items():
        for value in values:
            command = ["report", "--profile", "quick", "--results", "out", "-p", parameter, value]
            yield Case(f"option: -p {parameter} {value!r}", command)
