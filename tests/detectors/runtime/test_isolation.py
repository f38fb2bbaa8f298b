"""A native library in its own process: the caller is as before, whatever happens there."""

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import psutil
import pytest

from hicp_lib.detectors.registry import default_detector_names, make_detector
from hicp_lib.detectors.runtime import isolation
from hicp_lib.detectors.runtime.isolation import IsolatedProcess, IsolationError

IMAGE = np.zeros((40, 50, 3), np.uint8)


def own_process(detector) -> psutil.Process:
    return psutil.Process(detector._process._child._process.pid)


def wait_until(happened, within_s: float = 30.0) -> None:
    end_s = time.monotonic() + within_s
    while not happened():
        assert time.monotonic() < end_s
        time.sleep(0.01)


@pytest.fixture
def program(tmp_path):
    """A function that gives a process running a few lines, with the first message read if `is_ready`."""

    def make(lines: str, is_ready: bool = True) -> IsolatedProcess:
        path = tmp_path / "program.py"
        head = "import os, signal, sys, time\nfrom hicp_lib.detectors.mediapipe.child import receive, send\n"
        head += "from multiprocessing.connection import Connection\npipe = Connection(int(sys.argv[-1]))\n"
        head += "receive(pipe); send(pipe, {}); receive(pipe)\n" if is_ready else ""
        path.write_text(head + textwrap.dedent(lines))
        return IsolatedProcess([str(path)], {}, b"", "a.task", "give another file")

    return make


def told(process: IsolatedProcess) -> str:
    with pytest.raises(IsolationError) as error:
        process.ask(IMAGE)
    assert "\n" not in str(error.value) and str(error.value).startswith("a.task: ")
    return str(error.value)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGABRT, signal.SIGSEGV])
def test_the_caller_survives_and_the_next_call_starts_another(weights, photograph, number):
    detector = make_detector("mediapipe-pose")
    before = detector.detect(photograph)
    first = own_process(detector)
    first.send_signal(number)
    with pytest.raises(IsolationError, match=rf"^mediapipe-pose: .*{number.name}.*; run it again"):
        detector.detect(photograph)
    assert not first.is_running()
    assert np.array_equal(detector.detect(photograph).scores, before.scores)
    assert own_process(detector).pid != first.pid


def test_it_may_die_in_the_middle_of_a_call(weights, photograph):
    detector = make_detector("mediapipe-pose")
    detector.start()
    child = own_process(detector)
    child.suspend()
    thread = threading.Timer(0.2, child.kill)
    thread.start()
    with pytest.raises(IsolationError, match="SIGKILL, which often means that memory ran out"):
        detector.detect(photograph)
    thread.join()


def test_what_it_wrote_last_is_told_but_no_trace_of_the_stack(program):
    said = "W0 ready\\nF0000 a.cc:1] Check failed: b\\n*** Check failure stack trace: ***\\n    @ 0x1 main\\n"
    line = told(program(f"os.write(2, b'{said}'); os.abort()"))
    assert line.partition("; ")[0] == (
        "a.task: its process was ended by SIGABRT (F0000 a.cc:1] Check failed: b)"
    )


def test_one_that_cannot_start_says_why(program):
    assert "code 3" in told(program("sys.exit(3)", is_ready=False))
    line = told(program("import nothing_of_that_name", is_ready=False))
    assert line.endswith("No module named 'nothing_of_that_name'); give another file")
    refuses = program("receive(pipe); send(pipe, {'error': 'no such model'})", is_ready=False)
    assert told(refuses) == told(refuses) == "a.task: no such model; give another file"


def test_one_that_hangs_is_ended(weights, monkeypatch):
    monkeypatch.setattr(isolation, "LIMIT_S", 0.02)  # less than it takes to start
    with pytest.raises(IsolationError, match=r"^mediapipe-hands: its process gave no answer within 0\.02 s;"):
        make_detector("mediapipe-hands").detect(IMAGE)


