"""The recordings the study's notebooks look at: a lab's own, or simulated once and kept in the cache."""

import sys
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from hicp_lib.core.cache import key
from hicp_lib.core.executor import run_jobs
from hicp_lib.core.files import cache_dir
from hicp_lib.recordings.recording import RGB_LIST, Recording, first_frames, open_recording, read_simulation
from hicp_lib.simulation.body.identities import Subject


def open_experiment(
    scenario: str,
    recording: str | Path = "",
    n_frames: int | None = None,
    subject: Subject = Subject(),
) -> Recording:
    """Open the recording of an experiment.

    Parameters
    ----------
    scenario : str
        "relative-upper", "relative-lower" or "mocap"; simulated when no folder is given.
    recording : str or Path, optional
        Folder of a lab's own recording.
    n_frames : int, optional
        How many frames, from the first; all of them when left out.
    subject : Subject, optional
        Of the simulation.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        For an unknown scenario, or a folder that does not hold a recording.
    """
    if recording:
        opened = open_recording(recording)
        return opened if n_frames is None else first_frames(opened, n_frames)
    from hicp_lib.experiments.recordings.simulate import simulate_recording  # Open3D takes a second to load

    folder, n = _kept(scenario, n_frames, subject)
    if (folder / RGB_LIST).is_file():
        return open_recording(folder)
    return simulate_recording(folder, scenario, n_frames=n, subject=subject, progress=sys.stderr.isatty())


def _kept(scenario: str, n_frames: int | None, subject: Subject) -> tuple[Path, int]:
    """Where a simulated recording is kept, and how many frames it has."""
    from hicp_lib.experiments.recordings.scenarios import scenario as known
    from hicp_lib.experiments.recordings.simulate import simulate_recording

    n = known(scenario).n_frames if n_frames is None else n_frames
    result_key = key([simulate_recording], scenario=scenario, n_frames=n, subject=subject)
    return cache_dir() / "recordings" / result_key[:16], n


def open_people(
    scenario: str,
    recording: str | Path | Sequence[str | Path] = "",
    n_frames: int | None = None,
    n_people: int = 1,
    seed: int = 0,
) -> list[Recording]:
    """Open the recordings of several people, in each of which one is seen.

    Parameters
    ----------
    scenario : str
        As of `open_experiment`.
    recording : str, Path or sequence of them, optional
        Folders of a lab's own recordings, one of each person.
    n_frames : int, optional
        How many frames of each, from the first; all of them when left out.
    n_people : int, optional
        How many are simulated.
    seed : int, optional
        Of the simulation.

    Returns
    -------
    list of Recording

    Raises
    ------
    InputError
        As of `open_experiment`, or if there is to be no one.
    """
    if recording:
        folders = [recording] if isinstance(recording, str | Path) else recording
        return [open_experiment(scenario, folder, n_frames) for folder in folders]
    from hicp_lib.simulation.world.batch import check_numbers

    check_numbers(n_people=(n_people, 1, 1000))
    people = [Subject(seed, number) for number in range(n_people)]
    kept = [(*_kept(scenario, n_frames, who), who) for who in people]
    jobs = [
        (
            f"{out.name}/{RGB_LIST}",
            partial(_simulate, name=out.name, scenario=scenario, n_frames=n, subject=who),
        )
        for out, n, who in kept
        if not (out / RGB_LIST).is_file()
    ]
    if len(jobs) > 1:  # a person to a process: who is there in what room is made once
        list(run_jobs(jobs, folder=kept[0][0].parent))
    return [open_experiment(scenario, "", n_frames, who) for who in people]


def _simulate(folder: Path, name: str, scenario: str, n_frames: int, subject: Subject) -> None:
    from hicp_lib.experiments.recordings.simulate import simulate_recording

    simulate_recording(folder / name, scenario, n_frames, subject, workers=1, progress=False)


def data_note(recordings: Mapping[str, Recording]) -> str:
    """What recordings are, by their names, in the words of captions."""
    plural = "s" if len(recordings) > 1 else ""
    if not all(read_simulation(recording) for recording in recordings.values()):
        return f"recording{plural} {' and '.join(recordings)}"
    scenarios = [read_simulation(recording)["scenario"] for recording in recordings.values()]
    sensors = " or ".join(dict.fromkeys(name.partition("@")[2] or "D435" for name in scenarios))
    if any(recording.mocap_path for recording in recordings.values()):
        sensors += " and motion capture"
    return f"simulated recording{plural} (rendered person, simulated {sensors})"
