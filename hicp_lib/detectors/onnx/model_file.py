"""Properties of a network that an ONNX file states, read without running it; truncated files are refused."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from google.protobuf.message import DecodeError, Message
from onnx import GraphProto, ModelProto, TensorProto

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import json_or_text

# Under this name exporters store what a network expects, as a JSON object.
_CONTRACT = "cigpose_meta"
_MOST_NODES = 20_000  # published networks have up to 5,000


@dataclass(frozen=True)
class ModelFile:
    """Properties of a network according to its file.

    Attributes
    ----------
    operators : frozenset of str
        The kinds of nodes in its graph.
    first_convolution : tuple of int
        Shape of the first convolution's weights, (out, in, h, w); empty if there is none.
    metadata : dict
        Its exporter's metadata, by name; a contract is replaced by its entries.
    """

    operators: frozenset[str]
    first_convolution: tuple[int, ...]
    metadata: dict[str, Any]


def read_model(path: Path, content: bytes) -> ModelFile:
    """Read the properties of a network from an ONNX file.

    Parameters
    ----------
    path : Path
        For messages.
    content : bytes

    Raises
    ------
    InputError
        If it is not an ONNX file, keeps weights in a second file, or its contract is not a JSON object.
    """
    try:
        model = ModelProto.FromString(content)
    except DecodeError:
        raise InputError(
            f"{path}: is not an ONNX file or is cut off ({len(content)} bytes); get it again, or export it"
        ) from None
    if (n := len(model.graph.node)) > _MOST_NODES:
        raise InputError(f"{path}: has {n} nodes; expected a network of up to {_MOST_NODES}")
    # A second file would be read relative to the working folder, and no hash would cover its content.
    outside = next(
        (tensor for tensor in _tensors(model) if tensor.data_location or tensor.external_data), None
    )
    if outside is not None:
        file = next((entry.value for entry in outside.external_data if entry.key == "location"), "?")
        raise InputError(
            f"{path}: keeps weights outside the file ({outside.name or 'a constant'} in {file!r}), which are "
            "not read; export it in one file: torch.onnx.export(..., external_data=False), or load it with "
            "onnx.load and save it with onnx.save"
        )
    operators = frozenset(node.op_type for node in model.graph.node)
    written = {entry.key: entry.value for entry in model.metadata_props}
    return ModelFile(operators, _first_convolution(model.graph), _metadata(path, written))


def _tensors(message: Message) -> Iterator[TensorProto]:
    """Every tensor in a message: in graphs, attributes of nodes, and nested graphs."""
    if isinstance(message, TensorProto):
        yield message
        return
    for field, value in message.ListFields():
        if field.message_type is not None:
            for part in [value] if isinstance(value, Message) else value:
                yield from _tensors(part)


def _first_convolution(graph: GraphProto) -> tuple[int, ...]:
    dims = {tensor.name: tuple(tensor.dims) for tensor in graph.initializer}
    weights = [node.input[1] for node in graph.node if node.op_type == "Conv" and len(node.input) > 1]
    return next((dims[name] for name in weights if len(dims.get(name, ())) > 1), ())


def _metadata(path: Path, written: dict[str, str]) -> dict[str, Any]:
    values = {name: json_or_text(text) for name, text in written.items()}
    contract = values.pop(_CONTRACT, {})
    if not isinstance(contract, dict):
        raise InputError(f"{path}: its metadata {_CONTRACT} is {contract!r}; expected a JSON object")
    return values | contract
