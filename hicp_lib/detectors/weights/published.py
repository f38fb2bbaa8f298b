"""Weights that their authors publish for download: fetched one by one, by name, never by default.

`data/published_weights.json` names each download with its licence and, where known, its size and SHA-256.
Where the hash is not known, the first fetch records it in the cache, in `published_weights.lock.json`; a
download that differs later is refused. From an archive only one member is read, in memory; nothing is
unpacked or executed.
"""

import stat
import tempfile
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from urllib.parse import urlsplit

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError, refuse_unknown
from hicp_lib.core.files import cache_dir, read_json, sha256_bytes, sha256_file, write_bytes, write_json
from hicp_lib.detectors.weights.default import file_status, refuse_other_names, weights_dir
from hicp_lib.detectors.weights.downloads import download

REGISTRY_PATH = DATA_DIR / "published_weights.json"
# Far above any published model; a server or an archive that gives more is not trusted.
MAX_BYTES = 1 << 30


@dataclass(frozen=True)
class Published:
    """One download.

    Attributes
    ----------
    name : str
        The name that users type.
    url : str
        Where its authors publish it.
    member : str or None
        File name within the zip archive; None if the download is the weight file itself.
    use : str or None
        Detector and option that take the file, None if nothing here runs it.
    licence : str or None
    size_bytes : int or None
    sha256 : str or None
        Of the download; None where not known.
    note : str
        What it is.
    """

    name: str
    url: str
    member: str | None
    use: str | None
    licence: str | None
    size_bytes: int | None
    sha256: str | None
    note: str

    @property
    def file(self) -> str:
        """File name of the download."""
        return PurePosixPath(urlsplit(self.url).path).name

    @property
    def path(self) -> Path:
        """Where the weight file is kept, fetched or not."""
        return published_dir() / (self.name + PurePosixPath(self.member or self.file).suffix)

    @property
    def by_hand(self) -> Path:
        """Where the download may be put by hand."""
        return published_dir() / "by_hand" / self.file


def published_dir() -> Path:
    """Folder the published weight files are kept in."""
    return weights_dir() / "published"


def lock_path() -> Path:
    """The file of the hashes recorded on first use."""
    return cache_dir() / "published_weights.lock.json"


def published() -> dict[str, Published]:
    """Every published download by name.

    Raises
    ------
    InputError
        If the registry is unreadable, or a name in it is not a plain file name.
    """
    try:
        models = {name: Published(name, **row) for name, row in read_json(REGISTRY_PATH).items()}
        names = [name for model in models.values() for name in (model.name, model.file)]
    except (AttributeError, TypeError, ValueError) as error:
        raise InputError(f"{REGISTRY_PATH}: not a registry ({error}); restore the committed file") from None
    refuse_other_names(REGISTRY_PATH, names)
    return models


def status(model: Published) -> str:
    """`present`, `absent`, `unreadable`, `corrupt` (not the file that was recorded) or `unrecorded`."""
    record = _records().get(model.name)
    state = file_status(model.path, record["file_sha256"] if record else "")
    return "unrecorded" if record is None and state == "corrupt" else state


def fetch_published(name: str) -> Published:
    """Get one published weight file, unless it is present and intact; it is then at the result's `path`.

    Raises
    ------
    InputError
        If the name is unknown, the download fails (the message names the place to put it by hand), or it
        is not the file that is known or was recorded.
    """
    models = published()
    refuse_unknown("published model", name, models)
    model = models[name]
    if status(model) == "present":
        return model
    with tempfile.TemporaryDirectory(prefix="hicp-") as folder:
        source = _obtain(model, Path(folder))
        sha256 = _verified(model, source)
        content = source.read_bytes() if model.member is None else _read_member(source, model.member)
    _record(model, sha256, sha256_bytes(content))
    write_bytes(model.path, content)
    return model


def check_use(path: Path, content: bytes) -> None:
    """Check a weight file, before use, against the hash recorded when it was fetched.

    Files that were not fetched by name are the user's own and are not checked.

    Raises
    ------
    InputError
        If it is not the file that was recorded.
    """
    path = path.resolve()
    if path.parent != published_dir().resolve():
        return
    record = next((row for name, row in _records().items() if name in (path.stem, path.name)), None)
    if record is not None and sha256_bytes(content) != record["file_sha256"]:
        raise InputError(
            f"{path}: is not the file that {lock_path()} records; run: hicp models fetch {path.stem}"
        )


def _obtain(model: Published, folder: Path) -> Path:
    """The download placed by hand, or else from its address."""
    if model.by_hand.is_file():
        return model.by_hand
    problem = download(model.url, folder / model.file, MAX_BYTES)
    if problem:
        raise InputError(
            f"{model.name}: {model.url} could not be downloaded ({problem}); check the network, or put "
            f"{model.file} at {model.by_hand} and run this again"
        )
    return folder / model.file


def _verified(model: Published, source: Path) -> str:
    """SHA-256 of a download; refused if it is not the known or the recorded one."""
    size_bytes, sha256 = source.stat().st_size, sha256_file(source)
    recorded = _records().get(model.name, {}).get("sha256")
    for expected, by in ((model.sha256, REGISTRY_PATH), (recorded, lock_path())):
        if expected and sha256 != expected:
            raise InputError(
                f"{model.file}: SHA-256 is {sha256}, but {by} says {expected}; the file has changed and was "
                f"not used, ask its authors at {model.url} or remove {model.by_hand} if it is there"
            )
    if not 0 < size_bytes <= MAX_BYTES or model.size_bytes not in (None, size_bytes):
        raise InputError(
            f"{model.file}: has {size_bytes} bytes, expected {model.size_bytes or f'up to {MAX_BYTES}'}; "
            f"was not used, get it again from {model.url}"
        )
    return sha256


def _read_member(archive: Path, member: str) -> bytes:
    """Content of the one regular file called `member` in a zip archive, whatever folder it lies in.

    Names in the archive are never used as file names here, so unsafe ones do not matter.
    """
    problem = f"is not an intact zip archive with {member}"
    try:
        with zipfile.ZipFile(archive) as file:
            named = [entry for entry in file.infolist() if PurePosixPath(entry.filename).name == member]
            found = [one for one in named if not (one.is_dir() or stat.S_ISLNK(one.external_attr >> 16))]
            if len(found) == 1 and found[0].file_size <= MAX_BYTES:
                return file.read(found[0])
            problem = f"expected one file {member} of up to {MAX_BYTES} bytes in it"
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, OSError, ValueError):
        pass
    raise InputError(f"{archive.name}: {problem}; it was not used, get it again or ask its authors")


def _records() -> dict[str, dict[str, str]]:
    path = lock_path()
    records = read_json(path) if path.exists() else {}
    keys = {"url", "sha256", "file_sha256"}
    if not isinstance(records, dict) or any(
        not isinstance(record, dict) or record.keys() != keys for record in records.values()
    ):
        raise InputError(f"{path}: not a record of hashes; restore it, or delete it to record them again")
    return records


def _record(model: Published, sha256: str, file_sha256: str) -> None:
    """Record the hashes at the first fetch; those of later ones must be equal."""
    records = _records()
    record = {"url": model.url, "sha256": sha256, "file_sha256": file_sha256}
    if model.name not in records:
        write_json(lock_path(), dict(sorted((records | {model.name: record}).items())), indent=1)
    elif records[model.name]["file_sha256"] != file_sha256:
        raise InputError(f"{lock_path()}: {model.name} is recorded with another hash; restore that file")
