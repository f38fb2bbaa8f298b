"""Results go to the working folder, or to the study around it; sources are asked for where there are none."""

from __future__ import annotations

import pytest

from hicp_lib.core import checkout
from hicp_lib.core.errors import InputError


@pytest.fixture
def study(tmp_path):
    (tmp_path / "study" / "notebooks").mkdir(parents=True)
    (tmp_path / "study" / "notebooks" / "profiles.toml").write_text("")
    return tmp_path / "study"


def test_jupyter_works_in_notebooks_and_its_results_are_the_studys(study, monkeypatch):
    monkeypatch.chdir(study / "notebooks")
    assert checkout.working_folder() == study


def test_notebooks_of_a_folder_of_data_are_not_run_in_the_place_of_the_librarys_own(study, monkeypatch):
    monkeypatch.chdir(study)
    with pytest.raises(InputError, match="its notebooks are not those of the library that runs here; use"):
        checkout.sources()
    monkeypatch.setattr(checkout, "CHECKOUT", None)
    assert checkout.sources() == study


def test_elsewhere_results_stay_in_the_working_folder(study, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert checkout.working_folder() == tmp_path
    assert checkout.sources() == checkout.CHECKOUT


def test_an_installed_library_says_where_a_report_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(checkout, "CHECKOUT", None)
    with pytest.raises(InputError, match=r"has no notebooks/profiles.toml; run the report in a checkout"):
        checkout.sources()
