"""Make an ONNX file of a top-down network of MMPose, for any number of crops of its training size.

    PYTHONPATH=. python .../tools/export_mmpose.py configs/.../NAME.py NAME.pth NAME.onnx

runs in a checkout of MMPose, where PyTorch, onnx, mmengine, mmcv-lite and what MMPose imports are installed,
and uses nothing of this project. The file says in its metadata whether the network was trained with unbiased
data processing (UDP), which its graph does not show.
"""

import argparse
import sys
from unittest.mock import MagicMock

# No top-down network uses MMCV's compiled operations or MMDetection, but MMPose imports them.
sys.modules |= {name: MagicMock() for name in ("mmcv.ops", "mmdet", "mmdet.utils")}

import onnx  # noqa: E402
import torch  # noqa: E402
from mmpose.apis import init_model  # noqa: E402

OPSET = 17


def main() -> None:
    """Build the network of a configuration, load its weights, trace it, write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ("config", "weights", "out"):
        parser.add_argument(name)
    arguments = parser.parse_args()
    model = init_model(arguments.config, arguments.weights, device="cpu")
    codec = model.cfg.codec
    width, height = codec["input_size"]
    model.forward = model._forward  # backbone, neck and head; no decoding
    torch.onnx.export(
        model,
        torch.rand(1, 3, height, width),
        arguments.out,
        dynamo=False,
        opset_version=OPSET,
        input_names=["image"],
        dynamic_axes={"image": {0: "n"}},
    )
    written = onnx.load(arguments.out)
    onnx.helper.set_model_props(written, {"udp": "true" if codec["type"] == "UDPHeatmap" else "false"})
    onnx.save(written, arguments.out)


if __name__ == "__main__":
    main()
