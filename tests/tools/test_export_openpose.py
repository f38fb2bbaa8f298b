"""OpenPose's Caffe files become ONNX: layer by layer what Caffe computes, and refusals."""

from __future__ import annotations

import numpy as np
import onnxruntime
import pytest
from bake.messages import message_class
from export_openpose import MESSAGES, to_onnx

DESCRIPTION = """
name: "toy"
input: "image"
input_dim: 1
layer {
  name: "conv" type: "Convolution" bottom: "image" top: "conv" param { lr_mult: 1 }
  convolution_param { num_output: 2 pad: 1 kernel_size: 3 weight_filler { type: "xavier" } }
}
layer { name: "relu" type: "ReLU" bottom: "conv" top: "conv" }
layer {
  name: "pool" type: "Pooling" bottom: "conv" top: "pool"
  pooling_param { pool: MAX kernel_size: 2 stride: 2 }
}
layer {
  name: "point" type: "Convolution" bottom: "pool" top: "point"
  convolution_param { num_output: 1 kernel_size: 1 }
}
layer { name: "prelu" type: "PReLU" bottom: "point" top: "prelu" }
layer {
  name: "net_output" type: "Concat" bottom: "prelu" bottom: "pool" top: "net_output"
  concat_param { axis: 1 }
}
"""
RNG = np.random.default_rng(0)
WEIGHTS = {
    "conv": [RNG.normal(size=(2, 3, 3, 3)), np.array([0.1, -0.2])],
    "point": [np.array([1.0, -1.0]).reshape(1, 2, 1, 1), np.array([0.5])],
    "prelu": [np.array([0.25])],
}


def caffemodel(weights: dict[str, list[np.ndarray]], layers: str = "layer") -> bytes:
    net = message_class(MESSAGES, "Net")()
    for name, blobs in weights.items():
        layer = getattr(net, layers).add(name=name)
        for blob in blobs:
            layer.blobs.add(data=blob.ravel().tolist())
    return net.SerializeToString()


def expected(pixels: np.ndarray) -> np.ndarray:
    """The toy network's answer (3, h / 2, w / 2), in plain NumPy."""
    kernels, bias = WEIGHTS["conv"]
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(pixels, ((0, 0), (1, 1), (1, 1))), (3, 3), axis=(1, 2)
    )
    conv = np.maximum(np.einsum("chwij,kcij->khw", windows, kernels) + bias[:, None, None], 0)
    pool = conv.reshape(2, conv.shape[1] // 2, 2, conv.shape[2] // 2, 2).max(axis=(2, 4))
    point = np.einsum("chw,kc->khw", pool, WEIGHTS["point"][0][..., 0, 0]) + 0.5
    return np.concatenate([np.where(point > 0, point, 0.25 * point), pool])


@pytest.mark.parametrize("layers", ["layer", "layers"])
def test_the_answer_is_caffes_at_any_size(layers):
    model = to_onnx(DESCRIPTION, caffemodel(WEIGHTS, layers)).SerializeToString()
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    assert [port.name for port in session.get_outputs()] == ["net_output"]
    for size in ((6, 8), (10, 4)):
        pixels = RNG.normal(size=(3, *size)).astype(np.float32)
        (maps,) = session.run(None, {"image": pixels[None]})
        assert (maps[0, 0] < 0).any() and (maps[0, 0] > 0).any()
        np.testing.assert_allclose(maps[0], expected(pixels), atol=1e-5)


@pytest.mark.parametrize(
    ("description", "weights", "told"),
    [
        (DESCRIPTION, caffemodel({"conv": WEIGHTS["conv"]}), "layer 'point' has no weights"),
        (DESCRIPTION.replace('"PReLU"', '"LRN"'), caffemodel(WEIGHTS), "layer 'prelu' is a LRN"),
        (DESCRIPTION, caffemodel(WEIGHTS)[:-3], "cut off"),
        (DESCRIPTION, caffemodel(WEIGHTS | {"point": WEIGHTS["conv"]}), "layer 'point'"),
        ("layer {", caffemodel(WEIGHTS), "description"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(description, weights, told):
    with pytest.raises(SystemExit, match=told):
        to_onnx(description, weights)
