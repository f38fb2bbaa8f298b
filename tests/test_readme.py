"""What the README says was found is what the committed reference run found."""

from __future__ import annotations

import re

import pandas as pd

from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.core.datafiles import REFERENCE_DIR
from hicp_lib.core.files import read_json

FULL = REFERENCE_DIR / "full"
README = " ".join((CHECKOUT / "README.md").read_text().split())


def medians_cm(lifting: str, joint: str) -> str:
    """The range of the medians of this study's detectors, of cells such as "392 / 2.0 [1.6, 2.6]"."""
    table = pd.read_parquet(FULL / "04_mocap_3d" / "table_four.parquet")
    ours = table[~table["detector"].str.contains("paper|perfect") & (table["lifting"] == lifting)]
    cells = ours[[f"left {joint}", f"right {joint}"]].to_numpy().ravel()
    values_cm = sorted(float(re.match(r"\d+ / ([\d.]+)", cell)[1]) for cell in cells)
    return f"{values_cm[0]} to {values_cm[-1]}"


def test_losses_without_the_head():
    losses = pd.read_parquet(FULL / "02_evaluation_2d" / "head_loss_table.parquet").query("group == 'body'")
    losses = losses.sort_values("change").set_index("detector")
    assert losses.index[0] == "mediapipe" and losses.index[-1] == "movenet-thunder" and len(losses) == 5
    told = {name: f"from {row.basic:.2f} to {row.headless:.2f}" for name, row in losses.iterrows()}
    assert f"With the heads of the same {losses['n_people'].iloc[0]} people cut off" in README
    assert f"precision of bodies falls {told['mediapipe']} for MediaPipe, most of five detectors" in README
    assert f"and {told['movenet-thunder']} for MoveNet Thunder, least." in README


def test_invented_heads():
    invented = read_json(FULL / "05_failure_analysis" / "values.json")["invented_heads"]
    shares = {name: share for name, share, *_ in map(str.split, invented)}
    assert f"puts a head into the picture for {shares['movenet-thunder']} % of these people" in README
    table = pd.read_parquet(FULL / "05_failure_analysis" / "false_presence.parquet")
    heads = table[(table["subset"] == "headless") & (table["part"] == "head")].set_index("detector")
    found = heads["n_found"]["mediapipe"].iloc[0]
    mediapipe = f"MediaPipe, which finds only {found} of them, for {shares['mediapipe']} %"
    assert f"{mediapipe} and OpenPose's method" in README
    assert f"on a small network for {shares['openpose-mobilenet']} %." in README


def test_people_seen_from_near():
    values = read_json(FULL / "02_evaluation_2d" / "values.json")
    who = values["near_note"].replace("rendered people from near", "people seen from near")
    found, ap = (
        [values[f"{what}_near_body_{name}"] for name in ("movenet-thunder", "mediapipe")]
        for what in ("found", "ap")
    )
    shares = f"MoveNet Thunder finds {found[0]:.0%} and MediaPipe {found[1]:.0%}".replace("%", " %")
    assert f"Of {who}, {shares}, with average precision {ap[0]:.2f} and {ap[1]:.2f}." in README


def test_the_network_for_close_range():
    table = pd.read_csv(REFERENCE_DIR / "closerange" / "metrics.csv").query("metric == 'AP'")
    headless = table[table["subset"] == "headless"].set_index(["group", "detector"])["value"]
    hands = headless["hand"]
    best = hands[hands.index.str.startswith("combined:")].max()
    ours, theirs = headless["body", "closerange"], headless["body", "movenet-lightning"]
    assert f"(`closerange`) has {ours:.2f} on headless bodies, where MoveNet Lightning" in README
    assert f"is built, has {theirs:.2f}, and {hands['closerange']:.2f} on their hands" in README
    assert f"where the best combination, given all its looks, has {best:.2f};" in README
    photographed = pd.read_csv(REFERENCE_DIR / "closerange" / "photographs.csv")
    thunder = photographed.set_index(["subset", "other"])["value"]["headless", "movenet-thunder"]
    assert f"on photographs without heads it has {-thunder:.2f} less than MoveNet Thunder." in README


def test_distances_in_space():
    floor_cm = read_json(FULL / "04_mocap_3d" / "values.json")["floor_cm"]
    theirs = {joint: medians_cm("paper", joint) for joint in ("wrist", "elbow")}
    below_skin = {joint: medians_cm("robust", joint) for joint in ("wrist", "elbow")}
    assert f"wrists are {theirs['wrist']} cm from motion capture and elbows {theirs['elbow']} cm" in README
    assert f"for perfect keypoints it would be {floor_cm} cm" in README
    assert f"below the skin leaves {below_skin['wrist']} and {below_skin['elbow']} cm." in README
