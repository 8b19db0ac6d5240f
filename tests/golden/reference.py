"""The reference page beside `wayside.proto`: the guide, then every published message from its descriptor and its comments.

After a change of either: `python -m tests.golden.reference`.
"""

from pathlib import Path

from google.protobuf.descriptor import EnumDescriptor

from tests.golden.proto_text import PROTO, Block, Field, published, read_proto

PAGE = PROTO.with_name("REFERENCE.md")
GUIDE = Path(__file__).with_name("reference_guide.md")


def page() -> str:
    """The whole page."""
    text = PROTO.read_text("utf-8")
    blocks = read_proto(text)
    linked = {of.name for of in published()}
    parts = [GUIDE.read_text("utf-8"), f"## Rules\n\n{_rules(text)}\n"]
    for of in published():
        block = blocks[of.name]
        parts.append(_enum(block) if isinstance(of, EnumDescriptor) else _message(block, linked))
    return "\n".join(parts)


def _rules(text: str) -> str:
    """What stands above everything in the file."""
    lines = [line.removeprefix("//").strip() for line in text.partition("syntax =")[0].splitlines()]
    return "\n".join(lines).strip()


def _message(block: Block, linked: set[str]) -> str:
    rows = [f"| {of.number} | `{of.name}` | {_type(of, linked)} | {_cell(of.comment)} |" for of in _sorted(block)]
    return "\n".join([f"## {block.name}", "", block.comment, "", "| | field | type | meaning |", "|---|---|---|---|", *rows, ""])


def _enum(block: Block) -> str:
    rows = [f"| {of.number} | `{of.name}` | {_cell(of.comment)} |" for of in _sorted(block)]
    return "\n".join([f"## {block.name}", "", block.comment, "", "| | value | meaning |", "|---|---|---|", *rows, ""])


def _sorted(block: Block) -> list[Field]:
    return sorted(block.fields, key=lambda of: of.number)


def _type(of: Field, linked: set[str]) -> str:
    name = f"[{of.type}](#{of.type.lower()})" if of.type in linked else of.type
    return f"{of.label} {name}".strip()


def _cell(comment: str) -> str:
    return comment.replace("|", "\\|")


if __name__ == "__main__":
    PAGE.write_text(page(), "utf-8")
