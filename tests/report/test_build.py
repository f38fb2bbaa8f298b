"""Without the weights that are fetched, the study goes on with what is committed."""

import nbformat
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.detectors.registry import default_detector_names
from hicp_lib.report import book, build
from hicp_lib.report.build import absent_weights, make_report, without_absent
from hicp_lib.report.run import Children
from tests.report.tiny_study import FINISH, START, pretend_to_execute, write_notebook

TINY = 'seed = 0\nscale = 1.5\nimages = ""\ndetectors = {detectors}'


@pytest.fixture
def no_weights(tmp_path, monkeypatch):
    monkeypatch.setenv("HICP_CACHE", str(tmp_path / "nothing here"))


def test_only_mediapipe_needs_what_is_fetched(no_weights):
    absent = {name for name in default_detector_names() if absent_weights(name)}
    assert absent == {"mediapipe", "mediapipe-pose", "mediapipe-hands"}
    assert (
        absent_weights("combined:movenet-thunder+mediapipe-hands") == absent_weights("mediapipe-hands") != []
    )
    assert absent_weights("combined:movenet-thunder+some-hands") == []


def test_lists_lose_it_and_single_names_take_another(no_weights):
    given = {"detectors": ["mediapipe", "posenet"], "shown": "mediapipe", "n": 3, "words": ["a"], "none": []}
    kept, dropped, can_run = without_absent(given)
    assert kept == given | {"detectors": ["posenet"], "shown": "posenet"}
    assert (dropped, can_run) == ({"mediapipe"}, True)


@pytest.mark.parametrize(
    "given",
    [{"detectors": ["mediapipe"]}, {"hands": "mediapipe-hands", "detectors": ["mediapipe", "posenet"]}],
)
def test_what_is_about_it_alone_cannot_run(no_weights, given):
    assert without_absent(given)[2] is False


def test_what_a_user_asked_for_stays(no_weights):
    given = {"detectors": ["mediapipe", "posenet"]}
    assert without_absent(given, ["detectors"]) == (given, set(), True)


def test_with_all_weights_nothing_changes():
    given = {"detectors": default_detector_names(), "hands": "mediapipe-hands"}
    assert without_absent(given) == (given, set(), True)


def test_the_report_says_what_it_lacks_and_leaves_a_page_that_says_so(study, no_weights, monkeypatch):
    folder, lines = study / "notebooks", []
    parameters = {"00_first": '["mediapipe", "posenet"]', "01_second": '["mediapipe"]'}
    for name, detectors in parameters.items():
        write_notebook(folder / f"{name}.ipynb", START, FINISH, parameters=TINY.format(detectors=detectors))
    monkeypatch.setattr(Children, "execute", pretend_to_execute)
    told = {}
    monkeypatch.setattr(
        build, "build_book", lambda folders, left_out: (told.update(left_out), (study, True))[1]
    )
    make_report("quick", [], lines.append, study, study)
    said = "the weights of mediapipe are absent; hicp models fetch gets them"
    assert f"00_first: runs without some detectors: {said}" in lines
    assert f"01_second: left out: {said}" in lines and told == {"01_second": said}
    assert [path.name for path in (study / "results" / "quick").iterdir()] == ["00_first"]
    stub = study / "stub.ipynb"
    book._write_stub(folder / "01_second.ipynb", stub, said)
    assert nbformat.read(stub, as_version=4).cells[0].source == f"# About 01_second\n\nNot run: {said}."
    with pytest.raises(InputError, match="--only 01_second: the weights of mediapipe are absent"):
        make_report("quick", [], lines.append, study, study, only="01_second")
