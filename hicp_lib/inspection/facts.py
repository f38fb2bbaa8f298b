"""What is known of a file before it is used, in lines for people or as JSON."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hicp_lib.core.keypoints import BODY, FACE, HANDS, INDEX

FROM_ONE_SIDE = 0.7  # share of people whose left is on one side of the picture, from which on it is said


@dataclass(frozen=True)
class Facts:
    """What a file is.

    Attributes
    ----------
    path : Path
    kind : str
        Of file, in a few words.
    says : dict of str to str
        What it holds: layout, units, scores, handedness, origin of pixels, times, counts.
    notes : sequence of str
        What is amiss, or assumed.
    needs : dict of str to str
        By command that takes it, what that needs beside it; empty where nothing.
    problem : str
        Why it cannot be used; empty where it can.

    Examples
    --------
    >>> facts = Facts(Path("a.json"), "OpenPose keypoints", {"people": "2"}, needs={"hicp import": "--out"})
    >>> print("\\n".join(facts.lines()))
    a.json: OpenPose keypoints
    people: 2
    for hicp import: --out
    """

    path: Path
    kind: str
    says: dict[str, str] = field(default_factory=dict)
    notes: Sequence[str] = ()
    needs: dict[str, str] = field(default_factory=dict)
    problem: str = ""

    def lines(self) -> list[str]:
        """For people."""
        return [
            f"{self.path}: {self.kind}",
            *(f"{what}: {value}" for what, value in self.says.items()),
            *(f"note: {note}" for note in self.notes),
            *(f"for {command}: {needed or 'nothing is missing'}" for command, needed in self.needs.items()),
            *([f"cannot be used: {self.problem}"] if self.problem else []),
        ]

    def as_dict(self) -> dict:
        """For programs."""
        return {
            "path": str(self.path), "kind": self.kind, "says": self.says, "notes": list(self.notes),
            "needs": self.needs, "problem": self.problem or None,
        }  # fmt: skip


def about_people(keypoints_px: np.ndarray, of_person: str = "labelled") -> dict[str, str]:
    """Groups, range and sides of people's keypoints.

    Parameters
    ----------
    keypoints_px : array, shape (n, 136, 2)
        NaN where not known.
    of_person : str, optional
        What keypoints are said to be.

    Returns
    -------
    dict of str to str
    """
    known = np.isfinite(keypoints_px).all(axis=-1)
    groups = {"body": BODY, "face": FACE, "hands": HANDS}
    counts = [f"{name} {int(known[:, part].any(axis=1).sum())}" for name, part in groups.items()]
    says = {f"people with {of_person}": ", ".join(counts)}
    if known.any():
        low, high = keypoints_px[known].min(axis=0), keypoints_px[known].max(axis=0)
        says["units"] = f"pixels; u {low[0]:.1f} to {high[0]:.1f}, v {low[1]:.1f} to {high[1]:.1f}"
    across_px = keypoints_px[:, INDEX["left_shoulder"], 0] - keypoints_px[:, INDEX["right_shoulder"], 0]
    across_px = across_px[np.isfinite(across_px)]
    if len(across_px):
        share = float((across_px > 0).mean())
        meaning = "as of people who face the camera, if left is the person's"
        if share < FROM_ONE_SIDE:
            meaning = "as of backs, or sides that are the picture's" if share < 1 - FROM_ONE_SIDE else "mixed"
        says["handedness"] = f"left shoulders are right of right ones in {100 * share:.0f} %: {meaning}"
    return says


def about_scores(scores: np.ndarray) -> str:
    """Range and scale of keypoint scores, in words.

    Examples
    --------
    >>> about_scores(np.array([0.1, 0.9]))
    '0.1 to 0.9: in [0, 1]'
    >>> about_scores(np.array([0.1, 6.0]))
    '0.1 to 6: not in [0, 1]; give --score-scale'
    """
    if not len(scores):
        return "none"
    span = f"{scores.min():.3g} to {scores.max():.3g}"
    return f"{span}: in [0, 1]" if scores.max() <= 1 else f"{span}: not in [0, 1]; give --score-scale"


def about_times(times_s: np.ndarray, meaning: str) -> str:
    """Rate and length of times, in words.

    Parameters
    ----------
    times_s : array, shape (n,)
    meaning : str
        What they are times of.

    Examples
    --------
    >>> about_times(np.array([0.0, 0.1, 0.2]), "of the file")
    'of the file; 10 per second (median), 0.2 s, from 0.000 s'
    """
    if len(times_s) < 2:
        return f"{meaning}; one" if len(times_s) else "none"
    steps_s = np.diff(times_s)
    rate = 1 / np.median(steps_s) if np.median(steps_s) > 0 else np.nan
    gaps = int((steps_s > 2.5 * np.median(steps_s)).sum())
    length = f"{times_s[-1] - times_s[0]:.4g} s, from {times_s[0]:.3f} s"
    more = f"; {gaps} gaps" if gaps else ""
    return f"{meaning}; {rate:.4g} per second (median), {length}{more}"
