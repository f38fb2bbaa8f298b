"""What detectors found, as tools write it; names of files mislead on purpose."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.formats.detection_files import open_detections
from hicp_lib.formats.detections import write_detections
from tests.formats.importers.native_people import make_person
from tests.inspection.cases import case, dump

from native_files import (  # isort: skip
    LAYOUTS, write_alphapose, write_coco, write_detectron2, write_mmpose, write_openpose, write_openpose_coco,
)  # fmt: skip

FOUND = {"a_1.jpg": [make_person(1), make_person(2)], "b_2.jpg": [make_person(3)]}
IDS = {"a_1.jpg": 1, "b_2.jpg": 2}
PEOPLE = {"people": "3 in 2 of 2 images", "units": "pixels, origin top left, pixel centres at integers",
          "handedness": "in 100 %"}  # fmt: skip
IN_01 = {"scores": "divided by 1"}


def imported(tool: str, more: str = "") -> dict[str, str]:
    return {"hicp import": f"--format {tool} --annotations{more}"}


@case("COCO keypoint results", PEOPLE | IN_01 | {"layout": "coco17 3"}, needs=imported("coco"))
def coco_results(folder):
    write_coco(folder / "annotations.json", FOUND, IDS, "coco17")
    return folder / "annotations.json"


@case("COCO keypoint results", PEOPLE | {"layout": "halpe136 3", "scores": "give --score-scale"},
      needs=imported("coco", " --score-scale"))  # fmt: skip
def coco_results_of_large_scores(folder):
    loud = {
        name: [make_person(k, scores=np.full(136, 7.0)) for k, _ in enumerate(of)]
        for name, of in FOUND.items()
    }
    write_coco(folder / "alphapose-results.json", loud, IDS)
    return folder / "alphapose-results.json"


@case("COCO keypoint results", problem="[0, 1]; expected pixels")
def coco_results_in_fractions(folder):
    small = {"a_1.jpg": [make_person(1, points_px=make_person(1).points_px / 640)]}
    write_coco(folder / "results.json", small, IDS)
    return folder / "results.json"


@case("COCO keypoint results", problem="expected a finite number")
def coco_results_with_nan(folder):
    write_coco(folder / "results.json", FOUND, IDS)
    text = (folder / "results.json").read_text()
    (folder / "results.json").write_text(
        text.replace('"keypoints": [', '"keypoints": [NaN, ', 1).replace(", ", "", 0)
    )
    value = json.loads((folder / "results.json").read_text())
    value[0]["keypoints"].pop()
    return dump(folder / "results.json", value)


@case("COCO keypoint results with boxes, as Detectron2 writes", PEOPLE | IN_01 | {"layout": "coco17 3"},
      needs=imported("detectron2 (of other tools coco)"))  # fmt: skip
def detectron2_results(folder):
    write_detectron2(folder / "openpose.json", FOUND, IDS)
    return folder / "openpose.json"


@case("AlphaPose results", PEOPLE | IN_01 | {"layout": "halpe136 3"}, needs=imported("alphapose"))
def alphapose_results(folder):
    write_alphapose(folder / "results.json", FOUND)
    return folder / "results.json"


@case("AlphaPose results", PEOPLE | {"layout": "coco17 3"}, needs=imported("alphapose"))
def alphapose_results_by_number(folder):
    write_alphapose(folder / "coco_instances_results.json", FOUND, "coco17", with_names=False)
    return folder / "coco_instances_results.json"


@case("AlphaPose results", PEOPLE | {"layout": "halpe26 3"}, needs=imported("alphapose"))
def alphapose_folder(folder):
    write_alphapose(folder / "alphapose-results.json", FOUND, "halpe26")
    return folder


OPENPOSE = PEOPLE | {"units": "half a pixel is taken off OpenPose's bodies"} | IN_01


@case("OpenPose keypoints", OPENPOSE | {"layout": "openpose_body25 3, openpose_face70 3, left_hand21 3"},
      needs=imported("openpose"))  # fmt: skip
def openpose_folder_of_25(folder):
    write_openpose(folder, FOUND)
    return folder


@case("OpenPose keypoints", OPENPOSE | {"layout": "openpose_coco18 3;", "people with keypoints": "hands 0"},
      needs=imported("openpose"))  # fmt: skip
def openpose_folder_of_18(folder):
    write_openpose(folder, FOUND, "coco18", with_hands=False)
    return folder


@case("OpenPose keypoints", {"people": "2 in 1 of 1 images"}, needs=imported("openpose"))
def openpose_file(folder):
    write_openpose(folder, FOUND)
    return (folder / "a_1_keypoints.json").rename(folder / "results.txt")


@case("OpenPose keypoints", {"people": "0 in 0 of 1 images", "scores": "none"}, needs=imported("openpose"))
def openpose_file_of_nobody(folder):
    return dump(folder / "x.json", {"version": 1.3, "people": []})


@case("OpenPose keypoints", problem="is a list of 7")
def openpose_file_of_7(folder):
    return dump(folder / "x.json", {"version": 1.3, "people": [{"pose_keypoints_2d": [1.0] * 7}]})


@case("OpenPose's COCO results", PEOPLE | {"scores": "no scores", "units": "half a pixel is taken off"},
      needs=imported("openpose"))  # fmt: skip
def openpose_coco_results(folder):
    unsure = {
        name: [make_person(k, scores=1.0 * (np.arange(136) > 0)) for k, _ in enumerate(of)]
        for name, of in FOUND.items()
    }
    write_openpose_coco(folder / "results.json", unsure)
    return folder / "results.json"


@case("MMPose predictions", PEOPLE | IN_01 | {"layout": "wholebody133 3"}, needs=imported("mmpose"))
def mmpose_folder(folder):
    write_mmpose(folder, FOUND)
    return folder


@case("MMPose predictions", {"people": "1 in 1 of 1 images", "layout": "coco17 1"}, needs=imported("mmpose"))
def mmpose_file(folder):
    write_mmpose(folder, FOUND, "coco17")
    return (folder / "b_2.json").rename(folder / "openpose_keypoints.json")


@case("MMPose predictions", {"layout": "wholebody133 3", "scores": "(10 if RTMW"},
      needs=imported("mmpose", " --score-scale"))  # fmt: skip
def mmpose_folder_of_rtmw(folder):
    loud = {
        name: [make_person(k, scores=np.full(136, 7.0)) for k, _ in enumerate(of)]
        for name, of in FOUND.items()
    }
    write_mmpose(folder, loud)
    return folder


@case("MMPose predictions", {"people": "2 in 1 of 1 images", "layout": "halpe26 2"}, needs=imported("mmpose"))
def mmpose_saved_predictions(folder):
    write_mmpose(folder / "x", FOUND, "halpe26")
    names = {str(i): name for i, name in enumerate(LAYOUTS["halpe26"])}
    people = json.loads((folder / "x/a_1.json").read_text())
    return dump(
        folder / "results_a_1.json", {"meta_info": {"keypoint_id2name": names}, "instance_info": people}
    )


@case(
    "empty list: nobody was found",
    {"people": "0 in 0 of 0 images", "scores": "none"},
    needs={"hicp evaluate": "--annotations"},
)
def empty_list(folder):
    return dump(folder / "results.json", [])


def detections() -> dict[int, Detections]:
    people = {image: [person for person in FOUND[name]] for name, image in IDS.items()}
    return {
        image: Detections(
            *(np.array([getattr(p, key) for p in of]) for key in ("points_px", "scores", "score"))
        )
        for image, of in people.items()
    }


HICP = {"hicp evaluate": "--annotations", "hicp draw": "--images"}


def detected(path: Path) -> Path:
    with open_detections(path) as write:
        for image, found in detections().items():
            write(image, {"file_name": f"{image}.jpg"}, found)
    return path


@case("detections by hicp detect", PEOPLE | IN_01 | {"layout": "halpe136 3"}, needs=HICP)
def hicp_json(folder):
    return detected(folder / "d.json")


@case("detections by hicp detect", PEOPLE | IN_01, needs=HICP, notes=["ends in .csv"])
def hicp_csv(folder):
    return detected(folder / "d.csv").rename(folder / "trajectory.txt")


@case("detections by hicp detect (Parquet)", PEOPLE | IN_01, needs=HICP, notes=["ends in .parquet"])
def hicp_parquet(folder):
    return detected(folder / "d.parquet").rename(folder / "d.bin")


@case("detections by hicp detect", {"times": "5 per second (median), 0.4 s"}, needs=HICP)
def hicp_json_of_a_video(folder):
    with open_detections(folder / "d.json") as write:
        for k in range(3):
            write(k, {"file_name": "v.mp4", "frame": k, "time_s": k / 5}, detections()[2])
    return folder / "d.json"


@case("detections by hicp import", PEOPLE, needs=HICP)
def hicp_import(folder):
    extras = {i: [{"raw_keypoint_scores": [0.1] * 136}] * len(of) for i, of in detections().items()}
    write_detections(folder / "d.json", detections(), extras)
    return folder / "d.json"


@case("names of images by id", {"objects": "2"}, needs={"hicp draw": "lies beside"})
def image_names(folder):
    return dump(folder / "x.images.json", [{"id": 1, "file_name": "a"}, {"id": 2, "file_name": "b"}])


@case("detections by hicp detect (Parquet)", problem="a table")
def another_parquet(folder):
    pd.DataFrame({"x_m": [1.0, 2.0]}).to_parquet(folder / "results.json")
    return folder / "results.json"
