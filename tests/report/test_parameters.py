"""Declared parameters: what is unknown or does not fit is refused by one line that says what would."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.core.errors import InputError
from hicp_lib.report.build import make_report
from hicp_lib.report.notebooks import (
    check_parameters,
    parse_overrides,
    read_notebook,
    read_notebooks,
    read_profile,
)
from tests.report.tiny_study import write_notebook


def test_declared_parameters_are_read_without_running_them(study):
    notebook = read_notebook(study / "notebooks" / "00_first.ipynb")
    assert notebook.defaults == {"seed": 0, "scale": 1.5, "detectors": ["a", "b"], "images": ""}


@pytest.mark.parametrize(
    "parameters", ["n = open('x')", "n = m = 1", "n, m = 1, 2", "print(1)", "n = ", "n: int"]
)
def test_parameters_that_are_no_plain_values_are_refused(tmp_path, parameters):
    path = write_notebook(tmp_path / "x.ipynb", parameters=parameters)
    with pytest.raises(InputError, match=r"x\.ipynb: its parameters cell is not `name = value` lines"):
        read_notebook(path)


@pytest.mark.parametrize("content", ["", "{}", "[]", '{"cells": 3}', "\x00", '{"nbformat": 4, "cells": [1]}'])
def test_what_is_no_notebook_is_refused(tmp_path, content):
    path = tmp_path / "x.ipynb"
    path.write_text(content)
    with pytest.raises(InputError, match=r"x\.ipynb"):
        read_notebook(path)


def test_source_hash_ignores_outputs_and_sees_every_cell(tmp_path):
    import nbformat

    path = write_notebook(tmp_path / "x.ipynb", "1 + 1")
    before = read_notebook(path).source_sha256
    notebook = nbformat.read(path, as_version=4)
    notebook.cells[-1].execution_count = 7
    notebook.metadata["kernelspec"] = {"name": "other", "display_name": "other"}
    nbformat.write(notebook, path)
    assert read_notebook(path).source_sha256 == before
    notebook.cells[0].source += "."
    nbformat.write(notebook, path)
    assert read_notebook(path).source_sha256 != before


def test_profile_and_order_are_read(study):
    folder = study / "notebooks"
    chosen, after = read_profile(folder / "profiles.toml", "quick", read_notebooks(folder))
    assert chosen == {"00_first": {"seed": 3}}
    assert after == {"01_second": ["00_first"]}


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("[full]", "profile 'quick' is not known; expected one of: full"),
        (
            "[quick.99_none]\nseed = 1",
            "notebook '99_none' is not known; expected one of: 00_first, 01_second",
        ),
        ("[quick.00_first]\nsed = 1", "00_first: parameter 'sed' is not known; expected one of: seed, "),
        ("[quick.00_first]\nseed = 1.5", "'seed' is 1.5; expected an integer such as 0"),
        ("[quick.00_first]\nseed = true", "'seed' is true; expected an integer such as 0"),
        ("[quick]\n[after]\n01_second = ['x']", "notebook 'x' is not known"),
        (
            "[quick]\n[after]\n01_second = ['00_first']\n00_first = ['01_second']",
            "01_second waits for 00_first waits for 01_second; break the circle",
        ),
        ("[quick", "not TOML"),
    ],
)
def test_faulty_profiles_are_refused(study, content, expected):
    path = study / "notebooks" / "profiles.toml"
    path.write_text(content)
    with pytest.raises(InputError) as error:
        read_profile(path, "quick", read_notebooks(study / "notebooks"))
    assert expected in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("seed", "7", 7),
        ("scale", "2", 2),
        ("scale", "2.5", 2.5),
        ("detectors", "x,y", ["x", "y"]),
        ("detectors", '["x"]', ["x"]),
        ("images", "", ""),
    ],
)
def test_overrides_take_the_type_of_the_default(study, name, text, expected):
    overrides = parse_overrides([(name, text)], read_notebooks(study / "notebooks"))
    assert overrides == {"00_first": {name: expected}, "01_second": {name: expected}}


def test_a_parameter_given_twice_is_refused(study):
    with pytest.raises(InputError, match="-p seed: is given twice; give it once"):
        parse_overrides([("seed", "1"), ("seed", "2")], read_notebooks(study / "notebooks"))


def test_relative_paths_are_those_of_the_caller(study, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    overrides = parse_overrides([("images", "here")], read_notebooks(study / "notebooks"))
    assert overrides["00_first"]["images"] == str(tmp_path / "here")
    overrides = parse_overrides([("images", '["here", "there"]')], read_notebooks(study / "notebooks"))
    assert overrides["00_first"]["images"] == [str(tmp_path / "here"), str(tmp_path / "there")]


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("sed", "1", "-p: parameter 'sed' is not known; expected one of: detectors, images, scale, seed"),
        ("seed", "x", "'seed' is \"x\"; expected an integer such as 0"),
        ("seed", "1.5", "expected an integer"),
        ("scale", "[1]", "expected a number such as 1.5"),
    ],
)
def test_faulty_overrides_are_refused(study, name, text, expected):
    with pytest.raises(InputError) as error:
        parse_overrides([(name, text)], read_notebooks(study / "notebooks"))
    assert expected in str(error.value)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.sampled_from(["seed", "scale", "detectors", "images"]), st.text(max_size=30))
def test_any_text_is_taken_or_refused(study, name, text):
    notebooks = read_notebooks(study / "notebooks")
    if "\x00" in text:
        return  # no argument of a process holds one
    try:
        overrides = parse_overrides([(name, text)], notebooks)
    except InputError as error:
        assert "\n" not in str(error)
        return
    check_parameters(notebooks[0], overrides["00_first"], "again")


STUDY = read_notebooks(CHECKOUT / "notebooks")
TEXTS = (
    "",
    "NaN",
    "inf",
    "-inf",
    "-1",
    "-0.5",
    "[]",
    '[""]',
    "[NaN]",
    "[[]]",
    "{}",
    "1e999",
    "9" * 5000,
    "true",
    "null",
)


def is_number(value) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


@pytest.mark.parametrize("text", TEXTS)
def test_no_number_or_list_of_a_notebook_takes_nonsense(text):
    """Of every parameter of the study: none that is empty, infinite, negative or of another kind."""
    for notebook in STUDY:
        for name, default in notebook.defaults.items():
            try:
                taken = parse_overrides([(name, text)], [notebook])[notebook.name][name]
            except InputError as error:
                assert str(error).startswith(f"-p {name}: {notebook.name}: ") and "\n" not in str(error)
                continue
            numbers = taken if isinstance(taken, list) else [taken]
            assert not is_number(default) and not any(map(is_number, numbers)), (name, taken)
            if isinstance(default, list):
                assert all(numbers) and (numbers or "some or none" in notebook.allowed[name]), (name, taken)
            assert taken != "" or default == ""


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("n_scenes", "0", "expected an integer such as 160 [scenes, 1 or more]"),
        ("seed", "-1", "[integer, 0 or more]"),
        ("hit_term", "1.1", "[term, 0 to 1]"),
        ("n_frames", "101", "[frames, 3 to 100]"),
        ("swept_losses", "0.5,1", "[0 to below 1]"),
        ("camera_hz", "0", "[Hz, above 0]"),
        ("duration_s", "4.6", "[s, above 4.6]"),
        ("mount_m", "-0.1", "[m, standard deviation]"),
        ("paradigms", "posenet", "[two names]"),
        ("method", "best", '["robust" or "paper"]'),
        ("detectors", "posenet,posenet", "a list of different values"),
        ("inference_s", '{"mediapipe": -1}', "[s by detector, 0 or more]"),
    ],
)
def test_ranges_are_those_the_comments_state(name, text, expected):
    with pytest.raises(InputError) as error:
        parse_overrides([(name, text)], STUDY)
    assert expected in str(error.value)


@pytest.mark.parametrize("name", ["detectors", "paradigms", "detector"])
def test_an_unknown_detector_is_told_before_anything_runs(tmp_path, name):
    text = "nobody,mediapipe" if name != "detector" else "nobody"
    with pytest.raises(
        InputError, match=f"^-p {name}: detector 'nobody' is not known; expected one of: mediapipe"
    ):
        make_report("quick", [(name, text)], pytest.fail, sources=CHECKOUT, root=tmp_path)
    assert not list(tmp_path.iterdir())
