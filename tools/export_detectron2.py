"""Make an ONNX file of Detectron2's Keypoint R-CNN: boxes, scores and the maps of logits, any image size.

    python tools/export_detectron2.py configs/COCO-Keypoints/keypoint_rcnn_R_50_FPN_3x.yaml model.pkl out.onnx

runs in an environment with PyTorch and Detectron2 (its compiled extension is not needed) and uses nothing of
this project. The maps are not decoded: Detectron2's own last step, a loop over people, cannot be traced.
Operator set 16 or later is required: before, ROIAlign has no half-pixel mode.
"""

import argparse

import torch
from detectron2.checkpoint import DetectionCheckpointer
from detectron2.config import get_cfg
from detectron2.modeling import build_model
from detectron2.modeling.roi_heads import keypoint_head

OPSET = 17
TRACED_SIZE_PX = (480, 640)


def keep_maps(maps: torch.Tensor, people: list) -> None:
    """In the place of Detectron2's decoding."""
    people[0].pred_keypoint_heatmaps = maps


class MapsOnly(torch.nn.Module):
    """From an image, BGR 0-255, shape (3, h, w), to boxes (n, 4), scores (n,) and maps (n, 17, 56, 56)."""

    def __init__(self, model: torch.nn.Module) -> None:
        super().__init__()
        self.model = model

    def forward(self, image: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Everything but the decoding of the maps."""
        (people,) = self.model.inference([{"image": image}], do_postprocess=False)
        return people.pred_boxes.tensor, people.scores, people.pred_keypoint_heatmaps


def main() -> None:
    """Build the network of a configuration, load its weights, trace it, write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ("config", "weights", "out"):
        parser.add_argument(name)
    arguments = parser.parse_args()
    config = get_cfg()
    config.merge_from_file(arguments.config)
    config.MODEL.DEVICE = "cpu"
    model = build_model(config).eval()
    DetectionCheckpointer(model).load(arguments.weights)
    keypoint_head.keypoint_rcnn_inference = keep_maps
    torch.onnx.export(
        MapsOnly(model),
        torch.rand(3, *TRACED_SIZE_PX) * 255,
        arguments.out,
        dynamo=False,
        opset_version=OPSET,
        input_names=["image"],
        output_names=["boxes", "scores", "maps"],
        dynamic_axes={
            "image": {1: "height", 2: "width"},
            **{name: {0: "n"} for name in ("boxes", "scores", "maps")},
        },
    )


if __name__ == "__main__":
    main()
