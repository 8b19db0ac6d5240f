"""Within v1 the contract only grows: whatever a reader of an older version knows stays as it is."""

from collections.abc import Callable

import pytest
from google.protobuf.descriptor_pb2 import DescriptorProto, EnumDescriptorProto, FieldDescriptorProto, FileDescriptorProto

from tests.golden.contract import RENEW, broken_lines, committed_lines, contract_lines, described, renewed


def test_nothing_that_was_promised_is_gone_or_changed() -> None:
    assert broken_lines(committed_lines(), contract_lines(described())) == []


def test_what_is_new_has_been_promised() -> None:
    assert sorted(set(contract_lines(described())) - set(committed_lines())) == [], f"additive? Then run {RENEW}"


def health(file: FileDescriptorProto) -> DescriptorProto:
    return next(message for message in file.message_type if message.name == "Health")


def valid_for_ms(file: FileDescriptorProto) -> FieldDescriptorProto:
    return next(field for field in health(file).field if field.name == "valid_for_ms")


def state(file: FileDescriptorProto) -> EnumDescriptorProto:
    return next(enum for enum in file.enum_type if enum.name == "State")


def swap(enum: EnumDescriptorProto) -> None:
    """NORMAL takes the number of SATELLITE_ANOMALY, and the other way round."""
    enum.value[1].number, enum.value[2].number = enum.value[2].number, enum.value[1].number


BREAKS: dict[str, Callable[[FileDescriptorProto], object]] = {
    "a message is removed": lambda file: file.message_type.remove(health(file)),
    "a field is removed": lambda file: health(file).field.remove(valid_for_ms(file)),
    "a field is renumbered": lambda file: setattr(valid_for_ms(file), "number", 100),
    "a field is renamed": lambda file: setattr(valid_for_ms(file), "name", "valid_for_s"),
    "a field is of another type": lambda file: setattr(valid_for_ms(file), "type", FieldDescriptorProto.TYPE_SINT32),
    "a field becomes optional": lambda file: setattr(valid_for_ms(file), "proto3_optional", True),
    "a field becomes repeated": lambda file: setattr(valid_for_ms(file), "label", FieldDescriptorProto.LABEL_REPEATED),
    "a field is of another message": lambda file: setattr(
        next(f for f in health(file).field if f.name == "state"), "type_name", ".wayside.v1.Cause"
    ),
    "a value is removed": lambda file: state(file).value.pop(),
    "a value is renumbered": lambda file: setattr(state(file).value[1], "number", 9),
    "a value is renamed": lambda file: setattr(state(file).value[1], "name", "OK"),
    "two values change places": lambda file: swap(state(file)),
    "a reserved number is given away": lambda file: health(file).reserved_range.pop(),
}


@pytest.mark.parametrize("change", BREAKS.values(), ids=BREAKS)
def test_a_change_that_is_not_additive_is_refused(change: Callable[[FileDescriptorProto], object]) -> None:
    file = described()
    change(file)
    with pytest.raises(ValueError, match="not additive"):
        renewed(contract_lines(described()), contract_lines(file))


ADDS: dict[str, Callable[[FileDescriptorProto], object]] = {
    "Health 22 region string": lambda file: health(file).field.add(
        name="region", number=22, type=FieldDescriptorProto.TYPE_STRING, label=FieldDescriptorProto.LABEL_OPTIONAL
    ),
    "State 4 DEGRADED": lambda file: state(file).value.add(name="DEGRADED", number=4),
}


@pytest.mark.parametrize("line, change", ADDS.items(), ids=ADDS)
def test_an_additive_change_is_one_line_more(line: str, change: Callable[[FileDescriptorProto], object]) -> None:
    before, file = contract_lines(described()), described()
    change(file)
    after = renewed(before, contract_lines(file)).splitlines()
    assert sorted(set(after) - set(before)) == [line]
