"""Open ONNX model files with ONNX Runtime: checked, on the requested processor, shared; say what is assumed.

A model is opened once per process and shared by all detectors (one per thread); ONNX Runtime's sessions can
run in several threads at once.
"""

import math
import threading
import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TypedDict

import numpy as np

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError, one_line
from hicp_lib.core.files import read_bytes, read_json, sha256_bytes
from hicp_lib.core.images import MAX_PIXELS
from hicp_lib.core.limited import raised
from hicp_lib.detectors.onnx.model_file import ModelFile, read_model
from hicp_lib.detectors.onnx.starting import DTYPES, VERSION, available_providers, start, try_out
from hicp_lib.detectors.weights.default import find, load
from hicp_lib.detectors.weights.published import check_use

TEXTS = read_json(DATA_DIR / "model_facts.json")
KNOWN_NETWORKS = ", ".join(TEXTS["networks"])
"""The networks that the detectors accept, in one line."""


class Fact(NamedTuple):
    """One property of a model.

    Attributes
    ----------
    what, value : str
    why : str
        How the value was determined.
    """

    what: str
    value: str
    why: str


def facts(name: str, **values: Any) -> list[Fact]:
    """The assumptions about one kind of network.

    Parameters
    ----------
    name : str
        Key of `facts` in `data/model_facts.json`.
    **values : object
        Values for the placeholders in braces.

    Examples
    --------
    >>> facts("nanodet", min_score=0.3, max_overlap=0.6)[1]
    Fact(what='person score', value='>= 0.3', why='overlaps above 0.6 are suppressed')
    """
    return [Fact(*(text.format(**values) for text in row)) for row in TEXTS["facts"][name]]


@dataclass(frozen=True)
class Port:
    """An input or output of a model.

    Attributes
    ----------
    name : str
    shape : tuple[int | None, ...]
        None where the model leaves a size open.
    dtype : str
        ONNX's name.
    """

    name: str
    shape: tuple[int | None, ...]
    dtype: str


