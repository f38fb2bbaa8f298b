"""Facts about a file, as text lines or JSON."""

import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import BODY, FACE, HANDS, INDEX

ORIGIN = "origin top left, pixel centres at integers"
_FROM_ONE_SIDE = 0.7  # fraction of people with left on one side of the image, from which it is reported
_SIDES = ("mixed", "as of people facing the camera", "as of backs, or sides that are the picture's")
_MOST_LINES = 10
_EPOCH_S = (1e9, 4e9)  # times between these are seconds since 1970: 2001 to 2096


@dataclass(frozen=True)
class Facts:
    """Facts about a file.

    Attributes
    ----------
    says : dict of str to str
        Its content: layout, units, scores, handedness, origin of pixels, times, counts.
    notes : sequence of str
        Problems and assumptions.
    needs : dict of str to str
        By command that takes it, what else that needs; empty if nothing.
    problem : str
        Why it cannot be used; empty if it can.
    kind : str
        Of file, in a few words.
    path : str

    Examples
    --------
    >>> facts = Facts({"people": "2"}, needs={"hicp import": "--out"}, kind="OpenPose", path="a.json")
    >>> print("\\n".join(facts.lines()))
    a.json: OpenPose
    people: 2
    for hicp import: --out
    """

    says: dict[str, str] = field(default_factory=dict)
    notes: Sequence[str] = ()
    needs: dict[str, str] = field(default_factory=dict)
    problem: str = ""
    kind: str = ""
    path: str = ""

    def lines(self) -> list[str]:
        """At most ten text lines; further ones are counted."""
        needs = "; ".join(f"for {command}: {what or 'all is there'}" for command, what in self.needs.items())
        first = [f"{self.path}: {self.kind}", *(f"{what}: {value}" for what, value in self.says.items())]
        last = [line for line in (needs, self.problem and f"cannot be used: {self.problem}") if line]
        notes, room = [f"note: {note}" for note in self.notes], max(1, _MOST_LINES - len(first) - len(last))
        if len(notes) > room:
            notes[room - 1 :] = [f"note: {len(notes) - room + 1} more notes, which --json shows"]
        return [*first, *notes, *last]


@cache
def tables() -> dict:
    """Kinds of files, and layouts of keypoints by their order, as `data/kinds.toml` lists them."""
    return tomllib.loads((DATA_DIR / "kinds.toml").read_text(encoding="utf-8"))


@contextmanager
def under_name(path: Path, name: str) -> Iterator[Path]:
    """A file under another name, alone in a folder, for readers that depend on names.

    Parameters
    ----------
    path : Path
    name : str

    Yields
    ------
    Path
        Error messages name the original file.
    """
    with TemporaryDirectory() as folder:
        other = Path(folder, name)
        other.symlink_to(path.resolve())
        try:
            yield other
        except InputError as error:
            raise InputError(str(error).replace(str(other), str(path)).replace(folder, str(path))) from None


def about_people(keypoints_px: np.ndarray, of_person: str, origin: str = "") -> dict[str, str]:
    """Groups, range and sides of people's keypoints.

    Parameters
    ----------
    keypoints_px : array, shape (n, 136, 2)
        NaN where not known.
    of_person : str
        Description of keypoints.
    origin : str, optional
        Remark on the origin of pixels.

    Returns
    -------
    dict of str to str
    """
    known = np.isfinite(keypoints_px).all(axis=-1)
    parts = (("body", BODY), ("face", FACE), ("hands", HANDS))
    counts = [f"{name} {int(known[:, part].any(axis=1).sum())}" for name, part in parts]
    units = f"pixels, {ORIGIN}{origin and f' ({origin})'}"
    says = {f"people with {of_person}": ", ".join(counts), "units": units}
    if known.any():
        (u0, v0), (u1, v1) = (of(keypoints_px[known], axis=0) for of in (np.min, np.max))
        says["units"] += f"; u {u0:.1f} to {u1:.1f}, v {v0:.1f} to {v1:.1f}"
    across_px = keypoints_px[:, INDEX["left_shoulder"], 0] - keypoints_px[:, INDEX["right_shoulder"], 0]
    if np.isfinite(across_px).any():
        share = float((across_px > 0).sum() / np.isfinite(across_px).sum())
        meaning = _SIDES[int(share > _FROM_ONE_SIDE) - int(share < 1 - _FROM_ONE_SIDE)]
        says["handedness"] = f"left shoulders are right of right ones in {100 * share:.0f} %: {meaning}"
    return says


def about_times(times_s: np.ndarray, meaning: str) -> str:
    """Rate, length and start of times, in words.

    Parameters
    ----------
    times_s : array, shape (n,)
        In seconds.
    meaning : str
        What the times refer to.

    Examples
    --------
    >>> about_times(np.array([0.0, 0.1, 0.2]), "of the file")
    'of the file; 10 per second (median), 0.2 s, from 0.000 s'
    """
    if len(times_s) < 2:
        return f"{meaning}; one" if len(times_s) else "none: frame after frame"
    step_s = float(np.median(np.diff(times_s)))
    rate = f"{1 / step_s:.4g} per second (median)" if step_s > 0 else "no rate"
    text = f"{meaning}; {rate}, {np.ptp(times_s):.4g} s, from {times_s[0]:.3f} s"
    if _EPOCH_S[0] < times_s[0] < _EPOCH_S[1]:
        text += f" (since 1970: {datetime.fromtimestamp(times_s[0], UTC):%Y-%m-%d %H:%M})"
    n_gaps = int((np.diff(times_s) > 2.5 * step_s).sum())
    return f"{text}; {n_gaps} gaps" if n_gaps else text
