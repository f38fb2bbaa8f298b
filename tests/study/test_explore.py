"""What readers explore: its data, and the pages it comes to, opened from disk in headless Chromium."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import plotly
import plotly.graph_objects as go
import pytest
from PIL import Image
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.wheel_input import ScrollOrigin
from selenium.webdriver.common.keys import Keys

from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.core.detections import Detections
from hicp_lib.core.images import write_png
from hicp_lib.core.keypoints import INDEX, NAMES
from hicp_lib.evaluation.ap.metric_table import people_oks
from hicp_lib.evaluation.failures.dose_curves import dose_curves
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.experiments.avoidance.closed_loop import HAND_COLUMNS, Trial
from hicp_lib.experiments.avoidance.runs import Job, Run
from hicp_lib.recordings.recording import open_recording
from hicp_lib.robot.home import HOME_M, home_posture
from hicp_lib.robot.kinematics import ARM_JOINTS, load_icub
from hicp_lib.robot.skin import read_skin
from hicp_lib.study import explore, explore_space
from hicp_lib.study.page import Study
from tests.evaluation.made_people import make_annotations, make_detections
from tests.recordings.conftest import write_small

POINTS_PX = np.random.default_rng(0).uniform(50, 400, (136, 2))
PLOTLY = Path(plotly.__file__).parent / "package_data" / "plotly.min.js"
SCRIPTS = CHECKOUT / "book" / "_scripts"
DETECTORS = ["mediapipe", "movenet-thunder"]


@pytest.fixture
def subsets(tmp_path):
    """Three people in Basic, one of them in Headless, and a stranger of the same number in Near."""
    ids = {"basic": [1, 2, 3], "headless": [2], "near": [2]}
    for subset, of in ids.items():
        for i in of:
            (tmp_path / subset / "images").mkdir(parents=True, exist_ok=True)
            write_png(tmp_path / subset / "images" / f"{i}.png", np.full((960, 640, 3), 40 * i, np.uint8))
    truth = {s: make_annotations([POINTS_PX] * len(of), of) for s, of in ids.items()}
    off_px = {1: 0.0, 2: 40.0, 3: 9.0}
    found = {
        (s, d): {i: make_detections([POINTS_PX + off_px[i]]) for i in of}
        for s, of in ids.items()
        for d in DETECTORS
    }
    return {s: tmp_path / s for s in ids}, truth, found, people_oks(truth, found)


def test_crops_are_of_the_same_person_or_of_another(subsets):
    data, files = explore.crops(*subsets)
    assert [(one["id"], list(one["views"])) for one in data["people"]] == [
        (1, ["basic"]), (2, ["basic", "headless"]), (3, ["basic"]), (2, ["near"]),
    ]  # fmt: skip
    view = data["people"][0]["views"]["basic"]
    oks = [["mediapipe", "body", 1.0], ["mediapipe", "hand", 1.0], ["movenet-thunder", "body", 1.0]]
    assert view["oks"] == oks
    assert Image.open(io.BytesIO(files[view["file"]])).size == tuple(view["size"]) == (320, 480)
    index, u_px, v_px, score = view["found"]["mediapipe"][0][:4]
    assert index == 0 and score == 0.5
    assert [u_px, v_px] == pytest.approx((POINTS_PX[0] + 0.5) / 2, abs=0.06)
    assert explore.crops(*subsets)[1] == files
    few, _ = explore.crops(*subsets, n_people=2)
    assert [one["id"] for one in few["people"]] == [1, 3, 2]


def make_doses(folder: Path):
    about = [
        {"source_image_id": person, "dose": "distance", "level": level}
        for person in range(4)
        for level in (0.5, 2.5)
    ]
    people = make_annotations([POINTS_PX] * 8, range(8), extras=about)
    (folder / "images").mkdir()
    for image in people.images.values():
        write_png(folder / "images" / image.file_name, np.full((480, 640, 3), 90, np.uint8))
    found = {"mediapipe": {i: make_detections([POINTS_PX]) if i % 2 else Detections.none() for i in range(8)}}
    return folder, people, found, dose_curves(people, found, Draws(0))


def test_doses_have_pictures_of_some_and_precision_over_all(tmp_path):
    data, files = explore.doses(*make_doses(tmp_path))
    (dose,) = data["doses"]
    assert dose["levels"] == ["0.5 m", "2.5 m"] and data["n_people"] == 4
    assert [len(views) for views in dose["views"]] == [3, 3] and len(files) == 6
    assert [at[0] for at in dose["ap"]] == [["mediapipe", "body", value, None, None] for value in (0.0, 1.0)]


def make_run(detector: str = "mediapipe", script: str = "sitting, hand") -> Run:
    t_s = np.arange(20) * 0.05
    angles = np.tile(home_posture(load_icub()).angles("left"), (len(t_s), 1))
    columns = {"t_s": t_s, "distance_m": 0.3 - 0.1 * t_s, "activation": t_s / 2}
    columns |= {f"{joint}_rad": angles[:, k] + 0.2 * t_s for k, joint in enumerate(ARM_JOINTS)}
    columns |= dict(zip(HAND_COLUMNS, HOME_M["left"], strict=True))
    threatened = np.where(np.arange(len(read_skin())) == 5, 0.3, 0.01)
    cycles = pd.DataFrame(columns).assign(activations=[threatened] * len(t_s))
    jpeg = cv2.imencode(".jpg", np.full((240, 320, 3), 90, np.uint8))[1].tobytes()
    places_m = np.c_[POINTS_PX / 1000, POINTS_PX[:, 0] / 500]
    people = {
        "keypoints_px": np.r_[POINTS_PX.ravel()],
        "scores": np.full(136, 0.6),
        "keypoints_m": places_m.ravel(),
    }
    people = {name: values.tolist() for name, values in people.items()}
    rows = [
        {"t_s": at_s, "jpeg": jpeg, "truth_m": (places_m + 0.1).ravel().tolist()} | people
        for at_s in (0.0, 0.4)
    ]
    return Run(Job(Trial(script), detector), cycles, pd.DataFrame(rows))


def read_script(content: bytes):
    text = content.decode()
    assert text.startswith("hicpData(") and text.endswith(");\n")
    return json.loads(text[len("hicpData(") : -len(");\n")])


def test_runs_become_films_of_pictures_bodies_and_the_robot():
    unseeing = Run(Job(Trial("sitting, hand"), "ground truth"), make_run().cycles, pd.DataFrame())
    data, files = explore_space.runs([unseeing, make_run(), make_run("movenet-thunder")])
    assert [film["detector"] for film in data["films"]] == DETECTORS
    assert explore_space.runs([make_run()], n_people=0)[0]["films"] == []
    film = read_script(files[data["films"][0]["file"]])
    assert [frame["t_s"] for frame in film["frames"]] == [0.0, 0.4]
    assert [step["t_s"] for step in film["steps"][:3]] == [0.0, 0.1, 0.2]
    assert len(film["steps"][0]["robot"]) == len(data["radii"]) == 12
    assert film["steps"][0]["robot"] != film["steps"][-1]["robot"], "the arm moves"
    (taxels,) = film["steps"][0]["taxels"]
    assert taxels[0] == 5 and taxels[4] == 0.3 and len(taxels) == 5
    bodies = film["frames"][0]["bodies"]
    true, seen = (
        dict(zip(flat[0::5], flat[1::5], strict=True)) for (flat,) in (bodies["truth"], bodies["perceived"])
    )
    assert set(true) <= set(range(26)) | set(range(94, 136)), "without the face"
    assert true[9] - seen[9] == 100
    sheet = Image.open(io.BytesIO(files[data["films"][0]["sheet"]]))
    assert sheet.size == (data["columns"] * 240, 180)


def make_lifted(folder: Path):
    recording = open_recording(write_small(folder))
    found = {d: [make_detections([POINTS_PX / 20])] * len(recording) for d in DETECTORS}
    places = {f"{axis}_m": np.linspace(0.1, 0.4, 136) for axis in "xyz"}
    rows = [
        pd.DataFrame(
            {"keypoint": NAMES, "detector": d, "method": method, "frame": frame, "person": person} | places
        )
        for d in DETECTORS
        for method in ("paper", "robust")
        for frame in range(3)  # nobody in the last one
        for person in (0, 1)
    ]
    return recording, found, pd.concat(rows).assign(score=0.5)


def test_lifted_frames_become_a_film_per_detector(tmp_path):
    data, files = explore_space.lifted(*make_lifted(tmp_path / "small"))
    assert [film["detector"] for film in data["films"]] == DETECTORS and data["bodies"] == ["paper", "robust"]
    frames = read_script(files[data["films"][1]["file"]])["frames"]
    assert [frame["t_s"] for frame in frames] == [0.0, 0.1, 0.2, 0.3]
    assert [list(frame["bodies"]) for frame in frames] == [["paper", "robust"]] * 4
    assert [[len(of) for of in frame["bodies"]["paper"]] for frame in frames] == [[5 * 68]] * 3 + [[0]]
    (flat,) = frames[0]["bodies"]["paper"]
    wrist = flat.index(INDEX["left_wrist"])
    assert flat[wrist + 1] == round(1000 * np.linspace(0.1, 0.4, 136)[INDEX["left_wrist"]])
    some, _ = explore_space.lifted(*make_lifted(tmp_path / "again"), n_frames=2)
    assert some["films"] == data["films"]


@pytest.fixture
def opened(tmp_path, monkeypatch, browser):
    """Opens a page with what a notebook shows, as in the book; fails if anything is wrong there."""
    monkeypatch.setenv("HICP_RESULTS", str(tmp_path / "results" / "quick"))
    monkeypatch.setenv("HICP_PROFILE", "quick")
    shown: list[str] = []
    monkeypatch.setattr(
        "hicp_lib.study.page.display",
        lambda piece, raw=False: shown.append(piece["text/html"] if raw else piece.data),
    )

    def open_page(*kinds: str):
        (tmp_path / "notebooks").mkdir()
        (tmp_path / "_static").mkdir()
        for script in SCRIPTS.iterdir():
            (tmp_path / "_static" / script.name).symlink_to(script)
        (tmp_path / "_static" / "plotly.js").symlink_to(PLOTLY)
        names = ["explore", *(f"explore_{kind}" for kind in kinds)]
        head = "".join(f'<script defer src="../_static/{name}.js"></script>' for name in names)
        head += '<link rel="stylesheet" href="../_static/explore.css">'
        page = tmp_path / "notebooks" / "07_x.html"
        page.write_text(
            "<!doctype html><html lang=en><meta charset=utf-8><title>x</title>"
            f"{head}<div class=cell>{''.join(shown)}</div>",
            encoding="utf-8",
        )
        browser.get_log("browser")
        browser.get(page.as_uri())
        return browser

    yield Study("07_x"), open_page
    problems = [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
    assert problems == []


def find(browser, css: str):
    return browser.find_elements("css selector", css)


def open_explorer(browser) -> None:
    """By the keyboard, as everything else."""
    (summary,) = find(browser, ".hicp-explorer summary")
    summary.send_keys(Keys.ENTER)
    wait(browser, "return document.querySelector('svg[role=img]') !== null")


def wait(browser, condition: str, limit_s: int = 20) -> None:
    script = "const [code, limit_s, done] = arguments, start = Date.now(), f = new Function(code);"
    script += (
        "(function again() { if (f()) done(''); else if (Date.now() - start > 1000 * limit_s) done(code);"
    )
    script += " else setTimeout(again, 30); })()"
    assert browser.execute_async_script(script, condition, limit_s) == ""


def told(browser) -> list[list[str]]:
    return [[cell.text for cell in find(row, "th, td")] for row in find(browser, ".hicp-explorer tbody tr")]


@pytest.mark.browser
def test_crops_are_browsed_by_the_keyboard(opened, subsets):
    study, open_page = opened
    study.explorer("crops", 'Browse "crops" <b>', *explore.crops(*subsets))
    browser = open_page("crops")
    assert find(browser, ".hicp-explorer summary")[0].text == 'Browse "crops" <b>'
    assert find(browser, ".hicp-picture") == [], "nothing is loaded before it is opened"
    open_explorer(browser)
    assert told(browser) == [
        ["mediapipe", "1.00", "1.00", "1"],
        ["movenet-thunder", "1.00", "–", "1"],
        ["truth", "", "", ""],
    ]
    (person, score) = find(browser, "input[type=range]")
    person.send_keys(Keys.ARROW_RIGHT)
    assert (
        "2 of 3" in find(browser, ".hicp-through")[0].text
        and "Crop 2 of basic." in find(browser, "p")[0].text
    )
    assert told(browser)[0][1] != "1.00"
    basic, headless, near = find(browser, "input[type=radio]")
    headless.send_keys(Keys.SPACE)
    assert (
        "Crop 2 of headless." in find(browser, "p")[0].text
        and "1 of 1" in find(browser, ".hicp-through")[0].text
    )
    basic.send_keys(Keys.SPACE)
    (order,) = find(browser, "select")
    order.send_keys("worst of movenet")
    assert "Crop 2 of basic." in find(browser, "p")[0].text, "the worst comes first"
    people = find(browser, "svg[role=img] .hicp-people")
    find(browser, "tbody input")[0].send_keys(Keys.SPACE)
    assert len(find(browser, "svg[role=img] .hicp-people")) == len(people) - 1 == 2
    marks = "svg[role=img] .hicp-people path[transform]"
    n_marks = len(find(browser, marks))
    score.send_keys(Keys.END)
    assert len(find(browser, marks)) == n_marks - 136, "detections score .5, the truth stays"
    (image,) = find(browser, "svg[role=img] image")
    load = "const [address, done] = arguments, image = new Image(); image.onerror = () => done(0);"
    load += "image.onload = () => done(image.naturalWidth); image.src = address"
    assert browser.execute_async_script(load, image.get_attribute("href")) == 320


@pytest.mark.browser
def test_doses_are_stepped_through(opened, tmp_path):
    study, open_page = opened
    (tmp_path / "doses").mkdir()
    study.explorer("doses", "Doses", *explore.doses(*make_doses(tmp_path / "doses")))
    browser = open_page("doses")
    open_explorer(browser)
    assert told(browser)[0] == ["mediapipe", "0.00", "0.00", "0"]
    find(browser, "input[type=range]")[0].send_keys(Keys.ARROW_RIGHT)
    assert told(browser)[0] == ["mediapipe", "1.00", "1.00", "1"]
    assert "Person 1 at distance 2.5 m." in find(browser, "p")[0].text


@pytest.mark.browser
def test_films_stand_still_until_they_are_played(opened):
    study, open_page = opened
    runs = [make_run(), make_run("movenet-thunder"), make_run(script="sitting, head")]
    study.explorer("films", "Runs", *explore_space.runs(runs))
    browser = open_page("films")
    open_explorer(browser)
    said = find(browser, "p")[0]
    first = said.text
    assert first == "0.0 s: nearest 30.0 cm, activation 0.00."
    browser.execute_async_script("setTimeout(arguments[0], 500)")
    assert said.text == first
    (play,) = find(browser, "button")
    play.send_keys(Keys.ENTER)
    wait(browser, "return !document.querySelector('p').textContent.startsWith('0.0')")
    play.send_keys(Keys.ENTER)
    stopped = said.text
    browser.execute_async_script("setTimeout(arguments[0], 500)")
    assert said.text == stopped and "Play" in play.text
    space = "return document.querySelectorAll('svg[role=img]')[1].innerHTML"
    before = browser.execute_script(space)
    find(browser, "input[type=range]")[1].send_keys(Keys.ARROW_RIGHT)
    assert browser.execute_script(space) != before, "it turns"
    find(browser, "select")[-1].send_keys("movenet")
    wait(browser, "return document.querySelector('svg[role=img]').ariaLabel.includes('movenet-thunder')")
    find(browser, "select")[0].send_keys("sitting, head")  # no such run with this detector
    wait(browser, "return document.querySelector('svg[role=img]').ariaLabel.includes('mediapipe')")


@pytest.mark.browser
def test_a_film_opens_on_the_first_picture_with_somebody_in_it(opened):
    study, open_page = opened
    run = make_run()
    empty = dict.fromkeys(("keypoints_px", "scores", "keypoints_m"), [])
    rows = run.frames.assign(t_s=(0.3, 0.6)).to_dict("records")
    late = replace(run, frames=pd.DataFrame([rows[0] | empty, rows[1]]))
    study.explorer("films", "Runs", *explore_space.runs([late]))
    browser = open_page("films")
    open_explorer(browser)
    assert find(browser, "p")[0].text.startswith("0.6 s:")


@pytest.mark.browser
def test_lifted_frames_are_turned(opened, tmp_path):
    study, open_page = opened
    study.explorer("films", "Frames", *explore_space.lifted(*make_lifted(tmp_path / "small")))
    browser = open_page("films")
    open_explorer(browser)
    assert len(find(browser, "svg[role=img]")[1].find_elements("css selector", ".hicp-people")) == 2
    time = find(browser, "input[type=range]")[0]
    time.send_keys(Keys.END)
    assert find(browser, "p")[0].text == "0.3 s."
    assert (
        len(find(browser, "svg[role=img]")[1].find_elements("css selector", ".hicp-people path[transform]"))
        == 0
    )


@pytest.mark.browser
def test_tables_are_sorted_and_filtered(opened):
    study, open_page = opened
    study.table(
        "not_reproduced",
        pd.DataFrame({"section": ["IV-B", "IV-A"], "ours": [10.0, 9.0]}),
        "Two.",
        explore=True,
    )
    study.table("reproduced", pd.DataFrame({"section": ["IV-C"], "ours": [np.nan]}), "One.", explore=True)
    study.table("other", pd.DataFrame({"section": ["IV-A"]}), "Apart.")
    browser = open_page("table")
    bodies = [
        [cell.text for cell in find(browser, f"#{name} td:first-child")]
        for name in ("not_reproduced", "other")
    ]
    assert bodies == [["IV-B", "IV-A"], ["IV-A"]]
    assert len(find(browser, ".hicp-sort")) == 4
    (text,) = find(browser, "input[type=search]")
    ours = find(browser, "#not_reproduced .hicp-sort")[1]
    ours.send_keys(Keys.ENTER)
    assert [cell.text for cell in find(browser, "#not_reproduced td:first-child")] == ["IV-A", "IV-B"], (
        "9 before 10"
    )
    assert find(browser, "#not_reproduced th")[1].get_attribute("aria-sort") == "ascending"
    ours.send_keys(Keys.ENTER)
    assert [cell.text for cell in find(browser, "#not_reproduced td:first-child")] == ["IV-B", "IV-A"]
    text.send_keys("iv-a")
    assert "1 of 3 rows" in find(browser, ".hicp-filter")[0].text
    assert [figure.is_displayed() for figure in find(browser, "figure")] == [True, False, True]
    text.clear()
    text.send_keys(Keys.BACKSPACE)
    boxes = find(browser, ".hicp-filter input[type=checkbox]")
    boxes[0].send_keys(Keys.SPACE)
    assert [figure.is_displayed() for figure in find(browser, "figure")] == [False, True, True]


@pytest.mark.browser
def test_a_scene_is_drawn_when_it_comes_into_view_and_leaves_the_wheel_to_the_page(opened):
    study, open_page = opened
    layout = {"height": 400, "scene": {"camera": {"eye": {"x": 1.0, "y": 1.0, "z": 0.5}}}}
    far = {"mode": "markers", "x": [0, 1], "y": [0, 1], "z": [0, 1]}
    for number in range(12):  # enough text that the scene is out of sight
        study.table(f"t{number}", pd.DataFrame({"n": range(20)}), "Long.")
    study.scene("scene", go.Figure(go.Scatter3d(far), layout), "A scene.", "Two points")
    study.table("end", pd.DataFrame({"n": range(60)}), "Long.")
    browser = open_page("scene")
    (scene,) = find(browser, ".hicp-scene")
    assert browser.execute_script("return typeof Plotly") == "undefined" and scene.text == "Two points"
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", scene)
    wait(browser, "return document.querySelector('.js-plotly-plot .modebar-btn') !== null")
    titles = [button.get_attribute("data-title") for button in find(browser, ".modebar-btn")]
    assert len(titles) > 3 and [title for title in titles if "Share" in title or "Plotly" in title] == []
    eye, top = "return document.querySelector('.hicp-scene').layout.scene.camera.eye", "return window.scrollY"
    for is_focused in (False, True):
        if is_focused:
            ActionChains(browser).move_to_element(scene).click().perform()
            assert browser.switch_to.active_element == scene
        before = browser.execute_script(top)
        origin = ScrollOrigin.from_element(scene)
        ActionChains(browser).scroll_from_origin(origin, 0, 60).pause(0.5).perform()
        assert (browser.execute_script(top) == before) == is_focused
    before = browser.execute_script(eye)
    scene.send_keys(Keys.ARROW_LEFT)
    wait(browser, f"{eye}.x !== {before['x']}")
    after = browser.execute_script(eye)
    assert np.linalg.norm(list(after.values())) == pytest.approx(np.linalg.norm(list(before.values())))
