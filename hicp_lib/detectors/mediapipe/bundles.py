"""Task bundles for MediaPipe, assembled in memory from the separate model files.

MediaPipe's Tasks API reads a `.task` bundle: a zip, stored and aligned, of two TFLite models. The package
index has the models but no bundles. They are used unchanged, except that the model of the pose landmarks
lacks the metadata that tells the task how to scale pixels. It is added here: this model takes [0, 1], as in
MediaPipe's own graph for the same file. MediaPipe's code for this is plain Python and is loaded file by file,
since MediaPipe itself runs only in a separate process.
"""

import io
import zipfile
from functools import cache, lru_cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from hicp_lib.core.errors import InputError, one_line
from hicp_lib.core.extras import needs
from hicp_lib.core.files import read_bytes
from hicp_lib.detectors.mediapipe.program import program_folder
from hicp_lib.detectors.weights.default import load
from hicp_lib.detectors.weights.published import check_use

# Task -> member of the bundle -> (weight file, (mean, std) of the pixel scaling to be declared).
BUNDLES: dict[str, dict[str, tuple[str, tuple[float, float] | None]]] = {
    "pose": {
        "pose_detector.tflite": ("pose_detection.tflite", None),
        "pose_landmarks_detector.tflite": ("pose_landmark_full.tflite", (0.0, 255.0)),
    },
    "hand": {
        "hand_detector.tflite": ("palm_detection_full.tflite", None),
        "hand_landmarks_detector.tflite": ("hand_landmark_full.tflite", None),
    },
}


def assemble(task: str) -> bytes:
    """The bundle of a task ("pose" or "hand") made of verified weight files; equal bytes every time.

    Raises
    ------
    InputError
        If MediaPipe or a weight file is absent, or one is damaged.
    """
    bundle = io.BytesIO()
    utilities = _of_mediapipe("tasks/python/metadata/metadata_writers/model_asset_bundle_utils.py")
    with utilities.AlignZipFile(bundle, mode="w", alignment=4) as archive:
        for member, (weight, scaling) in BUNDLES[task].items():
            model = load(weight) if scaling is None else _with_scaling(load(weight), *scaling)
            # ZipInfo without a date: 1980, so the bytes do not depend on the clock.
            archive.writestr(zipfile.ZipInfo(member), model)
    return bundle.getvalue()


def read_bundle(task: str, path: str | Path) -> bytes:
    """An official `.task` bundle the user points to.

    Raises
    ------
    InputError
        If the file is unreadable, lacks a model that the task needs or, if it was fetched by name, differs
        from the one recorded then.
    """
    content, found = read_bytes(path, f"give the .task file of the {task} landmarker"), dict[str, bytes]()
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            # MediaPipe reads them in place, so compressed members are refused, which also excludes zip bombs.
            stored = [one for one in archive.infolist() if one.compress_type == zipfile.ZIP_STORED]
            found = {one.filename: archive.read(one) for one in stored if one.filename in BUNDLES[task]}
    except Exception as error:  # zipfile raises many kinds for damaged archives
        why = one_line(error)
        raise InputError(f"{path}: is not a MediaPipe .task bundle ({why}); give another file") from None
    absent = [member for member in BUNDLES[task] if found.get(member, b"")[4:8] != b"TFL3"]
    if absent:
        raise InputError(f"{path}: has no {absent[0]}; give the .task file of the {task} landmarker")
    check_use(Path(path), content)
    return content


@lru_cache(maxsize=4)
def _with_scaling(model: bytes, mean: float, std: float) -> bytes:
    """Append TFLite metadata that declares (pixel - mean) / std for an RGB input."""
    tflite = _of_mediapipe("tasks/metadata/schema_py_generated.py")
    tree = tflite.ModelT.InitFromPackedBuf(model, 0)
    tree.buffers.append(tflite.BufferT(data=np.frombuffer(_scaling_metadata(mean, std), dtype=np.uint8)))
    entry = tflite.MetadataT(name="TFLITE_METADATA", buffer=len(tree.buffers) - 1)
    tree.metadata = [*(tree.metadata or []), entry]
    return _pack(tree, b"TFL3")


def _scaling_metadata(mean: float, std: float) -> bytes:
    schema = _of_mediapipe("tasks/metadata/metadata_schema_py_generated.py")
    scaling = schema.ProcessUnitT(
        optionsType=schema.ProcessUnitOptions.NormalizationOptions,
        options=schema.NormalizationOptionsT(mean=[mean] * 3, std=[std] * 3),
    )
    content = schema.ContentT(
        contentPropertiesType=schema.ContentProperties.ImageProperties,
        contentProperties=schema.ImagePropertiesT(colorSpace=schema.ColorSpaceType.RGB),
    )
    image = schema.TensorMetadataT(name="image", content=content, processUnits=[scaling])
    graph = schema.SubGraphMetadataT(inputTensorMetadata=[image])
    return _pack(schema.ModelMetadataT(subgraphMetadata=[graph]), b"M001")


def _pack(tree: Any, identifier: bytes) -> bytes:
    with needs("mediapipe"):
        from flatbuffers import Builder

    builder = Builder(0)
    builder.Finish(tree.Pack(builder), identifier)
    return bytes(builder.Output())


@cache
def _of_mediapipe(file: str) -> ModuleType:
    """One file of the package as a private module."""
    path = program_folder() / file
    spec = spec_from_file_location(f"{__name__}.{path.stem}", path)
    assert spec and spec.loader
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
