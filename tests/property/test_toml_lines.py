"""Whatever a file holds, each key is found in the line that it was written in, and any text is either parsed or refused."""

import tomllib
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from recordings.toml_file import ConfigProblems, dotted, format_toml, format_value, parse_toml

names = st.text("ab.'\"[]#= \\é", min_size=1, max_size=4)
texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
scalars = texts | st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False)
values = scalars | st.lists(scalars, max_size=3)
tables = st.dictionaries(names, st.dictionaries(names, values, max_size=4), max_size=4)
layouts = st.sampled_from(["\n", "\n\n", " # [c] = \"x\" '''\n", "\n# k = [\n"])


@given(tables, st.data())
def test_every_key_is_found_in_its_line(tables: dict[str, dict[str, Any]], data: st.DataObject) -> None:
    text, expected = "", {}
    for name, table in tables.items():
        expected[dotted([name])] = text.count("\n") + 1
        text += f"[{dotted([name])}]" + data.draw(layouts)
        for key, value in table.items():
            expected[dotted([name, key])] = text.count("\n") + 1
            written = format_value(value)
            if isinstance(value, list):
                written = "[\n" + "".join(f"  {format_value(element)}, # ]\n" for element in value) + "]"
            elif isinstance(value, str) and "'" not in value and value.isprintable():
                written = f"'''\n{value}\n[x]\nk = 1'''"
            text += f"{dotted([key])} = {written}" + data.draw(layouts)
    assert parse_toml(text, "x.toml").lines == expected


@given(tables)
def test_formatting_then_parsing_is_identity(tables: dict[str, dict[str, Any]]) -> None:
    assert tomllib.loads(format_toml(tables)) == tables


@given(st.text("ab=.\n\"'[]{}#,1 \\\r\t", max_size=60))
def test_any_text_is_parsed_as_tomllib_does_or_refused_with_a_line(text: str) -> None:
    try:
        document = parse_toml(text, "x.toml")
    except ConfigProblems as error:
        assert all(problem.line is not None and 1 <= problem.line <= text.count("\n") + 1 for problem in error.problems)
    else:
        assert document.values == tomllib.loads(text)
