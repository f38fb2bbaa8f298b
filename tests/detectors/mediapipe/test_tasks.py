"""MediaPipe: landmarks where they belong, sides that are the person's own, silence."""

import io
import os
import resource
import subprocess
import sys
import zipfile
from socketserver import StreamRequestHandler, ThreadingTCPServer
from threading import Thread

import numpy as np
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import INDEX, LEFT_HAND, N_KEYPOINTS, RIGHT_HAND
from hicp_lib.detectors.registry import make_detector
from hicp_lib.detectors.runtime.isolation import offline_environment
from hicp_lib.detectors.runtime.results import Runner
from tests.detectors.conftest import N_PEOPLE


def hand_errors(positions_px: np.ndarray, truth_px: np.ndarray) -> tuple[float, float]:
    """Mean distance of 21 points to the true left and to the true right hand."""
    return tuple(
        np.linalg.norm(positions_px - truth_px[hand], axis=1).mean() for hand in (LEFT_HAND, RIGHT_HAND)
    )


def test_pose_finds_rendered_people_to_a_few_pixels(weights, people):
    detector = make_detector("mediapipe-pose")
    for image, truth_px in people:
        found = detector.detect(image)
        assert len(found) == 1
        errors = np.linalg.norm(found.keypoints_px[0, :13] - truth_px[:13], axis=1)
        assert np.median(errors) < 12
        # A swap of sides would be off by the width of the shoulders.
        assert errors[[5, 6]].max() < 0.3 * np.linalg.norm(truth_px[5] - truth_px[6])


def test_pose_gives_halpe_points_it_has_and_no_others(weights, people):
    found = make_detector("mediapipe-pose").detect(people[0][0])
    given = np.isfinite(found.keypoints_px[0]).all(axis=1)
    feet = [INDEX[f"{side}_{part}"] for side in ("left", "right") for part in ("big_toe", "heel")]
    assert set(np.flatnonzero(given)) == {*range(17), *feet}
    assert (found.scores[0, ~given] == 0).all()
    assert ((found.scores >= 0) & (found.scores <= 1)).all()
    assert found.person_scores[0] == pytest.approx(found.scores[0, :17].mean())


def test_points_outside_the_image_are_kept(weights, people):
    image, truth_px = people[0]
    cut = int(truth_px[[11, 12], 1].mean()) - 20
    found = make_detector("mediapipe-pose").detect(image[:cut])
    assert found.keypoints_px[0, INDEX["left_knee"], 1] > cut
    assert found.scores[0, INDEX["left_knee"]] < 0.5 < found.scores[0, INDEX["left_shoulder"]]


def test_hands_are_labelled_with_the_persons_own_side(weights, people):
    """The truth is the body model's; single labels err, most do not."""
    detector = make_detector("mediapipe-hands")
    own, other = 0, 0
    for image, truth_px in people:
        found = detector.detect(image)
        for row in range(len(found)):
            for side, indices in enumerate((LEFT_HAND, RIGHT_HAND)):
                if found.scores[row, indices[0]] > 0:
                    errors = hand_errors(found.keypoints_px[row, indices], truth_px)
                    assert min(errors) < 12
                    own += errors[side] < errors[1 - side]
                    other += errors[side] > errors[1 - side]
    assert own + other >= N_PEOPLE
    assert own >= 2 * other


def test_pose_and_hands_together_get_every_side_right(weights, people):
    detector = make_detector("mediapipe")
    n_hands = 0
    for image, truth_px in people:
        found = detector.detect(image)
        assert len(found) == 1
        for side, indices in enumerate((LEFT_HAND, RIGHT_HAND)):
            if found.scores[0, indices[0]] > 0:
                n_hands += 1
                errors = hand_errors(found.keypoints_px[0, indices], truth_px)
                assert errors[side] < errors[1 - side]
    assert n_hands >= N_PEOPLE


def make_body(left_wrist, right_wrist) -> Detections:
    keypoints_px, scores = np.full((1, N_KEYPOINTS, 2), np.nan), np.zeros((1, N_KEYPOINTS))
    keypoints_px[0, [9, 10]], scores[0, [9, 10]] = (left_wrist, right_wrist), 0.9
    return Detections(keypoints_px, scores, np.array([0.7]))


