"""MediaPipe Pose and Hands (Tasks API, still images) as detectors.

What MediaPipe gives and what is made of it:

- Landmarks are fractions of the image's width and height measured from its border, so a
  landmark at x lies at ``x * width - 0.5`` where pixel centres are integers. Landmarks
  outside the image are kept.
- Pose: the score of a keypoint is its *visibility*, the probability of being inside the image
  and not occluded. (*Presence*, inside the image or not, says less and is not used.) MediaPipe
  returns no score of the person; the mean score of the 17 COCO keypoints stands in.
- Hands: there is no score per keypoint. Every point of a hand carries the hand's handedness
  score, which says how sure the *side* is, not the position. The person score is the mean
  over the hands of the instance.
- Sides: the Tasks API labels hands for images that are not mirrored: "Left" is the person's left
  hand. (The older solutions API means mirrored images, and has it the other way round.) The
  tests hold this against rendered hands, of which about four in five get the true label.
"""

from __future__ import annotations

import weakref
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import mediapipe
import numpy as np
from mediapipe.tasks.python import BaseOptions, vision

from hicp_lib.detectors import mediapipe_bundle
from hicp_lib.detectors.arbitration import Hands, give_hands, in_pairs, nearest_first
from hicp_lib.detectors.base import Detections
from hicp_lib.detectors.native import keep_offline, quiet_stderr
from hicp_lib.files import sha256_bytes
from hicp_lib.keypoints import COCO_17, to_halpe

_SIDES = {"Left": 0, "Right": 1}
_WRISTS = [9, 10]
_N_HAND = 21


class MediaPipePose:
    """MediaPipe Pose Landmarker: 33 landmarks, of which 21 have a Halpe counterpart.

    Parameters
    ----------
    num_poses : most people to return per image; 1, as in the paper, suits crops of one person
    min_score : threshold of MediaPipe's person detector and of its presence check
    model : an official `.task` bundle to use in place of the fetched weights
    """

    name = "mediapipe-pose"

    def __init__(self, num_poses: int = 1, min_score: float = 0.5, model: str | Path | None = None) -> None:
        bundle, identity = _bundle("pose", model)
        self.settings = {"num_poses": num_poses, "min_score": min_score, **identity}
        options = vision.PoseLandmarkerOptions(
            base_options=BaseOptions(model_asset_buffer=bundle),
            num_poses=num_poses,
            min_pose_detection_confidence=min_score,
            min_pose_presence_confidence=min_score,
        )
        self._task = _Task(vision.PoseLandmarker, options)

    def detect(self, image: np.ndarray) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8."""
        people = self._task.detect(image).pose_landmarks
        if not people:
            return Detections.none()
        visibility = np.array([[point.visibility for point in person] for person in people])
        scores = to_halpe(np.clip(visibility, 0, 1), "mediapipe_pose33", axis=-1, fill=0.0)
        positions_px = np.stack([_positions_px(person, image) for person in people])
        keypoints_px = to_halpe(positions_px, "mediapipe_pose33", axis=-2)
        return Detections(keypoints_px, scores, scores[:, COCO_17].mean(axis=1))


class MediaPipeHands:
    """MediaPipe Hand Landmarker: 21 landmarks of each hand.

    One instance holds the best left and the best right hand; further hands pair up in the
    same way, by falling score.

    Parameters
    ----------
    num_hands : most hands to return per image
    min_score : threshold of MediaPipe's palm detector and of its presence check
    model : an official `.task` bundle to use in place of the fetched weights
    """

    name = "mediapipe-hands"

    def __init__(self, num_hands: int = 2, min_score: float = 0.5, model: str | Path | None = None) -> None:
        bundle, identity = _bundle("hand", model)
        self.settings = {"num_hands": num_hands, "min_score": min_score, **identity}
        options = vision.HandLandmarkerOptions(
            base_options=BaseOptions(model_asset_buffer=bundle),
            num_hands=num_hands,
            min_hand_detection_confidence=min_score,
            min_hand_presence_confidence=min_score,
        )
        self._task = _Task(vision.HandLandmarker, options)

    def detect(self, image: np.ndarray) -> Detections:
        """Find hands in an RGB image, shape (height, width, 3), uint8, paired into instances."""
        found = self._task.detect(image)
        if not found.hand_landmarks:
            return Detections.none()
        labels = [sides[0] for sides in found.handedness]
        scores = np.array([[min(label.score, 1.0)] * _N_HAND for label in labels])
        positions_px = np.stack([_positions_px(hand, image) for hand in found.hand_landmarks])
        return in_pairs(
            Hands(positions_px, scores, np.array([_SIDES[label.category_name] for label in labels]))
        )


class MediaPipe:
    """Pose and hands of the whole image as one detector.

    A hand goes to the nearest wrist of a body that has no hand yet, and takes its side from
    there: the body's left and right are far more often correct than the hand's own label
    (on 135 plainly rendered hands with known sides: all against 106). A hand left over becomes
    an instance of its own, sided by its label.

    Parameters
    ----------
    num_people : most people to return per image (and half the number of hands)
    min_score : threshold of both detectors
    side_by_side : look for both at the same time, in two threads: an answer comes sooner where a processor
        is free, which is what a robot waits for
    """

    name = "mediapipe"

    def __init__(self, num_people: int = 1, min_score: float = 0.5, side_by_side: bool = False) -> None:
        self._thread = ThreadPoolExecutor(1) if side_by_side else None
        self.parts = {
            "pose": MediaPipePose(num_people, min_score), "hands": MediaPipeHands(2 * num_people, min_score)
        }  # fmt: skip
        self.settings = {name: part.settings for name, part in self.parts.items()}

    def detect(self, image: np.ndarray) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8."""
        pose, hands = self.parts.values()
        if self._thread is None:
            return attach_hands(pose.detect(image), hands.detect(image))
        found = self._thread.submit(hands.detect, image)
        return attach_hands(pose.detect(image), found.result())


