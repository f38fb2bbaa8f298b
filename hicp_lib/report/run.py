"""A run of a notebook: its inputs, and its process."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, cast

from hicp_lib.core.checkout import EARLIER_RESULTS_VARIABLE, PROFILE_VARIABLE, RESULTS_VARIABLE
from hicp_lib.core.children import child_environment
from hicp_lib.core.files import write_json
from hicp_lib.core.limited import raised
from hicp_lib.report.notebooks import Notebook

WALL_LIMIT_S = 2 * 3600


class RunError(RuntimeError):
    """A notebook failed. The message is one line that says where, and where its copy is."""


@dataclass(frozen=True)
class Folders:
    """Input and output folders of the runs of one profile.

    Attributes
    ----------
    sources : Path
        Holds `notebooks` and `book`.
    root : Path
        Parent folder of results and the built book.
    profile : str
        Its name.
    """

    sources: Path
    root: Path
    profile: str

    @property
    def executed(self) -> Path:
        """Executed notebooks and their stamps."""
        return self.root / "_build" / "notebooks" / self.profile

    @property
    def results(self) -> Path:
        """One folder of results per notebook."""
        return self.root / "results" / self.profile


@dataclass(frozen=True)
class Run:
    """One notebook with its parameters and predecessors.

    Attributes
    ----------
    notebook : Notebook
    parameters : dict of str to object
        Every parameter's value by its name.
    after : sequence of str
        Names of the notebooks that come before it.
    """

    notebook: Notebook
    parameters: dict[str, Any]
    after: Sequence[str] = ()


class Children:
    """The running processes; leaving the context for any reason terminates them all."""

    def __init__(self) -> None:
        self._pipes: set[IO[bytes]] = set()
        self._ended = False

    def __enter__(self) -> Children:
        return self

    def __exit__(self, *_: object) -> None:
        self._ended = True
        for pipe in list(self._pipes):
            pipe.close()

    def execute(self, run: Run, copy: Path, staging: Path, folders: Folders) -> int | None:
        """Run the notebook into `copy`; returns the exit code, or None after the time limit.

        Parameters
        ----------
        run : Run
        copy : Path
            The executed notebook to write.
        staging : Path
            An empty folder for its job, log and results.
        folders : Folders

        Raises
        ------
        RunError
            If the report is being stopped.
        """
        if self._ended:
            raise RunError("was not run, the report was stopped")
        changed = {k: value for k, value in run.parameters.items() if value != run.notebook.defaults[k]}
        path = run.notebook.path.resolve()
        job = {"input_path": str(path), "output_path": str(copy), "cwd": str(path.parent)}
        write_json(staging / "job.json", job | {"parameters": changed})
        command = [sys.executable, "-m", "hicp_lib.report.execute", str(staging / "job.json")]
        with open(staging / "log.txt", "wb") as log, tempfile.TemporaryDirectory(prefix="hicp-") as private:
            environment = _environment(staging, folders, private)
            # In a separate session: a signal to the report's process group must not end this process before
            # it has ended the kernel's workers.
            streams: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": log, "stderr": log}
            process = subprocess.Popen(command, **streams, env=environment, start_new_session=True)
            pipe = cast(IO[bytes], process.stdin)
            self._pipes.add(pipe)
            try:
                return process.wait(raised(WALL_LIMIT_S))
            except subprocess.TimeoutExpired:
                return None
            finally:
                pipe.close()
                process.wait()
                self._pipes.discard(pipe)


def _environment(staging: Path, folders: Folders, private: str) -> dict[str, str]:
    """A kernel's environment: the user's own configuration must not change a number or a pixel."""
    import matplotlib

    return child_environment() | {
        RESULTS_VARIABLE: str(staging / "results"),
        EARLIER_RESULTS_VARIABLE: str(folders.results.resolve()),
        PROFILE_VARIABLE: folders.profile,
        "IPYTHONDIR": private,
        "JUPYTER_RUNTIME_DIR": private,
        "JUPYTER_PREFER_ENV_PATH": "1",
        "MATPLOTLIBRC": str(Path(matplotlib.get_data_path(), "matplotlibrc")),
        "MPLBACKEND": "module://matplotlib_inline.backend_inline",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONHASHSEED": "0",
        "PYTHONNOUSERSITE": "1",
        "TQDM_DISABLE": "1",
    }
