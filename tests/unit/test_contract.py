"""The contract explains itself: every published field has its comment, and the reference page is made of them."""

import re

import pytest
from google.protobuf.descriptor import Descriptor, EnumDescriptor

from integrity.messages import wayside_pb2 as pb
from tests.golden.contract import contract_lines, described
from tests.golden.proto_text import PROTO, Block, Field, published, read_proto
from tests.golden.reference import PAGE, page

BLOCKS = read_proto(PROTO.read_text("utf-8"))
EACH = pytest.mark.parametrize("of", published(), ids=lambda of: of.name)


@EACH
def test_every_published_message_has_a_comment(of: Descriptor | EnumDescriptor) -> None:
    assert BLOCKS[of.name].comment


@EACH
def test_every_published_field_has_a_comment(of: Descriptor | EnumDescriptor) -> None:
    assert [field.name for field in BLOCKS[of.name].fields if not field.comment] == []


@pytest.mark.parametrize("of", [of for of in published() if isinstance(of, Descriptor)], ids=lambda of: of.name)
def test_every_optional_field_says_what_its_absence_means(of: Descriptor) -> None:
    optional = [field for field in BLOCKS[of.name].fields if field.label == "optional"]
    assert [field.name for field in optional if "absent" not in field.comment] == []


@pytest.mark.parametrize("of", [of for of in published() if isinstance(of, Descriptor)], ids=lambda of: of.name)
def test_every_list_says_what_it_means_to_be_empty(of: Descriptor) -> None:
    """But for those that never are: the receivers of a station and its checks; and the one that goes along with another list."""
    always = {"triangle", "checks", "monitored_signals"}
    lists = [field for field in BLOCKS[of.name].fields if field.label == "repeated" and field.name not in always]
    assert [field.name for field in lists if "empty" not in field.comment] == []


UNITS = {"_ns": "ns", "_ms": "ms", "_m": "m"}


@pytest.mark.parametrize("of", [of for of in published() if isinstance(of, Descriptor)], ids=lambda of: of.name)
def test_every_unit_in_a_name_is_said_again(of: Descriptor) -> None:
    wanted = [(f.name, unit, f.comment) for f in BLOCKS[of.name].fields for end, unit in UNITS.items() if f.name.endswith(end)]
    assert [name for name, unit, comment in wanted if not re.search(rf"\b{unit}\b", comment)] == []


def test_the_file_and_the_module_made_of_it_agree() -> None:
    """Without protoc: numbers, names, types and labels as written are those of the descriptor."""
    written = {
        f"{block.name} {f.number} {f.name} {f.type} {f.label}".rstrip()
        for block in BLOCKS.values()
        for f in block.fields
        if not f.type.startswith("map<")
    }
    fields = {line for line in contract_lines(described()) if not re.search(r"Entry\b|reserved$", line)}
    assert written == {re.sub(r"  +", " ", line) for line in fields}


def test_the_reference_page_is_the_one_that_the_contract_gives() -> None:
    assert PAGE.read_text("utf-8") == page(), "run python -m tests.golden.reference"


def test_a_comment_above_a_field_and_one_beside_it_are_read_as_one() -> None:
    text = "// Of a thing.\nmessage Thing {\n  // First.\n  optional double a_m = 1;  // m\n\n  string b = 2;\n  reserved 3;\n}\n"
    fields = [Field(1, "a_m", "optional", "double", "First. m"), Field(2, "b", "", "string", "")]
    assert read_proto(text) == {"Thing": Block("Thing", "Of a thing.", fields)}


def test_a_line_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="expected a field on one line"):
        read_proto("message Thing {\n  oneof x {\n")


def test_what_is_signed_is_published_too() -> None:
    assert {pb.Health.DESCRIPTOR, pb.ChallengeReply.DESCRIPTOR, pb.SignedHealth.DESCRIPTOR} <= set(published())