def test_after_an_interrupted_wait_no_answer_is_taken_for_anothers(weights, photograph):
    detector = make_detector("mediapipe-pose")
    expected = detector.detect(photograph[:300])
    own_process(detector).suspend()
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        with pytest.raises(KeyboardInterrupt):
            detector.detect(photograph)
    finally:
        signal.signal(signal.SIGALRM, before)
    assert np.array_equal(detector.detect(photograph[:300]).scores, expected.scores)


def test_nothing_is_imported_from_the_working_folder(weights, tmp_path, monkeypatch):
    for name in ("json", "numpy", "mediapipe"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('imported')\n")
    monkeypatch.chdir(tmp_path)
    assert len(make_detector("mediapipe-hands").detect(IMAGE)) == 0


def run_script(script: str, *arguments: str, **streams) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, "-c", script, *arguments], text=True, **streams)


_LEFT_ALONE = """
import gc, locale, multiprocessing, os, random, signal, sys, threading, warnings
import cv2, numpy as np, psutil
from hicp_lib.detectors.registry import make_detector

def state():
    me = psutil.Process()
    return {
        "environment": dict(os.environ),
        "descriptors": {fd: os.readlink(f"/proc/self/fd/{fd}") for fd in os.listdir("/proc/self/fd")
                        if os.path.exists(f"/proc/self/fd/{fd}")},
        "handlers": [signal.getsignal(number) for number in signal.valid_signals()],
        "blocked": signal.pthread_sigmask(signal.SIG_BLOCK, ()),
        "mask": [line for line in open("/proc/self/status") if line.startswith("Umask")],
        "locale": locale.setlocale(locale.LC_ALL), "folder": os.getcwd(), "path": list(sys.path),
        "streams": (id(sys.stdin), id(sys.stdout), id(sys.stderr)), "filters": list(warnings.filters),
        "numpy": (np.geterr(), np.get_printoptions()), "opencv": cv2.getNumThreads(),
        "chance": (random.getstate(), str(np.random.get_state())), "hook": sys.excepthook,
        "start": multiprocessing.get_start_method(allow_none=True),
        "processes": [child.pid for child in me.children(recursive=True)],
    }

name = sys.argv[1]
make_detector(name)  # imports what it needs
before = state()
detector = make_detector(name)
image = np.zeros((60, 70, 3), np.uint8)
threads = [threading.Thread(target=detector.detect, args=(image,)) for _ in range(2)]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
assert {**state(), "descriptors": 0, "processes": 0} == {**before, "descriptors": 0, "processes": 0}
del detector, threads
gc.collect()
after = state()
print({key: (before[key], after[key]) for key in before if before[key] != after[key]})
print("mediapipe" in sys.modules)
"""


