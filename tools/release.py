"""Make a release: version, changelog, the full report, wheel, archives, checksums and a tag.

    python tools/release.py 0.2.0 [--dry-run] [--date 2027-01-31] [--profile full]

The version stands in `hicp_lib/__init__.py`; `CITATION.cff` and `codemeta.json` follow, and "Unreleased" in
`CHANGELOG.md` becomes the version with its date. These are committed, the report is built from that commit,
and the files to publish go to `_build/release/VERSION/`. The tag comes last: if a step before it fails, the
commit stays, and the same command continues from there. Nothing is pushed.
"""

from __future__ import annotations

import argparse
import datetime
import gzip
import json
import os
import re
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Callable
from pathlib import Path

from packaging.version import Version

from hicp_lib.core.files import sha256_file

CHECKOUT = Path(__file__).resolve().parents[1]
EDITED = ("hicp_lib/__init__.py", "CITATION.cff", "codemeta.json", "CHANGELOG.md")
_VERSION = re.compile(r'^__version__ = "(.*)"$', re.MULTILINE)
_UNRELEASED = re.compile(r"^## Unreleased\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)


class ReleaseError(Exception):
    """Why there is no release."""


def git(checkout: Path, *words: str) -> str:
    """What git prints."""
    return subprocess.run(["git", *words], cwd=checkout, check=True, capture_output=True, text=True).stdout


def check(checkout: Path, version: str) -> None:
    """Refuse what must not be released.

    Raises
    ------
    ReleaseError
        If the version is malformed or lower than the last one, its tag exists, files are not committed, or
        the changelog has no new entry.
    """
    if not re.fullmatch(r"(0|[1-9]\d*)(\.(0|[1-9]\d*)){2}", version):
        raise ReleaseError(f"{version!r} is not a version; write three numbers, as in 1.0.0")
    if changed := git(checkout, "status", "--porcelain").splitlines():
        raise ReleaseError(
            f"{len(changed)} files are not committed, such as {changed[0][3:]}; commit them first"
        )
    if f"v{version}" in git(checkout, "tag").split():
        raise ReleaseError(f"the tag v{version} exists; choose the next version")
    last = current_version(checkout)
    if Version(version) < Version(last):
        raise ReleaseError(f"{version} is lower than the current version {last}")
    if not is_written(checkout, version) and not unreleased(checkout):
        raise ReleaseError("CHANGELOG.md has no entry under Unreleased; add what is new")


def current_version(checkout: Path) -> str:
    """The version in `hicp_lib/__init__.py`."""
    found = _VERSION.search((checkout / EDITED[0]).read_text())
    if not found:
        raise ReleaseError(f"{EDITED[0]} has no line __version__ = ...")
    return found[1]


def is_written(checkout: Path, version: str) -> bool:
    """Whether an earlier run has written and committed this version."""
    return f"\n## {version} - " in (checkout / "CHANGELOG.md").read_text()


def unreleased(checkout: Path) -> str:
    """The changelog's lines under Unreleased; empty if none of them is an entry."""
    found = _UNRELEASED.search((checkout / "CHANGELOG.md").read_text())
    return found[1].strip() if found and re.search(r"^- ", found[1], re.MULTILINE) else ""


def texts(checkout: Path, version: str, date: str) -> dict[str, str]:
    """The four files as the release has them, by name."""
    code, citation, codemeta, changelog = ((checkout / name).read_text() for name in EDITED)
    citation = re.sub(r"^date-released: .*\n", "", citation, flags=re.MULTILINE)
    dated = f"version: {version}\ndate-released: {date}"
    described = json.loads(codemeta) | {"version": version, "datePublished": date}
    entries = unreleased(checkout)
    return {
        EDITED[0]: _VERSION.sub(f'__version__ = "{version}"', code),
        EDITED[1]: re.sub(r"^version: .*$", dated, citation, flags=re.MULTILINE),
        EDITED[2]: json.dumps(described, indent=2, ensure_ascii=False) + "\n",
        EDITED[3]: _UNRELEASED.sub(
            lambda found: f"## Unreleased\n\n## {version} - {date}\n\n{entries}\n\n", changelog
        ).rstrip("\n")
        + "\n",
    }


def commit(checkout: Path, version: str, date: str) -> None:
    """Write and commit the four files, unless an earlier run did."""
    if not is_written(checkout, version):
        for name, text in texts(checkout, version, date).items():
            (checkout / name).write_text(text)
        git(checkout, "commit", "--quiet", "-m", f"Release {version}", *EDITED)


def build_report(checkout: Path, profile: str) -> Path:
    """Run the study of this commit; the folder of its book."""
    hicp = Path(sys.executable).with_name("hicp")
    subprocess.run([hicp, "report", "--profile", profile], cwd=checkout, check=True)
    return checkout / "_build" / "book" / profile


def build_wheel(checkout: Path, source: Path, out: Path) -> None:
    """A wheel from the archived source: of what git knows, and of nothing else that lies in the checkout."""
    time_s = git(checkout, "log", "-1", "--format=%ct").strip()
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(source) as archive:
            archive.extractall(folder, filter="data")
        words = ["wheel", "--quiet", "--no-deps", "--no-build-isolation", "--no-index", "--wheel-dir", out]
        subprocess.run(
            [sys.executable, "-m", "pip", *words, Path(folder, source.name.removesuffix(".tar.gz"))],
            check=True,
            env=os.environ | {"SOURCE_DATE_EPOCH": time_s},
        )


def archive_folder(folder: Path, out: Path, name: str) -> None:
    """A folder as `.tar.gz`, the same bytes whenever and by whomever it is packed."""

    def anonymous(entry: tarfile.TarInfo) -> tarfile.TarInfo:
        entry.uid = entry.gid = entry.mtime = 0
        entry.uname = entry.gname = ""
        entry.mode = 0o755 if entry.isdir() else 0o644
        return entry

    with out.open("wb") as file, gzip.GzipFile("", "wb", fileobj=file, mtime=0) as packed:
        with tarfile.open(fileobj=packed, mode="w") as archive:
            for path in [folder, *sorted(folder.rglob("*"))]:
                archive.add(path, Path(name, path.relative_to(folder)), recursive=False, filter=anonymous)


def pack(checkout: Path, version: str, report: Path, wheel: Callable[[Path, Path, Path], None]) -> list[Path]:
    """Source, wheel, report and their checksums in `_build/release/VERSION`.

    Parameters
    ----------
    checkout : Path
    version : str
    report : Path
        Folder of the built book.
    wheel : callable
        As `build_wheel`.

    Returns
    -------
    list of Path
        What is to be published.
    """
    out = checkout / "_build" / "release" / version
    out.mkdir(parents=True, exist_ok=True)
    for old in out.iterdir():
        old.unlink()
    name = f"hicp-{version}"
    source = out / f"{name}.tar.gz"
    git(checkout, "archive", "--format=tar.gz", f"--prefix={name}/", f"--output={source}", "HEAD")
    wheel(checkout, source, out)
    archive_folder(report, out / f"{name}-report.tar.gz", f"{name}-report")
    files = sorted(out.iterdir())
    sums = out / "SHA256SUMS"
    sums.write_text("".join(f"{sha256_file(path)}  {path.name}\n" for path in files))
    return [*files, sums]


def release(
    checkout: Path,
    version: str,
    date: str,
    report: Callable[[], Path],
    wheel: Callable[[Path, Path, Path], None] = build_wheel,
) -> list[Path]:
    """Commit, build, pack and tag; what is to be published.

    Parameters
    ----------
    checkout : Path
    version : str
    date : str
        As in 2027-01-31.
    report : callable
        Builds the report and returns its folder.
    wheel : callable
        As `build_wheel`.

    Returns
    -------
    list of Path

    Raises
    ------
    ReleaseError
        As `check`, or if the report has no front page.
    """
    check(checkout, version)
    commit(checkout, version, date)
    book = report()
    if not (book / "index.html").is_file():
        raise ReleaseError(f"{book} has no index.html: the report was not built")
    files = pack(checkout, version, book, wheel)
    git(checkout, "tag", "-a", f"v{version}", "-m", f"HiCP {version}")
    return files


def main() -> None:
    """Release the checkout this file lies in, or say what that would do."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("version")
    parser.add_argument("--date", default=datetime.date.today().isoformat())
    parser.add_argument("--profile", default="full", help="of the report")
    parser.add_argument(
        "--dry-run", action="store_true", help="check, say what would be done, change nothing"
    )
    options = parser.parse_args()
    version = options.version
    try:
        if options.dry_run:
            check(CHECKOUT, version)
            print(f"would write {version} to {', '.join(EDITED)}, and commit them")
            print(f"would run the {options.profile} report and pack it, the source and a wheel")
            print(f"would tag v{version}")
            return
        files = release(CHECKOUT, version, options.date, lambda: build_report(CHECKOUT, options.profile))
    except (ReleaseError, subprocess.CalledProcessError) as error:
        said = getattr(error, "stderr", None) or error
        sys.exit(f"release: {str(said).strip()}")
    print(*files, sep="\n")
    print(f"Next: git push origin HEAD v{version}, and publish these files.")


if __name__ == "__main__":
    main()
