"""Start ONNX Runtime on a network; on an untrusted one first in a process with limited time and memory.

A network is a program: it can use any amount of memory, or never end, both when it is run and when it is
opened, since constant parts are computed at that time.
"""

from pathlib import Path

import numpy as np

from hicp_lib.core.environment import with_variables
from hicp_lib.core.errors import InputError, one_line
from hicp_lib.core.limited import limited_child

# ONNX Runtime would report every opened model to its vendor, and store an identifier for that in the user's
# cache folder. It reads this variable once, when it is loaded.
with with_variables(ORT_DISABLE_TELEMETRY="1"):
    import onnxruntime

VERSION = onnxruntime.__version__
_LEAST_S = 1.5  # of computing: one image through the smallest network; the fastest take a hundredth
DTYPES = {"tensor(float)": np.float32, "tensor(float16)": np.float16}


def available_providers() -> dict[str, str]:
    """Execution providers of this onnxruntime for local computation, full names by short ones."""
    found = onnxruntime.get_available_providers()
    return {name.removesuffix("ExecutionProvider").lower(): name for name in found if "Azure" not in name}


def start(path: Path, content: bytes, provider: str, threads: int) -> onnxruntime.InferenceSession:
    """A session on a network that is trusted, or was tried out.

    Parameters
    ----------
    path : Path
        For messages.
    content : bytes
    provider : str
        By its short name.
    threads : int

    Raises
    ------
    InputError
        If ONNX Runtime cannot run it, or not on this provider.
    """
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
    options.log_severity_level = 4  # fatal ones only
    # Threads that wait by spinning would take the cores from the other images.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    full_name = available_providers()[provider]
    try:
        session = onnxruntime.InferenceSession(content, options, providers=[full_name])
    except Exception as error:  # ONNX Runtime's errors share no base class of their own
        raise InputError(
            f"{path}: ONNX Runtime cannot run it ({one_line(error)}); export it again, in one file"
        ) from None
    got = session.get_providers()[0]
    if got != full_name:
        raise InputError(
            f"{path}: {provider} was asked for, but its libraries did not load and {got} would run; "
            "install them, or ask for cpu"
        )
    return session


def try_out(path: Path) -> None:
    """Refuse a network that takes more time or memory than allowed for its file's size, or crashes.

    Other faults are not reported here.

    Raises
    ------
    InputError
    """
    limited_child(path, _open_and_run, least_s=_LEAST_S)


def _open_and_run(path: str) -> None:
    try:
        session = start(Path(path), Path(path).read_bytes(), "cpu", 1)
        feed = {port.name: np.zeros(_sizes(port.shape), DTYPES[port.type]) for port in session.get_inputs()}
        session.run(None, feed)
    except Exception as error:
        if "alloc" in str(error):
            raise MemoryError from None


def _sizes(shape: list[int | str | None]) -> list[int]:
    """Shape of a test input: open axes are one image of 256 x 256 pixels."""
    one_image = [1, 3, 256, 256][-len(shape) :]
    sizes = (size if isinstance(size, int) else 0 for size in shape)
    return [size if size > 0 else one for size, one in zip(sizes, one_image, strict=True)]
