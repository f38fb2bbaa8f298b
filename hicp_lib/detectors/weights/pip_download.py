"""Get wheels from the package index through pip, which checks their hashes; nothing in them is executed."""

import subprocess
import sys

from hicp_lib.core.children import child_environment

# pip has a timeout for silent servers, but none for one that keeps sending single bytes.
TIMEOUT_S = 3600.0


def run_pip(*arguments: str) -> str | None:
    """Run a pip command on wheels that a requirements file names with their hashes.

    pip's own configuration (index, proxy, certificates) applies.

    Parameters
    ----------
    *arguments : str
        The command and its arguments.

    Returns
    -------
    str or None
        None when it succeeded, otherwise one line saying what went wrong.
    """
    command = [sys.executable, "-m", "pip", *arguments, "--quiet", "--no-input", "--no-deps"]
    command += ["--only-binary", ":all:", "--require-hashes"]
    environment = child_environment(PIP_DISABLE_PIP_VERSION_CHECK="1", PIP_USER="0")
    try:
        run = subprocess.run(
            command,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
        )
    except subprocess.TimeoutExpired:
        return f"it was not done within {TIMEOUT_S:g} s"
    except OSError as error:
        return f"Python could not be started: {error.strerror}"
    return None if run.returncode == 0 else reason(run.stderr) or f"pip ended with code {run.returncode}"


def reason(stderr: str) -> str:
    """The last error pip printed, as one line.

    Examples
    --------
    >>> reason("WARNING: slow\\nERROR: No matching distribution found for net==1.0\\n")
    'No matching distribution found for net==1.0'
    """
    lines = [line.strip() for line in stderr.splitlines() if line.strip()]
    errors = [line.removeprefix("ERROR:").strip() for line in lines if line.upper().startswith("ERROR")]
    return (errors or lines or [""])[-1]
