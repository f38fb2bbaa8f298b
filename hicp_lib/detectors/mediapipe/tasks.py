"""MediaPipe Pose and Hands (Tasks API) as detectors.

MediaPipe's outputs and how they are converted:

- Landmarks are fractions of the image's width and height measured from its border, so a
  landmark at x lies at ``x * width - 0.5`` where pixel centres are integers. Landmarks
  outside the image are kept.
- Pose: the score of a keypoint is its *visibility*, the probability of being inside the image
  and not occluded. (*Presence*, inside the image or not, says less and is not used.) MediaPipe
  returns no score of the person; the mean score of the 17 COCO keypoints is used.
- Hands: there is no score per keypoint. Every point of a hand gets the hand's handedness score, which is the
  confidence in the *side*, not in the position. The person score is the mean over the hands of the instance.
- Sides: the Tasks API labels hands for images that are not mirrored: "Left" is the person's left hand. (The
  older solutions API assumes mirrored images and swaps the labels.) The tests check this with rendered hands,
  of which about four in five get the true label.
- Tracking: `tracking_hz` says that images are those of a video. A person is then searched for near the last
  position, and in the whole image only when the score falls below the threshold; points are smoothed over
  time. The result then depends on earlier images.
"""

from pathlib import Path
from typing import TypedDict, Unpack

import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.files import sha256_bytes
from hicp_lib.core.keypoints import COCO_17, to_halpe
from hicp_lib.detectors.combined.arbitration import Hands, give_hands, in_pairs, nearest_first
from hicp_lib.detectors.combined.hand_squares import WRISTS
from hicp_lib.detectors.mediapipe import bundles, child
from hicp_lib.detectors.mediapipe.program import program_folder, program_version
from hicp_lib.detectors.runtime.isolation import IsolatedProcess


class TaskOptions(TypedDict, total=False):
    """Options of each of MediaPipe's tasks.

    Attributes
    ----------
    min_score : float
        Threshold of MediaPipe's detector of people or palms, and of its presence check; 0.5 by default.
    model : str or Path or None
        An official `.task` bundle to use in place of the fetched weights.
    tracking_hz : float
        Rate of a video whose images come one after the other; 0, the default, for images that stand by
        themselves.
    """

    min_score: float
    model: str | Path | None
    tracking_hz: float


class _Task:
    """One of MediaPipe's tasks, in a separate process."""

    name: str

    def _prepare(
        self,
        task: str,
        n: int,
        min_score: float = 0.5,
        model: str | Path | None = None,
        tracking_hz: float = 0,
    ) -> None:
        """Starts at the first image, as it takes half a second; with a user's bundle at once."""
        bundle = bundles.read_bundle(task, model) if model else bundles.assemble(task)
        self._process = IsolatedProcess(
            [child.__file__, str(program_folder().parent)],
            {"task": task, "n": n, "min_score": min_score, "tracking_hz": tracking_hz},
            bundle,
            name=f"{model}: cannot be used by {self.name}" if model else self.name,
            remedy="give another .task file" if model else "run: hicp doctor",
        )
        self.start = self._process.start
        if model:
            self.start()
        self.settings = {f"num_{task}s": n, "min_score": min_score, "bundle_sha256": sha256_bytes(bundle)}
        self.settings["mediapipe"] = program_version()
        if tracking_hz:
            self.settings["tracking_hz"] = tracking_hz


class MediaPipePose(_Task):
    """MediaPipe Pose Landmarker: 33 landmarks, of which 21 have a Halpe counterpart.

    Parameters
    ----------
    num_poses : int
        Maximum number of people per image; 1, as in the paper, suits crops of one person.
    **options : object
        See `TaskOptions`.
    """

    name = "mediapipe-pose"

    def __init__(self, num_poses: int = 1, **options: Unpack[TaskOptions]) -> None:
        self._prepare("pose", num_poses, **options)

    def detect(self, image: np.ndarray) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8."""
        people = self._process.ask(image)
        scores = to_halpe(np.clip(people[..., 2], 0, 1), "mediapipe_pose33", axis=-1, fill=0.0)
        keypoints_px = to_halpe(_positions_px(people[..., :2], image), "mediapipe_pose33", axis=-2)
        return Detections(keypoints_px, scores, scores[:, COCO_17].mean(axis=1))


class MediaPipeHands(_Task):
    """MediaPipe Hand Landmarker: 21 landmarks of each hand.

    One instance holds the best left and the best right hand; further hands are paired in the same way, by
    decreasing score.

    Parameters
    ----------
    num_hands : int
        Maximum number of hands per image.
    **options : object
        See `TaskOptions`.
    """

    name = "mediapipe-hands"

    def __init__(self, num_hands: int = 2, **options: Unpack[TaskOptions]) -> None:
        self._prepare("hand", num_hands, **options)

    def detect(self, image: np.ndarray) -> Detections:
        """Find hands in an RGB image, shape (height, width, 3), uint8, paired into instances."""
        hands = self._process.ask(image)
        scores = np.repeat(np.minimum(hands[:, :1, 1], 1.0), child.N_HAND, axis=1)
        return in_pairs(Hands(_positions_px(hands[:, 1:], image), scores, hands[:, 0, 0].astype(int)))


class MediaPipe:
    """Pose and hands of the whole image as one detector.

    A hand goes to the nearest wrist of a body that has no hand yet, and takes its side from there: the body's
    left and right are far more often correct than the hand's own label (on 135 plainly rendered hands with
    known sides: all against 106). A remaining hand becomes an instance of its own, with the side of its
    label.

    Parameters
    ----------
    num_people : int
        Maximum number of people per image (with two hands each).
    min_score : float
        Threshold of both detectors.
    tracking_hz : float, optional
        As for its parts.
    """

    name = "mediapipe"

    def __init__(self, num_people: int = 1, min_score: float = 0.5, tracking_hz: float = 0) -> None:
        self.parts: dict[str, MediaPipePose | MediaPipeHands] = {
            "pose": MediaPipePose(num_people, min_score=min_score, tracking_hz=tracking_hz),
            "hands": MediaPipeHands(2 * num_people, min_score=min_score, tracking_hz=tracking_hz),
        }
        self.settings = {name: part.settings for name, part in self.parts.items()}

    def detect(self, image: np.ndarray) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8."""
        pose, hands = self.parts.values()
        return attach_hands(pose.detect(image), hands.detect(image))


def attach_hands(bodies: Detections, found: Detections) -> Detections:
    """Assign each hand, highest score first, to the nearest wrist without a hand, ignoring its label.

    Returns
    -------
    Detections
        The bodies with their hands, then instances of the hands without a free wrist.
    """
    hands = Hands.of(found)
    chosen = nearest_first(bodies.keypoints_px[:, WRISTS], hands, np.full((len(bodies), 2), -1))
    rest = np.setdiff1d(np.arange(len(hands)), chosen)
    return give_hands(bodies, hands, chosen).concatenate(in_pairs(hands.take(rest)))


def _positions_px(fractions: np.ndarray, image: np.ndarray) -> np.ndarray:
    """Landmarks (..., 2) as pixels with pixel centres at integers."""
    height, width = image.shape[:2]
    return fractions * (width, height) - 0.5
