"""Model files at the door: whatever is wrong with them is one line, and CPU is never passed off as CUDA."""

import numpy as np
import onnx
import onnxruntime
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from onnx import TensorProto, helper

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import sha256_file
from hicp_lib.detectors.onnx.session import available_providers, open_model
from tests.detectors.onnx.onnx_models import colour_maps_model, constant_model, save, told


@pytest.fixture
def model(tmp_path):
    return constant_model(tmp_path / "m.onnx", (1, 3, 8, 8), {"maps": np.ones((1, 2, 4, 4), np.float32)})


def refused(path, match, **options):
    with pytest.raises(InputError, match=match) as caught:
        open_model(path, **options)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_ports_hash_and_response(model):
    opened = open_model(model)
    assert opened.inputs[0].shape == (1, 3, 8, 8)
    assert opened.settings["sha256"] == sha256_file(model)
    assert opened.settings["provider"] == "cpu"
    np.testing.assert_array_equal(opened.response_to_zeros()[0], np.ones((1, 2, 4, 4)))


def test_one_session_per_process_until_the_file_changes(model):
    first = open_model(model)
    assert open_model(model) is first
    constant_model(model, (1, 3, 8, 8), {"maps": np.zeros((1, 2, 4, 4), np.float32)})
    assert open_model(model) is not first


def test_files_that_are_no_models(tmp_path, model):
    refused(tmp_path / "absent.onnx", "give the path")
    refused(tmp_path, "is a folder")
    (tmp_path / "empty.onnx").write_bytes(b"")
    refused(tmp_path / "empty.onnx", "export it again")
    (tmp_path / "text.onnx").write_text("version https://git-lfs.github.com/spec/v1\n")
    refused(tmp_path / "text.onnx", "is not an ONNX file")


@given(data=st.data())
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_damaged_files_are_refused_or_run(data, model):
    """Cut off or overwritten anywhere: an error in one line, or a model that still opens; nothing else."""
    content = bytearray(colour_maps_model(model.with_name("whole.onnx"), (16, 16), 3).read_bytes())
    damaged = model.with_name("damaged.onnx")
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    else:
        at = data.draw(st.integers(0, len(content) - 1))
        content[at] = data.draw(st.integers(0, 255))
    damaged.write_bytes(content)
    try:
        open_model(damaged)
    except InputError as error:
        assert str(damaged) in str(error) and "\n" not in str(error)


def test_weights_in_a_second_file_are_refused(tmp_path):
    path = colour_maps_model(tmp_path / "m.onnx", (16, 16), 3)
    proto = onnx.load(path)
    onnx.save(proto, path, save_as_external_data=True, location="weights.bin", size_threshold=0)
    refused(path, "in one file")


def external(name="weights", location="weights.bin"):
    tensor = TensorProto(name=name, dims=[1], data_type=TensorProto.FLOAT, data_location=TensorProto.EXTERNAL)
    tensor.external_data.add(key="location", value=location)
    return tensor


@pytest.mark.parametrize(
    "location", ["weights.bin", "../weights.bin", "{folder}/weights.bin", "link", "twin"]
)
def test_weights_in_a_second_file_are_refused_wherever_it_lies(tmp_path, monkeypatch, location):
    """ONNX Runtime would take them from the folder one happens to be in, and no hash would know of them."""
    (tmp_path / "in").mkdir()
    monkeypatch.chdir(tmp_path / "in")
    for folder in (tmp_path, tmp_path / "in"):
        (folder / "weights.bin").write_bytes(np.ones(1, np.float32).tobytes())
    (tmp_path / "in/link").symlink_to("weights.bin")
    (tmp_path / "in/twin").hardlink_to("weights.bin")
    path = save(tmp_path / "in/m.onnx", [helper.make_node("Add", ["a", "weights"], ["c"])], {"a": [1]},
                {"c": [1]}, {"weights": np.ones(1, np.float32)})  # fmt: skip
    assert open_model(path).run(np.ones(1)) == [[2]]
    proto = onnx.load(path)
    proto.graph.initializer[0].CopyFrom(external(location=location.format(folder=tmp_path)))
    path.write_bytes(proto.SerializeToString())
    refused(path, "external_data=False")


def test_a_second_file_is_refused_in_attributes_branches_functions_and_sparse_weights_too(tmp_path):
    path = constant_model(tmp_path / "m.onnx", (1, 3, 8, 8), {"maps": np.ones((1, 2, 4, 4), np.float32)})
    constant = helper.make_node("Constant", [], ["hidden"], value=external())
    branch = helper.make_graph([constant], "branch", [], [helper.make_tensor_value_info("hidden", 1, [1])])
    sparse = onnx.SparseTensorProto(values=external(), dims=[4])
    function = helper.make_function("own", "F", [], ["hidden"], [constant], [helper.make_opsetid("", 17)])
    additions = {
        "attribute": lambda proto: proto.graph.node.append(constant),
        "branch": lambda proto: proto.graph.node.append(
            helper.make_node("If", ["c"], ["d"], then_branch=branch, else_branch=branch)
        ),
        "sparse weights": lambda proto: proto.graph.sparse_initializer.append(sparse),
        "function": lambda proto: proto.functions.append(function),
    }
    for name, add in additions.items():
        proto = onnx.load(path)
        add(proto)
        changed = tmp_path / f"{name}.onnx"
        changed.write_bytes(proto.SerializeToString())
        refused(changed, "outside the file")


def test_metadata_are_read_and_a_contract_in_them_comes_first(tmp_path, model):
    assert open_model(model).told.metadata == {}
    told(model, udp="true", source="a lab", input_w="1", cigpose_meta='{"input_w": 192, "split_ratio": 2.0}')
    assert open_model(model).told.metadata == {
        "udp": True,
        "source": "a lab",
        "input_w": 192,
        "split_ratio": 2.0,
    }
    told(model, cigpose_meta="[1]")
    refused(model, "expected a JSON object")


def test_a_network_with_other_inputs_is_refused(tmp_path):
    nodes = [helper.make_node("Add", ["a", "b"], ["c"])]
    path = save(tmp_path / "two.onnx", nodes, {"a": [1], "b": [1]}, {"c": [1]}, {})
    refused(path, "one input")
    nodes = [helper.make_node("Identity", ["a"], ["c"])]
    path = save(tmp_path / "ints.onnx", nodes, {"a": [1]}, {"c": [1]}, {}, dtype=TensorProto.INT64)
    refused(path, "floating point")


def test_an_unknown_provider_names_those_there_are(model):
    refused(model, f"expected one of: {', '.join(available_providers())}", provider="quantum")


def test_cuda_that_turns_out_to_be_cpu_is_an_error(model, monkeypatch):
    if "CUDAExecutionProvider" not in onnxruntime.get_available_providers():
        refused(model, "'cuda' is not available", provider="cuda")
        # A build that has CUDA on a machine without its libraries falls back without a word.
        both = ["CUDAExecutionProvider", "CPUExecutionProvider"]
        monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: both)

        class FallsBack:
            def __init__(self, content, options, providers):
                assert providers == ["CUDAExecutionProvider"]

            def get_providers(self):
                return ["CPUExecutionProvider"]

        monkeypatch.setattr(onnxruntime, "InferenceSession", FallsBack)
        refused(model, "cuda was asked for.*CPUExecutionProvider would run", provider="cuda")


def test_an_input_the_network_fails_on_is_one_line(model):
    with pytest.raises(InputError, match="failed on an input of shape") as caught:
        open_model(model).run(np.zeros((1, 3, 9, 9), np.float32))
    assert "\n" not in str(caught.value)