def make_hands(*hands) -> Detections:
    """One instance per hand (side, score, root)."""
    keypoints_px = np.full((len(hands), N_KEYPOINTS, 2), np.nan)
    scores = np.zeros((len(hands), N_KEYPOINTS))
    for row, (side, score, root) in enumerate(hands):
        keypoints_px[row, side], scores[row, side] = np.add(root, np.arange(21)[:, None]), score
    return Detections(keypoints_px, scores, scores.max(axis=1))


def test_a_hand_goes_to_the_nearest_free_wrist_and_the_rest_stand_alone(weights):
    from hicp_lib.detectors.mediapipe.tasks import attach_hands

    body = make_body((300, 100), (100, 100))
    hands = make_hands((RIGHT_HAND, 0.9, (290, 100)), (LEFT_HAND, 0.8, (285, 100)), (LEFT_HAND, 0.6, (0, 0)))
    found = attach_hands(body, hands)
    assert found.keypoints_px[0, LEFT_HAND[0]].tolist() == [290, 100]
    assert found.keypoints_px[0, RIGHT_HAND[0]].tolist() == [285, 100]
    assert found.keypoints_px[1, LEFT_HAND[0]].tolist() == [0, 0]
    assert found.person_scores == pytest.approx([0.7, 0.6])
    assert np.isnan(body.keypoints_px[0, LEFT_HAND]).all()
    alone = attach_hands(Detections.none(), hands)
    assert alone.person_scores == pytest.approx([0.85, 0.6])
    assert alone.keypoints_px[:, LEFT_HAND[0], 0].tolist() == [285, 0]
    assert np.isnan(alone.keypoints_px[1, RIGHT_HAND]).all()


def test_a_photograph(weights, photograph):
    """A portrait in uniform, facing the camera: the face in the upper half, his left on the right."""
    found = make_detector("mediapipe-pose").detect(photograph)
    nose, left_eye, right_eye, left_shoulder, right_shoulder = found.keypoints_px[0, [0, 1, 2, 5, 6]]
    assert np.linalg.norm(nose - (270, 225)) < 20
    assert left_eye[0] - right_eye[0] == pytest.approx(75, abs=15)
    assert left_shoulder[0] - right_shoulder[0] == pytest.approx(360, abs=50)


def test_on_a_video_the_person_is_looked_for_where_they_were(weights, photograph):
    still, video = make_detector("mediapipe"), make_detector("mediapipe", tracking_hz=10.0)
    one, two = still.detect(photograph), video.detect(photograph)
    assert np.array_equal(one.keypoints_px, two.keypoints_px, equal_nan=True)
    headless = photograph.copy()
    headless[: int(one.keypoints_px[0, [5, 6], 1].max()) + 10] = 127
    assert len(still.detect(headless)) == 0 and len(video.detect(headless)) == 1
    assert len(video.detect(np.full_like(photograph, 127))) == 0
    assert len(video.detect(headless)) == 0  # once lost, looked for as in a still image


def test_what_tracks_is_another_detector_and_not_run_over_sets_of_images(weights):
    still, video = (
        make_detector("mediapipe-hands", **options).settings for options in ({}, {"tracking_hz": 5.0})
    )
    assert video == still | {"tracking_hz": 5.0}
    for name in ("mediapipe-pose", "mediapipe", "combined:mediapipe-pose+mediapipe-hands"):
        with pytest.raises(InputError, match="tracking_hz is for a video"):
            Runner(make_detector(name, tracking_hz=5.0), 1)


def test_an_empty_image_has_nobody(weights):
    for name in ("mediapipe-pose", "mediapipe-hands", "mediapipe"):
        found = make_detector(name).detect(np.full((90, 50, 3), 128, np.uint8))
        assert found.keypoints_px.shape == (0, N_KEYPOINTS, 2)
        assert found.scores.shape == (0, N_KEYPOINTS) and found.person_scores.shape == (0,)


def test_bundles_are_equal_every_time_and_a_bundle_can_be_given(weights, tmp_path, photograph):
    from hicp_lib.detectors.mediapipe import bundles

    bundle = bundles.assemble("pose")
    bundles._with_scaling.cache_clear()
    assert bundles.assemble("pose") == bundle
    path = tmp_path / "pose.task"
    path.write_bytes(bundle)
    given, own = make_detector("mediapipe-pose", model=path), make_detector("mediapipe-pose")
    assert given.settings == own.settings
    assert np.array_equal(
        given.detect(photograph).keypoints_px, own.detect(photograph).keypoints_px, equal_nan=True
    )