def attach_hands(bodies: Detections, found: Detections) -> Detections:
    """Give each hand found, surest first, to the nearest wrist that has none yet, whatever its label says.

    Returns
    -------
    The bodies with their hands, then instances of the hands that found no free wrist.
    """
    hands = Hands.of(found)
    chosen = nearest_first(bodies.keypoints_px[:, _WRISTS], hands, np.full((len(bodies), 2), -1))
    rest = np.setdiff1d(np.arange(len(hands)), chosen)
    return give_hands(bodies, hands, chosen).and_also(in_pairs(hands.take(rest)))


def _bundle(task: str, model: str | Path | None) -> tuple[bytes, dict]:
    """Bundle bytes, and what identifies them in a detector's settings."""
    bundle = mediapipe_bundle.read_bundle(task, model) if model else mediapipe_bundle.assemble(task)
    return bundle, {"bundle_sha256": sha256_bytes(bundle), "mediapipe": mediapipe.__version__}


class _Task:
    """A running MediaPipe task: silent, contacting nobody, closed before the interpreter is torn down."""

    def __init__(self, task: type, options: object) -> None:
        keep_offline()
        with quiet_stderr():
            self._task = task.create_from_options(options)
        weakref.finalize(self, _close, self._task)

    def detect(self, image: np.ndarray) -> object:
        pixels = mediapipe.Image(image_format=mediapipe.ImageFormat.SRGB, data=np.ascontiguousarray(image))
        with quiet_stderr():
            return self._task.detect(pixels)


def _close(task: object) -> None:
    try:
        task.close()
    except RuntimeError:
        # At interpreter exit the task's executor is gone already, and closing again from
        # __del__ would print a traceback; the process frees the rest.
        task._handle = None


def _positions_px(landmarks: list, image: np.ndarray) -> np.ndarray:
    """Landmarks as (n, 2) pixels with pixel centres at integers."""
    height, width = image.shape[:2]
    return np.array([(point.x * width, point.y * height) for point in landmarks]) - 0.5
