"""What stands in `wayside.proto`: each message and enum with its fields and, which no descriptor holds, its comments.

It reads the plain style of that file: nothing nested, one field per line, comments in lines of their own above or at the end of the line.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

from google.protobuf.descriptor import Descriptor, EnumDescriptor

from integrity.messages import wayside_pb2 as pb

PROTO = Path(pb.__file__).with_name("wayside.proto")
# What goes over the air, with what is signed within bytes.
PUBLISHED = ("SignedHealth", "Health", "SignedChallengeReply", "ChallengeReply", "EpochReport", "Alert", "SiteInfo", "TrainPosition")

_BLOCK = re.compile(r"(message|enum) (\w+) \{")
_FIELD = re.compile(r"  (?:(optional|repeated) )?(?:(map<\w+, \w+>|\w+) )?(\w+) = (\d+);(?: *// (.*))?")
_COMMENT = re.compile(r" *//(?: (.*))?")


@dataclass(frozen=True)
class Field:
    """One line: a field, or a value of an enum, whose `label` and `type` are empty."""

    number: int
    name: str
    label: str
    type: str
    comment: str


@dataclass(frozen=True)
class Block:
    """A message or an enum, its fields as they stand there."""

    name: str
    comment: str
    fields: list[Field] = field(default_factory=list)


def read_proto(text: str) -> dict[str, Block]:
    """The blocks of a file by name. Raises ValueError for a line within a block that is none of a kind that it knows."""
    blocks: dict[str, Block] = {}
    block: Block | None = None
    above: list[str] = []
    for line in text.splitlines():
        begins, stands, says = _BLOCK.fullmatch(line), _FIELD.fullmatch(line), _COMMENT.fullmatch(line)
        if says:
            above.append(says[1] or "")
            continue
        if begins:
            block = blocks[begins[2]] = Block(begins[2], " ".join(above))
        elif line == "}":
            block = None
        elif block and stands:
            comment = " ".join([*above, *([stands[5]] if stands[5] else [])])
            block.fields.append(Field(int(stands[4]), stands[3], stands[1] or "", stands[2] or "", comment))
        elif block and line.strip() and not line.startswith("  reserved "):
            raise ValueError(f"{line!r}: expected a field on one line, as in '  optional double sigma_m = 9;  // metres'")
        above = []
    return blocks


def published() -> list[Descriptor | EnumDescriptor]:
    """What is published and all that it consists of: each message is followed by what it brings, enums come last."""
    found: list[Descriptor] = []
    enums: dict[str, EnumDescriptor] = {}

    def visit(message: Descriptor) -> None:
        if message in found:
            return
        found.append(message)
        for part in message.fields:
            if part.enum_type is not None:
                enums[part.enum_type.name] = part.enum_type
            if part.message_type is not None:
                visit(part.message_type)

    for name in PUBLISHED:
        visit(pb.DESCRIPTOR.message_types_by_name[name])
    return [*found, *enums.values()]
