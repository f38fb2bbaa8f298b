"""Downloads, with limits on time: wheels from the package index, and single files from web addresses.

Wheels come through pip, which checks their hashes; nothing in them is executed. A file is whole or not used.
"""

import subprocess
import sys
import time
from functools import partial
from http.client import HTTPException
from multiprocessing import ProcessError
from multiprocessing.pool import ThreadPool
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import Request, build_opener

from hicp_lib.core.children import child_environment
from hicp_lib.core.errors import one_line

# pip has a timeout for silent servers, but none for one that keeps sending single bytes.
PIP_TIMEOUT_S = 3600.0


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
            timeout=PIP_TIMEOUT_S,
        )
    except subprocess.TimeoutExpired:
        return f"it was not done within {PIP_TIMEOUT_S:g} s"
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


# Timeout of a silent server, and minimum speed from then on.
TIMEOUT_S, LEAST_BYTES_PER_S = 30.0, 5000


def download(url: str, target: Path, max_bytes: int) -> str | None:
    """Write what `url` gives to `target`.

    Parameters
    ----------
    url : str
    target : Path
    max_bytes : int
        More is refused.

    Returns
    -------
    str or None
        None if the file is complete, otherwise one line saying what went wrong; `target` must then not be
        used.
    """
    request = Request(url, headers={"User-Agent": "hicp"})
    opened, begin_s = partial(build_opener().open, request, timeout=TIMEOUT_S), time.monotonic()
    try:
        with ThreadPool(1) as thread:  # a server may send its headers very slowly
            answer = thread.apply_async(opened).get(TIMEOUT_S)
        with answer as response, open(target, "wb") as file:
            if urlsplit(response.url).scheme != urlsplit(url).scheme:
                return f"led to {response.url}"
            # Without an announced size, a broken connection would look like a complete file.
            announced = int(response.headers["Content-Length"] or -1)
            if not 0 < announced <= max_bytes:
                return f"size announced: {announced} bytes, expected up to {max_bytes}"
            while file.tell() <= announced and (chunk := response.read1(1 << 20)):
                file.write(chunk)
                if time.monotonic() > begin_s + TIMEOUT_S + file.tell() / LEAST_BYTES_PER_S:
                    return f"too slow: {file.tell()} bytes in {time.monotonic() - begin_s:.0f} s"
            if file.tell() != announced:
                return f"ended after {file.tell()} bytes, {announced} were announced"
    except (OSError, HTTPException, ValueError, ProcessError) as error:  # the last: the timeout
        return one_line(error).strip("<>")
    return None
