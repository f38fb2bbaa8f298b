"""Get one file from a web address: whole or not at all, and never waiting without end."""

from http.client import HTTPException
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import Request, build_opener

from hicp_lib.core.errors import one_line

# Without an answer for so long, the server is given up.
TIMEOUT_S = 30.0


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
        None when the file is there and whole, otherwise one line saying what went wrong; `target` is then
        not to be used.
    """
    request = Request(url, headers={"User-Agent": "hicp"})
    try:
        with build_opener().open(request, timeout=TIMEOUT_S) as response, open(target, "wb") as file:
            if urlsplit(response.url).scheme != urlsplit(url).scheme:
                return f"led to {response.url}"
            # Without the announced size, a connection that broke off would pass for a whole file.
            announced = int(response.headers["Content-Length"] or -1)
            if not 0 < announced <= max_bytes:
                return f"size announced: {announced} bytes, expected up to {max_bytes}"
            while chunk := response.read(1 << 20):
                file.write(chunk)
            if file.tell() != announced:
                return f"broke off after {file.tell()} of {announced} bytes"
    except (OSError, HTTPException, ValueError) as error:
        return one_line(error).strip("<>")
    return None
