"""Write a trained network into data/weights, and compare it with PyTorch.

    python tools/closerange/export.py OUT [--to data/weights/closerange.onnx] [--body-share 1]
                                     [--expected FILE.json]

One file: MoveNet's frozen layers and what was trained (the running mean of its weights), with weights in 16
bits. Input `image`, RGB in 0 to 255, shape (1, 3, 192, 192); output `keypoints`, shape (1, 136, 5), or of a
hand (1, 21, 5): x and y in pixels of the square, the term of OKS to expect there, and the
probabilities that the keypoint is in the picture and that it is visible. `--expected` writes what PyTorch
gives for the study's photograph, scaled to a square, for tests.
"""

from __future__ import annotations

import argparse
import io
import json
import sys
import warnings
from pathlib import Path

import cv2
import numpy as np
import onnx
import onnxruntime
import torch
from onnx import compose, helper, numpy_helper

sys.path.insert(0, str(Path(__file__).parents[1]))

from closerange.frozen import SHAPES, SIDE_PX, frozen_layers, inputs_of  # noqa: E402
from closerange.network import CloseRange, Decoded  # noqa: E402
from closerange.train import LIGHTNING  # noqa: E402
from hicp_lib.core.datafiles import DATA_DIR  # noqa: E402
from hicp_lib.core.files import write_bytes  # noqa: E402
from hicp_lib.core.images import read_image  # noqa: E402

MAX_DIFFERENCE_PX, N_CHECKED = 0.5, 8
PHOTOGRAPH = DATA_DIR / "photograph.jpg"
METADATA = {
    "source": "MoveNet Lightning (Google LLC), and a decoder trained on rendered people by tools/closerange",
    "licence": "Apache-2.0",
}
_SMALL = 64  # weights with fewer numbers keep 32 bits


def trained(out: Path, body_share: float = 1.0) -> tuple[Decoded, list[str]]:
    """The network of a finished training with its decoding, and what it reads of MoveNet.

    Of what is added to MoveNet's maps of body points, `body_share` is taken.
    """
    options = json.loads((out / "configuration.json").read_text())
    network = CloseRange(LIGHTNING, options["squares"], options["width"])
    average = torch.load(out / "state.pt", weights_only=True)["average"]
    state = {name.removeprefix("module."): v for name, v in average.items() if name != "n_averaged"}
    network.load_state_dict(state)
    with torch.no_grad():
        for added in (network.maps.weight, network.maps.bias):
            added[: network.n_body] *= body_share
    return Decoded(network, options["squares"]).eval(), inputs_of(options["squares"])


def exported(network: Decoded, names: list[str]) -> onnx.ModelProto:
    """The whole network as ONNX."""
    example = tuple(torch.zeros(1, *SHAPES[name]) for name in names)
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.onnx.export(
            network, example, buffer, input_names=names, output_names=["keypoints"],
            opset_version=17, dynamo=False,
        )  # fmt: skip
    head = onnx.load_from_string(buffer.getvalue())
    prefix = onnx.version_converter.convert_version(frozen_layers(LIGHTNING, names), 17)
    prefix.ir_version = head.ir_version
    joined = compose.merge_models(compose.add_prefix(prefix, "f_", rename_inputs=False, rename_outputs=False),
                                  head, io_map=[(name, name) for name in names])  # fmt: skip
    joined.graph.input[0].type.tensor_type.shape.dim[0].dim_value = 1
    made = in_16_bits(joined)
    helper.set_model_props(made, METADATA)
    return made


def in_16_bits(model: onnx.ModelProto) -> onnx.ModelProto:
    """Large weights are stored in 16 bits, and cast when the network is loaded."""
    casts, weights = [], []
    for weight in model.graph.initializer:
        values = numpy_helper.to_array(weight)
        if values.dtype != np.float32 or values.size < _SMALL:
            weights.append(weight)
            continue
        weights.append(numpy_helper.from_array(values.astype(np.float16), f"{weight.name}/half"))
        casts.append(
            helper.make_node("Cast", [f"{weight.name}/half"], [weight.name], to=onnx.TensorProto.FLOAT)
        )
    del model.graph.initializer[:]
    model.graph.initializer.extend(weights)
    nodes = [*casts, *model.graph.node]
    del model.graph.node[:]
    model.graph.node.extend(nodes)
    onnx.checker.check_model(model)
    return model


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--to", type=Path, default=LIGHTNING.with_name("closerange.onnx"))
    parser.add_argument("--expected", type=Path, metavar="FILE.json")
    parser.add_argument("--body-share", type=float, default=1.0, help="of what is added to MoveNet's maps")
    arguments = parser.parse_args()
    network, names = trained(arguments.out, arguments.body_share)
    model = exported(network, names).SerializeToString()
    images = np.random.default_rng(0).uniform(0, 255, (N_CHECKED, 1, 3, SIDE_PX, SIDE_PX)).astype(np.float32)
    first = onnxruntime.InferenceSession(frozen_layers(LIGHTNING, names).SerializeToString())
    whole = onnxruntime.InferenceSession(model)

    def expected_of(image: np.ndarray) -> np.ndarray:
        kept = [torch.from_numpy(of) for of in first.run(names, {"image": image})]
        with torch.no_grad():
            return network(*kept).numpy()

    worst = 0.0
    for image in images:
        expected = expected_of(image)
        (found,) = whole.run(None, {"image": image})
        worst = max(worst, float(np.median(np.abs(found - expected)[..., :2])))
    if worst > MAX_DIFFERENCE_PX:
        sys.exit(f"the exported network differs from PyTorch by {worst:.2f} px in the median")
    write_bytes(arguments.to, model)
    if arguments.expected:
        square = cv2.resize(read_image(PHOTOGRAPH), (SIDE_PX, SIDE_PX), interpolation=cv2.INTER_AREA)
        points = expected_of(cv2.dnn.blobFromImage(square))[0]
        arguments.expected.write_text(json.dumps(points.round(4).tolist()) + "\n")
    print(f"{arguments.to}: {len(model):,} bytes; positions differ by {worst:.4f} px in the median")


if __name__ == "__main__":
    main()
