"""A release is refused on anything unfinished, and otherwise committed, packed, checked and tagged."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest
import release
import yaml

from hicp_lib import __version__
from hicp_lib.cli.system_libraries import LIBRARIES
from hicp_lib.core.checkout import CHECKOUT

CHANGELOG = "# Changelog\n\n## Unreleased\n\n### Added\n- A thing.\n\n## 0.1.0 - 2026-01-01\n\n- The first.\n"


@pytest.fixture
def checkout(tmp_path, monkeypatch) -> Path:
    """A small repository with the files a release writes."""
    for name in ("GIT_AUTHOR", "GIT_COMMITTER"):
        monkeypatch.setenv(f"{name}_NAME", "A")
        monkeypatch.setenv(f"{name}_EMAIL", "a@example.org")
    folder = tmp_path / "checkout"
    (folder / "hicp_lib").mkdir(parents=True)
    for name in release.EDITED:
        (folder / name).write_text((CHECKOUT / name).read_text())
    (folder / "CHANGELOG.md").write_text(CHANGELOG)
    (folder / ".gitignore").write_text("/_build/\n")
    release.git(folder, "init", "--quiet", "--initial-branch", "main")
    release.git(folder, "add", ".")
    release.git(folder, "commit", "--quiet", "-m", "first")
    return folder


def book(checkout: Path) -> Path:
    folder = checkout / "_build" / "book" / "full"
    (folder / "pages").mkdir(parents=True, exist_ok=True)
    (folder / "index.html").write_text("<p>")
    (folder / "pages" / "a.html").write_text("a")
    return folder


def no_wheel(checkout: Path, source: Path, out: Path) -> None:
    (out / "hicp-9.0.0-py3-none-any.whl").write_bytes(b"wheel")


def made(checkout: Path, version: str = "9.0.0") -> list[Path]:
    return release.release(checkout, version, "2027-01-31", lambda: book(checkout), no_wheel)


def state(checkout: Path) -> list[str]:
    return [
        release.git(checkout, *words) for words in (("rev-parse", "HEAD"), ("tag",), ("status", "--short"))
    ]


def test_a_release_is_committed_packed_and_tagged(checkout):
    files = made(checkout)

    assert release.git(checkout, "tag").split() == ["v9.0.0"]
    assert release.git(checkout, "rev-parse", "v9.0.0^{commit}") == release.git(checkout, "rev-parse", "HEAD")
    assert release.git(checkout, "status", "--short") == ""
    assert release.current_version(checkout) == "9.0.0"
    citation = yaml.safe_load((checkout / "CITATION.cff").read_text())
    assert (citation["version"], str(citation["date-released"])) == ("9.0.0", "2027-01-31")
    described = json.loads((checkout / "codemeta.json").read_text())
    assert (described["version"], described["datePublished"]) == ("9.0.0", "2027-01-31")
    changelog = (checkout / "CHANGELOG.md").read_text()
    assert changelog.startswith(
        "# Changelog\n\n## Unreleased\n\n## 9.0.0 - 2027-01-31\n\n### Added\n- A thing.\n\n## 0.1.0"
    )

    sums = dict(line.split("  ")[::-1] for line in files[-1].read_text().splitlines())
    assert files[-1].name == "SHA256SUMS"
    assert sums == {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files[:-1]}
    assert set(sums) == {"hicp-9.0.0-py3-none-any.whl", "hicp-9.0.0-report.tar.gz", "hicp-9.0.0.tar.gz"}
    with tarfile.open(checkout / "_build/release/9.0.0/hicp-9.0.0-report.tar.gz") as archive:
        assert archive.extractfile("hicp-9.0.0-report/pages/a.html").read() == b"a"
    with tarfile.open(checkout / "_build/release/9.0.0/hicp-9.0.0.tar.gz") as archive:
        assert b"9.0.0" in archive.extractfile("hicp-9.0.0/hicp_lib/__init__.py").read()


def test_an_archive_has_the_same_bytes_whenever_it_is_packed(tmp_path, checkout):
    folder = book(checkout)
    for name in ("one", "other"):
        (folder / "index.html").touch()
        release.archive_folder(folder, tmp_path / name, "hicp")
        (folder / "index.html").chmod(0o600)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "other").read_bytes()


def test_what_failed_before_the_tag_is_continued(checkout):
    with pytest.raises(release.ReleaseError, match="the report was not built"):
        release.release(checkout, "9.0.0", "2027-01-31", lambda: checkout / "nothing", no_wheel)
    assert release.git(checkout, "tag") == ""

    made(checkout)

    assert release.git(checkout, "tag").split() == ["v9.0.0"]
    assert release.git(checkout, "rev-list", "--count", "HEAD").strip() == "2"


@pytest.mark.parametrize(
    ("version", "name", "text", "expected"),
    [
        ("9.0", None, "", "is not a version"),
        ("9.0.0-rc1", None, "", "is not a version"),
        ("0.0.9", None, "", "lower than the current version"),
        ("9.0.0", "new.py", "x", "not committed, such as new.py"),
        ("9.0.0", "CITATION.cff", "version: 1\n", "not committed, such as CITATION.cff"),
    ],
)
def test_a_wrong_version_and_a_dirty_tree_are_refused(checkout, version, name, text, expected):
    if name:
        (checkout / name).write_text(text)
    before = state(checkout)
    with pytest.raises(release.ReleaseError, match=expected):
        made(checkout, version)
    assert state(checkout) == before


def test_an_existing_tag_is_refused(checkout):
    release.git(checkout, "tag", "v9.0.0")
    with pytest.raises(release.ReleaseError, match="the tag v9.0.0 exists"):
        made(checkout)


@pytest.mark.parametrize("entries", ["", "### Added\n"])
def test_an_empty_changelog_is_refused(checkout, entries):
    (checkout / "CHANGELOG.md").write_text(CHANGELOG.replace("### Added\n- A thing.\n", entries))
    release.git(checkout, "commit", "--quiet", "--all", "-m", "nothing new")
    with pytest.raises(release.ReleaseError, match="no entry under Unreleased"):
        made(checkout)


def test_a_dry_run_changes_nothing(checkout, monkeypatch, capsys):
    before = state(checkout)
    monkeypatch.setattr(release, "CHECKOUT", checkout)
    monkeypatch.setattr(sys, "argv", ["release.py", "9.0.0", "--dry-run"])
    release.main()
    assert "would tag v9.0.0" in capsys.readouterr().out
    assert state(checkout) == before and not (checkout / "_build").exists()


def test_the_command_says_in_one_line_why_it_refuses(checkout, monkeypatch):
    monkeypatch.setattr(release, "CHECKOUT", checkout)
    monkeypatch.setattr(sys, "argv", ["release.py", "9"])
    with pytest.raises(SystemExit, match="^release: '9' is not a version; .*$"):
        release.main()


def test_citation_codemeta_and_package_agree():
    citation = yaml.safe_load((CHECKOUT / "CITATION.cff").read_text())
    described = json.loads((CHECKOUT / "codemeta.json").read_text())
    project = release_metadata()
    assert citation["version"] == described["version"] == __version__
    assert citation["title"] == described["name"]
    assert described["description"] == project["description"]
    names = [author["name"] for author in citation["authors"]]
    assert names == [author["name"] for author in described["author"]]
    assert names == [author["name"] for author in project["authors"]]
    assert described["license"] == f"https://spdx.org/licenses/{citation['license']}"
    assert project["license"] == citation["license"]
    (paper,) = citation["references"]
    published = described["referencePublication"]
    assert published["@id"] == f"https://doi.org/{paper['doi']}" and published["name"] == paper["title"]
    assert citation.get("doi") == described.get("identifier")
    assert citation.get("repository-code") == described.get("codeRepository")
    assert str(citation.get("date-released")) == str(described.get("datePublished"))


def release_metadata() -> dict:
    import tomllib

    return tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]


def test_binder_installs_what_the_makefile_installs():
    makefile = (CHECKOUT / "Makefile").read_text().replace("\\\n", " ")
    build = (CHECKOUT / "binder" / "postBuild").read_text().replace("\\\n", " ")
    lock = "-r environment.lock"
    for text in (makefile, build):
        installs = [line for line in text.splitlines() if " pip install " in line]
        assert all("--no-deps" in line for line in installs if lock in line or "--editable" in line)
        assert sum("--require-hashes" in line and lock in line for line in installs) == 1
        assert sum("--editable . " in line and "editable_mode=compat" in line for line in installs) == 1
    assert subprocess.run(["bash", "-n", CHECKOUT / "binder" / "postBuild"]).returncode == 0


def test_binder_names_every_system_library():
    lines = (CHECKOUT / "binder" / "apt.txt").read_text().splitlines()
    assert [line for line in lines if not line.startswith("#")] == sorted(
        name for name, _ in LIBRARIES.values()
    )


def test_binder_downloads_no_data():
    required = json.loads((CHECKOUT / "binder" / "data_requirement.json").read_text())
    assert set(required) == {"src", "dst", "projectName", "note"}
    assert required["src"] == ""