@pytest.mark.skipif(not os.path.exists("/proc/self/fd"), reason="no list of this process's descriptors")
@pytest.mark.parametrize("name", default_detector_names())
def test_the_caller_is_as_before(weights, name):
    run = run_script(_LEFT_ALONE, name, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert run.communicate() == ("{}\nFalse\n", "")


_IN_PROCESS = """
import sys, numpy as np, mediapipe
from mediapipe.tasks.python import BaseOptions, vision
from hicp_lib.detectors.mediapipe import bundles
images = np.load(sys.argv[1])
options = {"base_options": BaseOptions(model_asset_buffer=bundles.assemble("pose"))}
pose = vision.PoseLandmarker.create_from_options(vision.PoseLandmarkerOptions(**options))
options = {"base_options": BaseOptions(model_asset_buffer=bundles.assemble("hand")), "num_hands": 2}
hand = vision.HandLandmarker.create_from_options(vision.HandLandmarkerOptions(**options))
rows = {}
for name in images:
    image = mediapipe.Image(image_format=mediapipe.ImageFormat.SRGB, data=images[name])
    bodies, hands = pose.detect(image).pose_landmarks, hand.detect(image)
    rows["pose" + name] = [[(p.x, p.y, p.visibility) for p in body] for body in bodies]
    rows["hands" + name] = [[(p.x, p.y) for p in points] for points in hands.hand_landmarks]
    labels = [sides[0] for sides in hands.handedness]
    rows["sides" + name] = [(("Left", "Right").index(label.category_name), label.score) for label in labels]
np.savez(sys.argv[2], **rows)
"""


def test_answers_are_those_of_the_library_to_the_bit(weights, people, tmp_path):
    np.savez(tmp_path / "images.npz", **{str(i): image for i, (image, _) in enumerate(people)})
    run = run_script(
        _IN_PROCESS, str(tmp_path / "images.npz"), str(tmp_path / "rows.npz"), stderr=subprocess.DEVNULL
    )
    pose, hands = make_detector("mediapipe-pose")._process, make_detector("mediapipe-hands")._process
    bodies, pairs = [[process.ask(image) for image, _ in people] for process in (pose, hands)]
    assert run.wait() == 0
    with np.load(tmp_path / "rows.npz") as rows:
        for i in range(len(people)):
            assert np.array_equal(bodies[i], rows[f"pose{i}"].reshape(-1, 33, 3))
            assert np.array_equal(pairs[i][:, 1:], rows[f"hands{i}"].reshape(-1, 21, 2))
            assert np.array_equal(pairs[i][:, 0], rows[f"sides{i}"].reshape(-1, 2))
    assert sum(map(len, pairs)) >= len(people) and sum(map(len, bodies)) == len(people)


_KILLED = """
import os, time, numpy as np
from hicp_lib.detectors.registry import make_detector
detector = make_detector("mediapipe-hands")
detector.start()
print(detector._process._child._process.pid, flush=True)
time.sleep(600)
"""


def test_it_ends_with_a_caller_that_was_killed(weights):
    with run_script(_KILLED, stdout=subprocess.PIPE) as caller:
        child = psutil.Process(int(caller.stdout.readline()))
        assert child.is_running()
        caller.kill()
    wait_until(lambda: not child.is_running() or child.status() == psutil.STATUS_ZOMBIE)


_FORKED = """
import os, sys, numpy as np
from hicp_lib.detectors.registry import make_detector
detector, image = make_detector("mediapipe-hands"), np.zeros((60, 70, 3), np.uint8)
detector.detect(image)
pid = os.fork()
found = detector.detect(image)
if pid == 0:
    sys.exit(len(found))
print(os.waitpid(pid, 0)[1], len(detector.detect(image)))
"""


def test_a_forked_copy_has_a_process_of_its_own(weights):
    run = run_script(_FORKED, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert run.communicate() == ("0 0\n", "")


_ONNX = """
import os, sys
if sys.argv[1:]:
    import onnxruntime
import numpy as np
from hicp_lib.detectors.registry import make_detector
make_detector("openpose-mobilenet").detect(np.zeros((60, 70, 3), np.uint8))
print("ORT_DISABLE_TELEMETRY" in os.environ)
"""


@pytest.mark.parametrize("loaded_before", [(), ("plainly",)])
def test_onnx_runtime_tells_its_vendor_nothing(weights, tmp_path, monkeypatch, loaded_before):
    """What it would send lies in the user's cache folder, by an identifier; the second run is a control."""
    for name in ("CI", "ORT_DISABLE_TELEMETRY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HICP_CACHE", str(weights.parent))
    monkeypatch.setenv("https_proxy", "http://127.0.0.1:9")
    for name in ("HOME", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, str(tmp_path))
    run = run_script(_ONNX, *loaded_before, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert run.communicate() == ("False\n", "")
    assert any(path.name == "deviceid" for path in tmp_path.rglob("*")) == bool(loaded_before)


def test_an_image_that_ends_the_process_is_named(own_cache, photograph, tmp_path, monkeypatch):
    from hicp_lib.core.images import write_png
    from hicp_lib.detectors.runtime import run

    write_png(tmp_path / "a.png", photograph)
    monkeypatch.setattr(isolation, "LIMIT_S", 0.02)
    with pytest.raises(IsolationError, match=r"^.*a\.png: mediapipe-hands: its process gave no answer"):
        run.detect_images("mediapipe-hands", {0: tmp_path / "a.png"}, progress=False)
