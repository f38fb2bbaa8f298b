"""Provenance of a result: code, data, environment, machine.

It is printed below a page (`hicp_lib.study.page`), for the library and the data as a whole. Whether the page
is still fresh (`hicp_lib.report.runs`) depends on the parts of them that it uses.
"""

import importlib.metadata
import json
import os
import platform
import re
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

from hicp_lib.core.cache import LIBRARY_DIR, digest, files_below, files_sha256
from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.core.children import child_environment
from hicp_lib.core.datafiles import DATA_DIR, REFERENCE_DIR
from hicp_lib.core.environment import usable_cores
from hicp_lib.core.escape import escaped
from hicp_lib.core.files import read_json, sha256_file
from hicp_lib.detectors.weights.user import user_weights_sha256

LOCK_PATH = (CHECKOUT or LIBRARY_DIR) / "environment.lock"

_SHOWN_VERSIONS = "numpy pandas opencv-python-headless onnxruntime mediapipe open3d-cpu open3d matplotlib"
# Do not run programs from a checkout's configuration.
_GIT = ("git", "--no-optional-locks", "-c", "core.fsmonitor=false", "-c", "core.hooksPath=/dev/null")
_THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")


def library_sha256() -> str:
    """SHA-256 of every source file of `hicp_lib`."""
    return files_sha256((path for path in files_below(LIBRARY_DIR) if path.suffix == ".py"), LIBRARY_DIR)


def data_sha256() -> str:
    """SHA-256 of every file under `data/`, the detector registry with the weights' hashes among them.

    Without the reference runs, which depend on the rest.
    """
    files = files_below(DATA_DIR)
    return files_sha256((path for path in files if REFERENCE_DIR not in path.parents), DATA_DIR)


def lock_sha256() -> str:
    """SHA-256 of the checkout's `environment.lock`, or "missing" (as where hicp was installed)."""
    return sha256_file(LOCK_PATH) if LOCK_PATH.is_file() else "missing"


def installed_sha256() -> str:
    """SHA-256 of the actual installation: distributions, Python, type of machine."""
    distributions = {d.name: d.version for d in importlib.metadata.distributions()}
    return digest([distributions, sys.version, platform.machine(), platform.system()])


def git_state() -> dict[str, Any]:
    """Commit of the library's checkout, and how many files differ; "unknown" without git or a checkout.

    An installed library may be inside another repository, whose commit is irrelevant.
    """
    status = git("status", "--porcelain")
    changed_files = None if status is None else len(status.splitlines())
    return {"commit": git("rev-parse", "HEAD") or "unknown", "changed_files": changed_files}


def git(*arguments: str) -> str | None:
    """Git's output in the library's checkout; None without git or a checkout, or on errors."""
    if CHECKOUT is None:
        return None
    where = child_environment(GIT_DIR=str(CHECKOUT / ".git"), GIT_WORK_TREE=str(CHECKOUT))
    try:
        done = subprocess.run([*_GIT, *arguments], env=where, capture_output=True, text=True, timeout=20)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def versions() -> dict[str, str]:
    """Versions of Python and of the libraries that can change a number."""
    installed = {d.name.lower(): d.version for d in importlib.metadata.distributions()}
    shown = {name: installed[name] for name in _SHOWN_VERSIONS.split() if name in installed}
    return {"python": platform.python_version()} | shown


def weights_sha256() -> dict[str, str]:
    """SHA-256 of each weight file by name, from the registry; a detector loads no file that differs.

    Also of files that the user registered, by detector.
    """
    weights = read_json(DATA_DIR / "detectors.json")["weights"]
    return {name: row["sha256"] for name, row in weights.items()} | user_weights_sha256()


def machine() -> dict[str, Any]:
    """Processor, cores, system and the thread limits set by the environment."""
    system = f"{platform.system()} {platform.machine()}"
    threads = {name: os.environ[name] for name in _THREAD_VARIABLES if name in os.environ}
    return {"cpu": _cpu_model(), "cores": usable_cores(), "system": system} | threads


def _cpu_model() -> str:
    try:
        found = re.search(r"^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    except OSError:
        found = None
    return found.group(1).strip() if found else platform.processor() or "unknown"


def peak_memory_mb() -> int:
    """Peak memory of this process, without child processes."""
    unit = 1 if sys.platform == "darwin" else 1024  # bytes on this system, kibibytes elsewhere
    return round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6)


def onnx_providers() -> list[str]:
    """ONNX Runtime's available execution providers; empty when this process has not loaded it."""
    runtime = sys.modules.get("onnxruntime")
    return list(runtime.get_available_providers()) if runtime else []


def provenance(parameters: dict[str, Any]) -> dict[str, Any]:
    """Everything needed to assess or repeat a result made now, in this process, with `parameters`.

    Examples
    --------
    >>> stamp = provenance({"seed": 0})
    >>> stamp["parameters"], len(stamp["library_sha256"])
    ({'seed': 0}, 64)
    """
    return {
        "parameters": parameters,
        "git": git_state(),
        "library_sha256": library_sha256(),
        "lock_sha256": lock_sha256(),
        "data_sha256": data_sha256(),
        "weights_sha256": weights_sha256(),
        "versions": versions(),
        "onnx_providers": onnx_providers(),
        "machine": machine(),
    }


def provenance_html(stamp: dict[str, Any]) -> str:
    """The footer of a page: what the notebook ran with, in a collapsed block."""
    git = stamp["git"]
    changed = {None: "", 0: ""}.get(git["changed_files"], f" with {git['changed_files']} changed files")
    parameters = {k: f"= {json.dumps(v, ensure_ascii=False)}" for k, v in stamp["parameters"].items()}
    hashes = {name: stamp[f"{name}_sha256"][:12] for name in ("library", "lock", "data")}
    rows = {
        "Parameters": _listed(parameters),
        "Commit": git["commit"][:12] + changed,
        "Hashes": _listed(hashes),
        "Weights": _listed({name: sha256[:12] for name, sha256 in stamp["weights_sha256"].items()}),
        "Versions": _listed(stamp["versions"]),
        "Inference": ", ".join(stamp["onnx_providers"]) or "ONNX Runtime not used",
        "Machine": _listed(stamp["machine"]),
        "Wall time": f"{stamp['wall_s']:.1f} s",
    }
    body = "".join(f'<tr><th scope="row">{k}</th><td>{escaped(v)}</td></tr>' for k, v in rows.items())
    return (
        '<details class="hicp-provenance"><summary>What this page was made with</summary>'
        f"<table><tbody>{body}</tbody></table></details>"
    )


def _listed(named: dict[str, Any]) -> str:
    return ", ".join(f"{name} {value}" for name, value in named.items())
