"""The program of MediaPipe's separate process: sets up one task, then returns a result for every image.

It is run by its path and imports nothing of this package, so that it starts quickly in any environment.
Messages go through a socket whose descriptor is the last argument: a head in JSON, a body of plain bytes. The
first head contains the task's options, and its body is the bundle; every other head contains the `shape` of
the RGB image in shared memory, a file whose descriptor is the argument before (through a pipe a call would
take a tenth longer). Results are arrays of float64 (`shape`) or an `error` in one line.
"""

import itertools
import json
import mmap
import os
import signal
import sys
from collections.abc import Callable
from importlib import import_module
from multiprocessing.connection import Connection
from types import ModuleType
from typing import Any

import numpy as np

N_POSE, N_HAND = 33, 21
_SIDES = {"Left": 0.0, "Right": 1.0}
_VISION = "mediapipe.tasks.python.vision"


def send(pipe: Connection, head: dict, body: bytes = b"") -> None:
    """Write one message.

    Parameters
    ----------
    pipe : Connection
    head : dict
        JSON-able.
    body : bytes

    Examples
    --------
    >>> from multiprocessing import Pipe
    >>> one, other = Pipe()
    >>> send(one, {"shape": [1, 2]}, b"ab")
    >>> receive(other)
    ({'shape': [1, 2]}, b'ab')
    """
    pipe.send_bytes(json.dumps(head).encode())
    pipe.send_bytes(body)


def receive(pipe: Connection) -> tuple[dict, bytes]:
    """Read one message.

    Raises
    ------
    EOFError or OSError
        If the other side is gone.
    """
    return json.loads(pipe.recv_bytes()), pipe.recv_bytes()


def _serve(pipe: Connection, folder: str, shared: int) -> None:
    head, bundle = receive(pipe)
    # If the library hangs, the system ends this process, even if the caller is gone.
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGALRM])
    limit_s = head.pop("limit_s")
    signal.setitimer(signal.ITIMER_REAL, limit_s)
    _leave_out(folder, "mediapipe", "mediapipe.tasks.python", _VISION)
    detect = detection(bundle, **head)
    signal.setitimer(signal.ITIMER_REAL, 0)
    send(pipe, {})
    pixels: bytes | mmap.mmap = b""
    while True:
        shape = receive(pipe)[0]["shape"]
        signal.setitimer(signal.ITIMER_REAL, limit_s)
        try:
            if np.prod(shape) > len(pixels):
                pixels = mmap.mmap(shared, 0, access=mmap.ACCESS_READ)
            found = detect(np.ndarray(shape, np.uint8, pixels))
            head, body = {"shape": found.shape}, found.tobytes()
        except (ValueError, RuntimeError) as error:
            head, body = {"error": _one_line(error)}, b""
        signal.setitimer(signal.ITIMER_REAL, 0)
        send(pipe, head, body)


def detection(
    bundle: bytes, task: str, tracking_hz: float = 0.0, **options: Any
) -> Callable[[np.ndarray], np.ndarray]:
    """A function from an image to the result of `_poses` or `_hands`.

    Parameters
    ----------
    bundle : bytes
    task : {"pose", "hand"}
    tracking_hz : float, optional
        Above 0, images are those of a video of this rate, and detections are tracked from one to the next.
    **options : object
        As of `landmarker`.

    Returns
    -------
    callable
    """
    ready = landmarker(bundle, task, follows=tracking_hz > 0, **options)
    pixels = import_module(f"{_VISION}.core.image")
    rows = {"pose": _poses, "hand": _hands}[task]
    times_ms = (round(1e3 * k / tracking_hz) for k in itertools.count())
    look = (lambda image: ready.detect_for_video(image, next(times_ms))) if tracking_hz else ready.detect
    return lambda image: rows(look(pixels.Image(pixels.ImageFormat.SRGB, image)))


def landmarker(bundle: bytes, task: str, n: int, min_score: float, follows: bool = False) -> Any:
    """MediaPipe's task, ready.

    Parameters
    ----------
    bundle : bytes
    task : {"pose", "hand"}
    n : int
        Maximum number of people, or hands.
    min_score : float
        Threshold of the detector, of the presence check and of the tracking.
    follows : bool, optional
        Whether images are those of a video. If not, each is processed independently.
    """
    base_options = import_module("mediapipe.tasks.python.core.base_options")
    module = import_module(f"{_VISION}.{task}_landmarker")
    kind = task.capitalize()
    options = getattr(module, f"{kind}LandmarkerOptions")(
        base_options=base_options.BaseOptions(model_asset_buffer=bundle),
        **{f"num_{task}s": n},
        **{f"min_{task}_{step}_confidence": min_score for step in ("detection", "presence")},
    )
    if follows:
        options.running_mode = type(options.running_mode).VIDEO
        options.min_tracking_confidence = min_score
    return getattr(module, f"{kind}Landmarker").create_from_options(options)


def _leave_out(folder: str, *packages: str) -> None:
    """Replace some of MediaPipe's own packages, which load Matplotlib, audio and more, by empty ones."""
    for name in packages:
        package = ModuleType(name)
        package.__path__ = [os.path.join(folder, *name.split("."))]
        sys.modules[name] = package


def _poses(result: Any) -> np.ndarray:
    """Array, shape (n, 33, 3): x and y as fractions of the image, visibility."""
    people = [[(p.x, p.y, p.visibility) for p in person] for person in result.pose_landmarks]
    return np.array(people, float).reshape(-1, N_POSE, 3)


def _hands(result: Any) -> np.ndarray:
    """Array, shape (n, 1 + 21, 2): side (0 left, 1 right) and score, then x and y as fractions."""
    hands = [
        [(_SIDES[sides[0].category_name], sides[0].score), *((p.x, p.y) for p in hand)]
        for hand, sides in zip(result.hand_landmarks, result.handedness, strict=True)
    ]
    return np.array(hands, float).reshape(-1, 1 + N_HAND, 2)


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _main() -> None:
    folder, shared, socket = sys.argv[1], *map(int, sys.argv[2:])
    pipe = Connection(socket)
    sys.path.append(folder)  # where MediaPipe is
    try:
        _serve(pipe, folder, shared)
    except EOFError:
        pass
    except Exception as error:  # a broken library may raise anything
        send(pipe, {"error": _one_line(error)})
    # Do not close the task: that would send usage metrics, and takes time.
    os._exit(0)


if __name__ == "__main__":
    _main()
