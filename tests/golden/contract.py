"""The contract as text, a line per field and enum value, and whether a change of it is additive.

After an additive change of `wayside.proto`: `python -m tests.golden.contract`. It refuses any other.
"""

from pathlib import Path

from google.protobuf.descriptor_pb2 import DescriptorProto, FieldDescriptorProto, FileDescriptorProto

from integrity.messages import wayside_pb2 as pb

CONTRACT = Path(__file__).with_name("contract.txt")
RENEW = "python -m tests.golden.contract"


def described() -> FileDescriptorProto:
    """The contract as the committed module has it."""
    file = FileDescriptorProto()
    pb.DESCRIPTOR.CopyToProto(file)
    return file


def contract_lines(file: FileDescriptorProto) -> list[str]:
    """`Health 3 sequence uint64` for each field, by message and number; `State 1 NORMAL` for each value of an enum.

    `optional` and `repeated` stand at the end: they change what absence means, as a type changes what bytes mean.
    """
    rows = [(message.name, field.number, field.name, _type(field)) for message in _messages(file) for field in message.field]
    rows += [(enum.name, value.number, value.name, "") for enum in file.enum_type for value in enum.value]
    rows += [
        (message.name, n, "reserved", "")
        for message in file.message_type
        for gap in message.reserved_range
        for n in range(gap.start, gap.end)
    ]
    return [f"{of} {number} {name} {kind}".rstrip() for of, number, name, kind in sorted(rows)]


def broken_lines(before: list[str], now: list[str]) -> list[str]:
    """What was promised and holds no longer: each of these makes a reader of today fail, or worse, misread."""
    return sorted(set(before) - set(now))


def renewed(before: list[str], now: list[str]) -> str:
    """The text to commit. Raises ValueError for a change that is not additive."""
    broken = broken_lines(before, now)
    if broken:
        raise ValueError(f"not additive: within v1 nothing of the contract goes, moves or changes, but these did: {'; '.join(broken)}")
    return "\n".join(now) + "\n"


def committed_lines() -> list[str]:
    """What has been promised."""
    return CONTRACT.read_text("utf-8").splitlines() if CONTRACT.exists() else []


def _messages(file: FileDescriptorProto) -> list[DescriptorProto]:
    """With the entries of maps, which protobuf keeps as messages within messages."""
    nested = [DescriptorProto(name=f"{m.name}.{n.name}", field=n.field) for m in file.message_type for n in m.nested_type]
    return [*file.message_type, *nested]


def _type(field: FieldDescriptorProto) -> str:
    name = field.type_name.rpartition("wayside.v1.")[2] or FieldDescriptorProto.Type.Name(field.type).removeprefix("TYPE_").lower()
    label = "repeated" if field.label == FieldDescriptorProto.LABEL_REPEATED else "optional" if field.proto3_optional else ""
    return f"{name} {label}".rstrip()


if __name__ == "__main__":
    CONTRACT.write_text(renewed(committed_lines(), contract_lines(described())), "utf-8")