def test_every_model_declares_once_how_pixels_are_scaled(weights):
    """The pose detector takes [-1, 1], the others [0, 1], as MediaPipe's own graphs feed them."""
    from hicp_lib.detectors.mediapipe import bundles

    generated = "tasks/metadata/{}schema_py_generated.py"
    tflite, metadata = (bundles._of_mediapipe(generated.format(kind)) for kind in ("", "metadata_"))
    ranges = {}
    for task in ("pose", "hand"):
        with zipfile.ZipFile(io.BytesIO(bundles.assemble(task))) as bundle:
            models = {
                name: tflite.ModelT.InitFromPackedBuf(bundle.read(name), 0) for name in bundle.namelist()
            }
        for name, model in models.items():
            (entry,) = (row for row in model.metadata if row.name == b"TFLITE_METADATA")
            declared = metadata.ModelMetadataT.InitFromPackedBuf(bytes(model.buffers[entry.buffer].data), 0)
            options = declared.subgraphMetadata[0].inputTensorMetadata[0].processUnits[0].options
            ranges[name] = {
                ((0 - m) / s, (255 - m) / s) for m, s in zip(options.mean, options.std, strict=True)
            }
    assert ranges == {
        "pose_detector.tflite": {(-1, 1)},
        "pose_landmarks_detector.tflite": {(0, 1)},
        "hand_detector.tflite": {(0, 1)},
        "hand_landmarks_detector.tflite": {(0, 1)},
    }


def test_a_file_that_is_no_bundle_is_refused(tmp_path):
    path = tmp_path / "hand.task"
    path.write_bytes(b"no zip")
    with pytest.raises(InputError, match=r"hand\.task: is not a MediaPipe \.task bundle"):
        make_detector("mediapipe-hands", model=path)
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as file:
        file.writestr("pose_detector.tflite", b"")
    path.write_bytes(content.getvalue())
    with pytest.raises(InputError, match=r"has no hand_detector\.tflite; give the \.task file of the hand"):
        make_detector("mediapipe-hands", model=path)


def test_damaged_members_are_told_at_once(weights, tmp_path):
    path = tmp_path / "hand.task"
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as file:
        for member in ("hand_detector.tflite", "hand_landmarks_detector.tflite"):
            file.writestr(member, bytes(4) + b"TFL3" + bytes(1000))
    path.write_bytes(content.getvalue())
    with pytest.raises(InputError, match=r"hand\.task: cannot be used by .*; give another \.task") as told:
        make_detector("mediapipe-hands", model=path)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("damage", ["compressed", "cut", "overwritten", "no end"])
