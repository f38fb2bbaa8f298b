"""Run one notebook with papermill, in a separate process: `python -m hicp_lib.report.execute JOB.json`.

`hicp_lib.report.runs` starts it, holds the other end of its standard input, and checks its results. When that
end closes, for whatever reason, this process ends the kernel and all its workers.
"""

import json
import os
import shutil
import sys
import threading
from pathlib import Path

import papermill
import psutil
from jupyter_client.manager import AsyncKernelManager
from papermill.exceptions import PapermillExecutionError

START_TIMEOUT_S = 120


class IpcKernelManager(AsyncKernelManager):
    """Talks to the kernel through files in a private folder: no port that two kernels could both pick."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.transport = "ipc"
        self.ip = os.path.join(os.environ["JUPYTER_RUNTIME_DIR"], "kernel")


def main(job_path: str) -> int:
    """Run the job; 0 when every cell ran, 1 when one raised (the copy then holds the error)."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        papermill.execute_notebook(
            **json.loads(Path(job_path).read_text()),
            progress_bar=False,
            kernel_name="python3",
            language="python",
            request_save_on_cell_execute=False,
            start_timeout=START_TIMEOUT_S,
            kernel_manager_class=IpcKernelManager,
            # Output of C++ libraries to the terminal goes to the log; Python's own warnings stay visible.
            # Nothing in the notebook's folder can be imported, since its key would not include it.
            extra_arguments=["--IPKernelApp.capture_fd_output=False", "--IPKernelApp.ignore_cwd=True"],
        )
    except PapermillExecutionError:
        return 1
    return 0


def _end_with_parent() -> None:
    os.read(0, 1)  # nothing is ever written: this returns when the other end closes
    for process in psutil.Process().children(recursive=True):
        process.kill()
    shutil.rmtree(os.environ["JUPYTER_RUNTIME_DIR"], ignore_errors=True)
    os._exit(3)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
