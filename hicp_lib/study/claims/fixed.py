"""Since when the claims stand as they are: a reader can check that no margin followed a result."""

from pathlib import Path
from typing import Any

from hicp_lib.core.cache import digest
from hicp_lib.core.files import read_json
from hicp_lib.study.claims.statements import CLAIMS_FILE
from hicp_lib.study.provenance import git


def fixed(path: Path = CLAIMS_FILE) -> dict[str, Any]:
    """Version and hash of statements and margins, and since when they are unchanged.

    Parameters
    ----------
    path : Path, optional
        In the layout of `data/claims.json`. Its `recorded` holds the version, a day, and the hash that the
        claims had on that day.

    Returns
    -------
    dict of str to object
        `version`; `sha256` of the canonical form of `tables` and `claims`; `since`: the commit that recorded
        this hash and its day, the recorded day where the history is not at hand, or that they were changed.
    """
    content = read_json(path)
    recorded = content["recorded"]
    sha256 = digest([content["tables"], content["claims"]])
    since = (
        recorded["day"] if sha256 == recorded["sha256"] else f"changed after version {recorded['version']}"
    )
    if sha256 == recorded["sha256"] and git("rev-parse", "--is-shallow-repository") == "false":
        commits = git("log", f"-S{sha256}", "--format=commit %h of %cs", "--", str(path))
        since = commits.splitlines()[-1] if commits else since
    return {"version": recorded["version"], "sha256": sha256, "since": since}
