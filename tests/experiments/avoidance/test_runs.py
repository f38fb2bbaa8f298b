"""Runs are kept with what was seen in them, and read back instead of simulated again."""

import time

import numpy as np
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.experiments.avoidance import head_camera
from hicp_lib.experiments.avoidance import runs as avoidance_runs
from hicp_lib.experiments.avoidance.closed_loop import Latency, Trial
from hicp_lib.experiments.avoidance.error_model import GROUPS
from hicp_lib.experiments.avoidance.reaching import LOOKED_AT_S, Moment
from hicp_lib.experiments.avoidance.runs import (
    PUBLISHED_GAINS,
    TRACKING,
    Job,
    choose,
    image,
    keypoints_m,
    moment_at,
    run_all,
)
from hicp_lib.experiments.laboratory import in_root
from hicp_lib.robot.controller import PUBLISHED
from hicp_lib.simulation.body.identities import Subject

TRIAL = Trial("sitting, head", LOOKED_AT_S[0] + 0.14, camera_hz=10.0)
LATE = Latency(inference_s=0.02)


class TwoPeople:
    """A detector that always finds the same two people."""

    settings = {"name": "two people"}

    def __init__(self):
        self.found = Detections(
            np.random.default_rng(0).uniform(20, 460, (2, N_KEYPOINTS, 2)),
            np.linspace(0, 1, 2 * N_KEYPOINTS).reshape(2, -1),
            np.ones(2),
        )

    def detect(self, rgb):
        return self.found


@pytest.fixture
def detector(monkeypatch, tmp_path):
    found = TwoPeople()
    picture = np.full((480, 640, 3), (40, 90, 160), np.uint8), np.full((480, 640), 3.0, np.float32)
    monkeypatch.setenv("HICP_CACHE", str(tmp_path))
    monkeypatch.setattr(avoidance_runs, "_detector", lambda name: found)
    monkeypatch.setattr(head_camera, "photograph", lambda *_: picture)
    return found


def test_what_was_seen_is_kept_as_it_was(detector, monkeypatch):
    (run,) = run_all([Job(TRIAL, "two people", LATE)])
    assert run.frames["t_s"].tolist() == pytest.approx([1.2, 1.3]) and len(run.cycles) == 9
    frame = run.frames.iloc[1]
    points, scores, truth = keypoints_m(frame)
    assert points.shape == (2, N_KEYPOINTS, 3)
    np.testing.assert_allclose(scores, detector.found.scores, atol=1e-6)
    person_m = in_root(Moment("sitting, head", Subject(), 1.3).person.keypoints_m)
    np.testing.assert_allclose(truth, person_m, atol=1e-6)
    np.testing.assert_allclose(in_root(moment_at(run, 1.3).person.keypoints_m), person_m, atol=1e-6)
    assert frame["in_sight"].shape == (len(GROUPS),) and set(frame["in_sight"]) <= {0, 1}
    rgb, seen = image(frame)
    assert rgb.shape == (240, 320, 3) and np.abs(rgb.astype(int) - (40, 90, 160)).max() < 6
    # The picture is half as large, its first pixel's edge where it was.
    np.testing.assert_allclose(2 * seen.keypoints_px + 0.5, detector.found.keypoints_px, atol=1e-4)

    monkeypatch.setattr(avoidance_runs.loop, "simulate", lambda *_: pytest.fail("simulated again"))
    (again,) = run_all([Job(TRIAL, "two people", LATE)])
    assert again.cycles.equals(run.cycles) and again.frames["jpeg"].equals(run.frames["jpeg"])


def test_how_long_a_detector_takes_moves_nothing_but_its_time(detector, monkeypatch, tmp_path):
    (quick,) = run_all([Job(TRIAL, "two people", LATE)])
    monkeypatch.setenv("HICP_CACHE", str(tmp_path / "other"))
    monkeypatch.setattr(detector, "detect", lambda rgb: time.sleep(0.05) or detector.found)
    (slow,) = run_all([Job(TRIAL, "two people", LATE)])
    assert slow.frames["time_ms"].min() >= 50
    assert slow.cycles.equals(quick.cycles)
    columns = [column for column in quick.frames if column != "time_ms"]
    assert slow.frames[columns].map(str).equals(quick.frames[columns].map(str))


def test_tracking_begins_anew_with_every_run_and_at_the_rate_of_its_images(weights):
    still, tracking = (Job(TRIAL, f"mediapipe{how}", Latency(inference_s=0.14)) for how in ("", TRACKING))
    detectors = [avoidance_runs._detector(job) for job in (still, still, tracking, tracking)]
    assert detectors[0] is detectors[1] and detectors[2] is not detectors[3]
    rates_hz = [detector.parts["pose"].settings.get("tracking_hz") for detector in detectors]
    assert rates_hz == [None, None, 5.0, 5.0]  # ten images a second, every other one while it is at work


def test_the_run_to_show_is_that_of_the_script_or_the_first_of_the_condition(detector):
    runs = run_all([Job(TRIAL, "two people", LATE)])
    assert choose(runs, "standing, hand", "two people") is runs[0]
    with pytest.raises(InputError, match="no run of 'mediapipe'"):
        choose(runs, "sitting, head", "mediapipe")


def test_the_end_of_a_condition_says_whose_gains(detector, monkeypatch):
    ours, published = (Job(TRIAL, f"mediapipe{TRACKING}{end}") for end in ("", PUBLISHED_GAINS))
    assert (ours.detector, ours.gains) == ("mediapipe, tracking", "ours")
    assert (published.detector, published.gains) == ("mediapipe, tracking", "published")
    given = []
    simulate = avoidance_runs.loop.simulate
    monkeypatch.setattr(avoidance_runs.loop, "simulate", lambda *of: given.append(of) or simulate(*of))
    for end in ("", PUBLISHED_GAINS):
        run_all([Job(TRIAL, f"two people{end}", LATE)])
    assert [settings for *_, settings in given] == [None, PUBLISHED]
