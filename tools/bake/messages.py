"""Protobuf messages with only the fields that are needed; a parser ignores the others."""

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import Message

Messages = dict[str, dict[str, tuple[int, str]]]
"""Message -> field -> (number, type); a type in brackets is a list of it."""


def message_class(messages: Messages, name: str) -> type[Message]:
    """The class of the message `name`, whose fields may be others of `messages`."""
    kinds = descriptor_pb2.FieldDescriptorProto
    file = descriptor_pb2.FileDescriptorProto(name="declared.proto", package="hicp", syntax="proto3")
    for message_name, fields in messages.items():
        message = file.message_type.add(name=message_name)
        for field_name, (number, kind) in fields.items():
            label = kinds.LABEL_REPEATED if kind.startswith("[") else kinds.LABEL_OPTIONAL
            field = message.field.add(name=field_name, number=number, label=label)
            kind = kind.strip("[]")
            if kind in messages:
                field.type, field.type_name = kinds.TYPE_MESSAGE, f".hicp.{kind}"
            else:
                field.type = getattr(kinds, f"TYPE_{kind.upper()}")
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(f"hicp.{name}"))