class OnnxModel:
    """A model ready to run; get one from `open_model`.

    Attributes
    ----------
    path : Path
    sha256 : str
        The file, and the hash of its content.
    provider : str
        Where it runs, e.g. "cpu".
    inputs, outputs : list of Port
        Its ports.
    told : ModelFile
        Properties read from its file.
    """

    def __init__(self, path: Path, content: bytes, provider: str, threads: int, is_ours: bool) -> None:
        self.told: ModelFile = read_model(path, content)
        if not is_ours:
            try_out(path)
        self.path, self.sha256, self.provider = path, sha256_bytes(content), provider
        self._session = start(path, content, provider, threads)
        self._responses: dict[tuple[int, ...], list[np.ndarray]] = {}
        self.inputs = [_port(node) for node in self._session.get_inputs()]
        self.outputs = [_port(node) for node in self._session.get_outputs()]
        are_numbers = all(of.dtype.startswith("tensor(") and "str" not in of.dtype for of in self.outputs)
        if len(self.inputs) != 1 or self.inputs[0].dtype not in DTYPES or not are_numbers:
            raise self.refusal("expected one input, an image in floating point, and outputs of numbers")

    @property
    def settings(self) -> dict:
        """What identifies the model's results."""
        return {"sha256": self.sha256, "provider": self.provider, "onnxruntime": VERSION}

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of its single input image; 0 where the model leaves them open.

        Raises
        ------
        InputError
            If it takes something else.
        """
        shape = self.inputs[0].shape
        if len(shape) != 4 or shape[0] not in (None, 1) or shape[1] not in (None, 3):
            raise self.refusal("expected an input of one image, (1, 3, h, w)")
        return shape[3] or 0, shape[2] or 0

    def refusal(self, why: str, outputs: list[np.ndarray] | None = None) -> InputError:
        """The error for an unsupported network: what it is, why it is refused, what is supported.

        Parameters
        ----------
        why : str
        outputs : list of array, optional
            Its actual outputs, if they tell more than the file.
        """
        shapes = [port.shape for port in self.outputs] if outputs is None else [out.shape for out in outputs]
        gives = [f"{port.name} {_text(shape)}" for port, shape in zip(self.outputs, shapes, strict=True)]
        takes = [f"{port.name} {_text(port.shape)} {port.dtype}" for port in self.inputs]
        return InputError(
            f"{self.path}: takes {', '.join(takes) or 'nothing'} and gives {', '.join(gives) or 'nothing'}; "
            f"{why}. Known are {KNOWN_NETWORKS}"
        )

    def describe(self) -> list[Fact]:
        """What it is and where it runs."""
        where = Fact("runs on", self.provider, "option provider")
        return [Fact("model", self.path.name, f"SHA-256 {self.sha256}"), where]

    def run(self, pixels: np.ndarray) -> list[np.ndarray]:
        """The outputs for one input array, in the model's order.

        Raises
        ------
        InputError
            If the network does not accept the array, fails on it, or gives NaN.
        """
        port = self.inputs[0]
        feed = {port.name: pixels.astype(DTYPES[port.dtype], copy=False)}
        try:
            outputs = self._session.run(None, feed)
        except Exception as error:  # ONNX Runtime's errors share no base class of their own
            raise InputError(
                f"{self.path}: the network failed on an input of shape {pixels.shape} "
                f"({one_line(error)}); export it again for this input"
            ) from None
        for port, output in zip(self.outputs, outputs, strict=True):
            if output.dtype.kind == "f" and output.size and np.isnan(output.min()):
                raise InputError(f"{self.path}: its output {port.name} is NaN in places; export in 32 bits")
        return [np.asarray(output) for output in outputs]

    def run_named(self, pixels: np.ndarray) -> dict[str, np.ndarray]:
        """As `run`, the outputs by their names."""
        return dict(zip((port.name for port in self.outputs), self.run(pixels), strict=True))

    def response_to_zeros(self, *size_px: int) -> list[np.ndarray]:
        """The outputs for an input of zeros: their shapes, and the response to an empty image.

        Parameters
        ----------
        *size_px : int
            Height and width, where the model leaves them open.
        """
        if size_px not in self._responses:
            shape, one_image = self.inputs[0].shape, (1, 3, *size_px)
            sizes = one_image if len(shape) == len(one_image) else [1] * len(shape)
            sizes = [size or given for size, given in zip(shape, sizes, strict=True)]
            if math.prod(sizes) > raised(MAX_PIXELS):
                raise self.refusal(f"its input would be {_text(sizes)}, more than {MAX_PIXELS:.0e} values")
            self._responses[size_px] = self.run(np.zeros(sizes, np.float32))
        return self._responses[size_px]


class RunOptions(TypedDict, total=False):
    """How a network is run: options of every detector that has one.

    Attributes
    ----------
    provider : str
        Execution provider by its short name: cpu (the default), cuda, tensorrt, openvino, ...
    threads : int
        Threads of one inference, 1 by default; images already run in parallel, so more rarely help.
    """

    provider: str
    threads: int


_open: weakref.WeakValueDictionary[tuple, OnnxModel] = weakref.WeakValueDictionary()
_lock = threading.Lock()


def open_model(path: str | Path, provider: str = "cpu", threads: int = 1) -> OnnxModel:
    """Open an ONNX file, or return the model if this process has it open already.

    Parameters
    ----------
    path : str or Path
        The file; one that keeps weights in a second file ("external data") is refused.
    provider : str
    threads : int
        See `RunOptions`.

    Raises
    ------
    InputError
        If the file is absent, not a network that ONNX Runtime can run, differs from the one recorded when it
        was fetched by name, takes too much time or memory, or the provider is not available.
    """
    path = Path(path)
    content = read_bytes(path, "give the path of an ONNX file")
    check_use(path, content)
    return _opened(content, path, provider, threads, is_ours=False)


def _opened(content: bytes, path: Path, provider: str, threads: int, is_ours: bool) -> OnnxModel:
    """The model with this content; networks that do not come with the library are tried out first."""
    if provider not in available_providers():
        raise InputError(
            f"{path}: execution provider {provider!r} is not available here; expected one of: "
            f"{', '.join(available_providers())} (others need another build of onnxruntime)"
        )
    key = (sha256_bytes(content), str(path), provider, threads)
    with _lock:
        model = _open.get(key)
        if model is None:
            model = _open[key] = OnnxModel(path, content, provider, threads, is_ours)
        return model


def open_committed(name: str, provider: str = "cpu", threads: int = 1) -> OnnxModel:
    """As `open_model`, for a network that comes with the library.

    Parameters
    ----------
    name : str
        File in `data/weights`.
    provider : str
    threads : int

    Examples
    --------
    >>> open_committed("movenet-lightning.onnx").inputs[0].shape
    (1, 3, 192, 192)
    """
    return _opened(load(name), find(name).path, provider, threads, is_ours=True)


def _text(shape: Sequence[int | None]) -> str:
    return f"({', '.join('?' if size is None else str(size) for size in shape)})"


def _port(node: Any) -> Port:
    shape = tuple(size if isinstance(size, int) and size > 0 else None for size in node.shape or ())
    return Port(node.name, shape, node.type)