def test_a_bundle_whose_members_are_not_there_whole_is_refused_before_a_process_starts(
    weights, tmp_path, damage, monkeypatch
):
    from hicp_lib.detectors.mediapipe import bundles

    path, content = tmp_path / "pose.task", bytearray(bundles.assemble("pose"))
    if damage == "compressed":
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as bundle:
            for member in bundles.BUNDLES["pose"]:
                bundle.writestr(member, bytes(10_000_000))
        content = packed.getvalue()
    elif damage == "cut":
        content = content[: len(content) // 2]
    elif damage == "overwritten":
        content[5000:5010] = bytes(10)
    else:
        content[-200:-100] = b"\xff" * 100
    path.write_bytes(content)
    monkeypatch.setattr(subprocess, "Popen", None)
    with pytest.raises(InputError, match=r"pose\.task: (is not a|has no).*; give") as told:
        make_detector("mediapipe-pose", model=path)
    assert "\n" not in str(told.value)


def test_a_model_that_asks_for_all_memory_is_refused(weights, tmp_path, monkeypatch):
    """Its images ten times as wide and high as they are: 18 GB, were there no limit."""
    from hicp_lib.detectors.mediapipe import bundles

    schema = bundles._of_mediapipe("tasks/metadata/schema_py_generated.py")
    path, utilities = (
        tmp_path / "pose.task",
        "tasks/python/metadata/metadata_writers/model_asset_bundle_utils.py",
    )
    with (
        zipfile.ZipFile(io.BytesIO(bundles.assemble("pose"))) as bundle,
        bundles._of_mediapipe(utilities).AlignZipFile(path, mode="w", alignment=4) as changed,
    ):
        for member in bundle.namelist():
            model = schema.ModelT.InitFromPackedBuf(bundle.read(member), 0)
            for tensor in model.subgraphs[0].tensors:
                is_constant = np.size(model.buffers[tensor.buffer].data) > 1
                if tensor.shape is not None and len(tensor.shape) == 4 and not is_constant:
                    sides = [10 * int(side) for side in tensor.shape[1:3]]
                    tensor.shape = [int(tensor.shape[0]), *sides, int(tensor.shape[3])]
            changed.writestr(zipfile.ZipInfo(member), bundles._pack(model, b"TFL3"))
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with pytest.raises(InputError, match=r"pose\.task: cannot be used by mediapipe-pose: .*; give another"):
        make_detector("mediapipe-pose", model=path)
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert spent.ru_utime - before.ru_utime < 5


@pytest.mark.parametrize(
    "image", [np.zeros((9, 9), np.uint8), np.zeros((9, 9, 3)), np.zeros((0, 9, 3), np.uint8)]
)
def test_what_is_no_image_is_refused(weights, image):
    with pytest.raises(InputError, match=r"expected uint8 \(height, width, 3\)"):
        make_detector("mediapipe-hands").detect(image)


def test_a_damaged_weight_is_refused(own_cache):
    path = own_cache / "weights" / "palm_detection_full.tflite"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 16
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"palm_detection_full\.tflite.*damaged"):
        make_detector("mediapipe-hands")
    assert make_detector("mediapipe-pose").settings["num_poses"] == 1


class _Recorder(StreamRequestHandler):
    """A proxy that notes what it is asked for and refuses."""

    def handle(self) -> None:
        self.server.requests.append(self.rfile.readline().decode())
        self.wfile.write(b"HTTP/1.1 403 Forbidden\r\n\r\n")


@pytest.fixture
def proxy():
    with ThreadingTCPServer(("127.0.0.1", 0), _Recorder) as server:
        server.requests = []
        thread = Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield server
        server.shutdown()


_RUN = """
import time, numpy as np
from hicp_lib.detectors.registry import make_detector
detector = make_detector("mediapipe-hands")
detector.detect(np.zeros((50, 50, 3), np.uint8))
del detector
time.sleep(1)
"""
# What the library's own process does, and then what it never does: close the task.
_CLOSE = """
import time
from hicp_lib.detectors.mediapipe import bundles, child
task = child.landmarker(bundles.assemble("hand"), "hand", 2, 0.5)
task.close()
time.sleep(1)
"""


@pytest.fixture
def behind(proxy, monkeypatch):
    """An environment in which all goes through the proxy."""
    monkeypatch.setenv("https_proxy", f"http://127.0.0.1:{proxy.server_address[1]}")
    for name in ("no_proxy", "NO_PROXY"):
        monkeypatch.setenv(name, "")
    return proxy


def run_script(script: str, environment: dict | None = None) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True)


def test_mediapipe_says_nothing_and_contacts_nobody(weights, behind):
    run = run_script(_RUN)
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")
    assert behind.requests == []


def test_it_would_send_metrics_but_for_its_process_environment(weights, behind):
    assert run_script(_CLOSE).returncode == 0
    assert any(request.startswith("CONNECT") for request in behind.requests)
    behind.requests.clear()
    assert run_script(_CLOSE, offline_environment()).returncode == 0
    assert behind.requests == []


def test_no_exception_from_the_proxy_lets_it_out(monkeypatch):
    from urllib.request import getproxies_environment, proxy_bypass_environment

    for name, value in {"https_proxy": "http://gate:3128", "no_proxy": "*", "NO_PROXY": "*"}.items():
        monkeypatch.setenv(name, value)
    environment = offline_environment()
    assert os.environ["https_proxy"] == "http://gate:3128"
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert getproxies_environment()["https"] == "http://127.0.0.1:9"
    assert not proxy_bypass_environment("metrics.example.com")
