"""Download one file from a web address, whole or not at all, with limits on time."""

import time
from functools import partial
from http.client import HTTPException
from multiprocessing import ProcessError
from multiprocessing.pool import ThreadPool
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import Request, build_opener

from hicp_lib.core.errors import one_line

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
