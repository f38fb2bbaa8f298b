"""Track keypoints over time, and weight each by its score, its age, and whether it was seen twice.

Detectors hallucinate people for one frame, lose real ones for a few, and single keypoints jump. So a keypoint
is trusted from its second detection near the first one, keeps its last trusted position while newer
detections contradict it, and decays when it is no longer detected.

How uncertain a keypoint's depth is (`sigma_m` of robust lifting) does not count, as it was no help: with
weights divided by 1 + (sigma / s)^2, the least distance in the first reach changed by -0.4 mm for s = 20 cm
(-1.3 to 0.4 mm) and for 8 cm (-1.8 to 0.8 mm; development subjects 0 to 3 of seed 0 in the three scripts,
MediaPipe, intervals over the twelve runs). A large sigma does mean a wrong depth, 7 in 10 of those above 5 cm
are off by more than 15 cm, but these are 3 % of the keypoints.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from hicp_lib.core.keypoints import N_KEYPOINTS

FARTHEST_M = 20.0  # detections farther from the robot along any axis are ignored: depth ends at 10 m


@dataclass(frozen=True)
class Trust:
    """Parameters of trust in keypoints.

    Attributes
    ----------
    lowest_score, full_score : float
        Weight 0 up to the first, 1 from the second on, linear between (the paper's two thresholds, 0.1 and
        0.3).
    jump_m, speed_m_s : float
        Two detections `dt` apart are the same keypoint if within `jump_m + speed_m_s * dt`.
    confirm_frames : int
        A new keypoint is trusted when it is detected again within this number of frames.
    memory_s : float
        A trusted keypoint is dropped after this time; a later detection is new again.
    hold_s : float
        Full weight for this time after the last detection, to cover a detector's delay.
    fade_s : float
        Then the weight decays to 1/e in this time (0.9 per cycle of 20 ms, as in HARMONIOUS, is 0.19 s).
    max_people : int
        Maximum number of tracked people, the nearest to the robot.
    """

    lowest_score: float = 0.1
    full_score: float = 0.3
    jump_m: float = 0.15
    speed_m_s: float = 3.0
    confirm_frames: int = 2
    memory_s: float = 0.6
    hold_s: float = 0.2
    fade_s: float = 0.19
    max_people: int = 8


_MEMORY = np.dtype(
    [("seen_m", "3f8"), ("seen_s", "f8"), ("believed_m", "3f8"), ("believed_s", "f8"), ("score", "f8")]
)
"""For every person and keypoint: the last detection, and the last trusted one with its score."""


class KeypointTracker:
    """State of all tracked people; one object per stream, updated in the order of time.

    A person is matched from one frame to the next by the keypoints detected in both.

    Parameters
    ----------
    trust : Trust, optional

    Examples
    --------
    A keypoint detected once is not trusted, detected twice it is:

    >>> tracker = KeypointTracker()
    >>> points_m, scores = np.full((1, 136, 3), np.nan), np.full((1, 136), 0.9)
    >>> points_m[0, 9] = -0.5, 0.0, 0.1  # the left wrist
    >>> tracker.see(0.0, points_m, scores, now_s=0.0), tracker.points(0.0)[1][0, 9]
    (True, np.float64(0.0))
    >>> tracker.see(0.03, points_m, scores, now_s=0.03), tracker.points(0.03)[1][0, 9]
    (True, np.float64(1.0))
    """

    def __init__(self, trust: Trust | None = None):
        self.trust = trust or Trust()
        self.latest_s = -np.inf
        self._frames_s: deque[float] = deque(maxlen=self.trust.confirm_frames)
        self._memory = _nothing(0)

    def see(self, time_s: float, keypoints_m: np.ndarray, scores: np.ndarray, now_s: float) -> bool:
        """Process one frame.

        Parameters
        ----------
        time_s : float
            Time of the image; frames from the future, and ones not newer than the last, are ignored.
        keypoints_m : array, shape (p, 136, 3)
            In the root frame; NaN where unknown.
        scores : array, shape (p, 136)
        now_s : float

        Returns
        -------
        bool
            Whether the frame was processed.
        """
        if not self.latest_s < time_s <= now_s:
            return False
        self.latest_s = time_s
        scores = np.nan_to_num(scores, nan=0.0, posinf=0.0, neginf=0.0)
        known = (np.abs(keypoints_m) < FARTHEST_M).all(axis=2) & (scores > self.trust.lowest_score)
        points = np.where(known[..., None], keypoints_m, np.nan)
        people = self._nearest(points)
        self._forget(time_s)
        self._update(time_s, points[people], scores[people])
        self._frames_s.append(time_s)
        return True

    def points(self, now_s: float) -> tuple[np.ndarray, np.ndarray]:
        """The trusted keypoints.

        Parameters
        ----------
        now_s : float

        Returns
        -------
        points_m : array, shape (p, 136, 3)
            In the root frame, NaN where none is trusted.
        weights : array, shape (p, 136)
            0 to 1.
        """
        late_s = np.maximum(now_s - self._memory["believed_s"] - self.trust.hold_s, 0)
        span = self.trust.full_score - self.trust.lowest_score
        weights = np.clip((self._memory["score"] - self.trust.lowest_score) / span, 0, 1)
        return self._memory["believed_m"], weights * np.exp(-late_s / self.trust.fade_s)

    def _nearest(self, points: np.ndarray) -> np.ndarray:
        """Rows of detected people nearest to the robot's root."""
        distance = np.nanmin(np.linalg.norm(points, axis=2), axis=1, initial=np.inf)
        order = np.argsort(distance, kind="stable")[: self.trust.max_people]
        return order[np.isfinite(distance[order])]

    def _forget(self, time_s: float) -> None:
        """Drop people not detected for long, and all but the latest if there are too many."""
        last_s = np.maximum(self._memory["seen_s"], self._memory["believed_s"]).max(axis=1, initial=-np.inf)
        latest = np.argsort(-last_s, kind="stable")[: 2 * self.trust.max_people]
        self._memory = self._memory[latest[time_s - last_s[latest] <= self.trust.memory_s]]

    def _update(self, time_s: float, points: np.ndarray, scores: np.ndarray) -> None:
        """Store the detections, and trust those near an earlier one of the same person."""
        rows, people = self._recognise(points, time_s)
        new = np.delete(np.arange(len(points)), people)
        memory = np.concatenate([self._memory[rows], _nothing(len(new))])
        people = np.append(people, new)
        points, scores = points[people], scores[people]
        lately = memory["seen_s"] >= min(self._frames_s, default=np.inf)
        believed = lately & self._near(points, time_s, memory["seen_m"], memory["seen_s"])
        believed |= self._near(points, time_s, memory["believed_m"], memory["believed_s"])
        memory["believed_m"][believed], memory["believed_s"][believed] = points[believed], time_s
        memory["score"][believed] = scores[believed]
        seen = np.isfinite(points[..., 0])
        memory["seen_m"][seen], memory["seen_s"][seen] = points[seen], time_s
        self._memory = np.concatenate([memory, np.delete(self._memory, rows, axis=0)])

    def _recognise(self, points: np.ndarray, time_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Rows of the state and of detected people, paired so that most keypoints match."""
        memory = self._memory[:, None]
        shared = self._near(points[None], time_s, memory["seen_m"], memory["seen_s"]).sum(axis=2)
        rows, people = linear_sum_assignment(-shared)
        paired = shared[rows, people] > 0
        return rows[paired], people[paired]

    def _near(
        self, points: np.ndarray, time_s: float, before_m: np.ndarray, before_s: np.ndarray
    ) -> np.ndarray:
        """Whether detections match earlier ones; False where either is unknown."""
        passed_s = time_s - before_s
        allowed_m = self.trust.jump_m + self.trust.speed_m_s * passed_s
        return (np.linalg.norm(points - before_m, axis=-1) <= allowed_m) & (passed_s <= self.trust.memory_s)


def _nothing(n: int) -> np.ndarray:
    """State (n, 136) of people never detected."""
    memory = np.zeros((n, N_KEYPOINTS), dtype=_MEMORY)
    memory["seen_m"] = memory["believed_m"] = np.nan
    memory["seen_s"] = memory["believed_s"] = -np.inf
    return memory
