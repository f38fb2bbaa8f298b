"""The recordings for the notebooks: a lab's own, or simulated once and cached."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from hicp_lib.core.cache import key
from hicp_lib.core.executor import run_jobs
from hicp_lib.core.files import cache_dir
from hicp_lib.recordings.recording import RGB_LIST, Recording, first_frames, open_recording, read_simulation
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.world.batch import check_numbers


def open_people(
    scenario: str,
    recording: str | Path | Sequence[str | Path] = "",
    n_frames: int | None = None,
    n_people: int = 1,
    seed: int = 0,
) -> list[Recording]:
    """Open the recordings of an experiment, each with one person.

    Parameters
    ----------
    scenario : str
        "relative-upper", "relative-lower" or "mocap"; simulated if no folder is given.
    recording : str or Path or sequence of str, optional
        Folders of a lab's own recordings, one per person.
    n_frames : int, optional
        Number of frames of each, from the first; by default all.
    n_people : int, optional
        Number of simulated people.
    seed : int, optional
        Of the simulation: subject k of it is the k-th.

    Returns
    -------
    list of Recording

    Raises
    ------
    InputError
        For an unknown scenario, no people, or a folder that does not hold a recording.
    """
    if recording:
        folders = [recording] if isinstance(recording, str | Path) else recording
        opened = [open_recording(folder) for folder in folders]
        return opened if n_frames is None else [first_frames(one, n_frames) for one in opened]
    # Open3D takes a second to load.
    from hicp_lib.experiments.recordings.scenarios import scenario as known
    from hicp_lib.experiments.recordings.simulate import simulate_recording

    check_numbers(n_people=(n_people, 1, 1000))
    n = known(scenario).n_frames if n_frames is None else n_frames
    made: dict[str, Any] = {"scenario": scenario, "n_frames": n}
    people = [Subject(seed, number) for number in range(n_people)]
    names = [key([simulate_recording], **made, subject=who)[:16] for who in people]
    folder = cache_dir() / "recordings"
    jobs = [  # one person per process, so that person and room are made only once
        (f"{name}/{RGB_LIST}", partial(_simulate, name=name, **made, subject=who))
        for name, who in zip(names, people, strict=True)
        if not (folder / name / RGB_LIST).is_file()
    ]
    list(run_jobs(jobs, folder=folder))
    return [open_recording(folder / name) for name in names]


def _simulate(folder: Path, name: str, scenario: str, n_frames: int, subject: Subject) -> None:
    from hicp_lib.experiments.recordings.simulate import simulate_recording

    simulate_recording(folder / name, scenario, n_frames, subject, workers=1, progress=False)


def data_note(recordings: Mapping[str, Recording]) -> str:
    """Description of recordings for captions, by their names."""
    plural = "s" if len(recordings) > 1 else ""
    told = [one for one in map(read_simulation, recordings.values()) if one]
    if len(told) < len(recordings):
        return f"recording{plural} {' and '.join(recordings)}"
    sensors = " or ".join(dict.fromkeys(one["scenario"].partition("@")[2] or "D435" for one in told))
    if any(recording.mocap_path for recording in recordings.values()):
        sensors += " and motion capture"
    return f"simulated recording{plural} (rendered person, simulated {sensors})"
