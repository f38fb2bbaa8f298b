"""The recordings the study's notebooks look at: a lab's own, or simulated once and kept in the cache."""

import sys
from collections.abc import Mapping
from pathlib import Path

from hicp_lib.core.cache import key
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
    # Open3D takes a second to load.
    from hicp_lib.experiments.recordings.scenarios import scenario as known
    from hicp_lib.experiments.recordings.simulate import simulate_recording

    n = known(scenario).n_frames if n_frames is None else n_frames
    result_key = key([simulate_recording], scenario=scenario, n_frames=n, subject=subject)
    folder = cache_dir() / "recordings" / result_key[:16]
    if (folder / RGB_LIST).is_file():
        return open_recording(folder)
    return simulate_recording(folder, scenario, n_frames=n, subject=subject, progress=sys.stderr.isatty())


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
