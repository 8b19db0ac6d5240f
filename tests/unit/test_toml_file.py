import pickle
import tomllib
from pathlib import Path

import pytest

from recordings.toml_file import ConfigProblems, Problem, did_you_mean, dotted, format_toml, parse_toml, read_toml, split_key

TANGLED = '''\
# [not.a.table]
title = "a # b = [c"             # a comment with "quotes" and [brackets]
"quoted key".plain = 'x'

[receivers.A]
position = [
    1.0,  # [no.table]
    2.0,
]
text = """
[no.table]
no_key = 1 \\"""
still = "inside"""" # "["
raw = \'\'\'
no_key = 2\'\'\'
last.deep = 3
[[fault]]
kind = "satellite_step"
[fault.truth]
size_m = 1.0
[[fault.stage]]
at_s = 1
[[fault.stage]]
at_s = 2
[[fault]]
kind = { name = "inline", list = [1, 2] }
[fault.truth]
size_m = 2.0
["dotted.name".B]
key = 1
'''


@pytest.mark.parametrize(
    ("key", "line"),
    [
        ("title", 2),
        ('"quoted key"', 3),
        ('"quoted key".plain', 3),
        ("receivers", 5),
        ("receivers.A", 5),
        ("receivers.A.position", 6),
        ("receivers.A.text", 10),
        ("receivers.A.raw", 14),
        ("receivers.A.last.deep", 16),
        ("fault", 17),
        ("fault.0.kind", 18),
        ("fault.0.truth.size_m", 20),
        ("fault.0.stage.0.at_s", 22),
        ("fault.0.stage.1.at_s", 24),
        ("fault.1", 25),
        ("fault.1.kind", 26),
        ("fault.1.truth.size_m", 28),
        ('"dotted.name".B.key', 30),
    ],
)
def test_line_of_each_key(key: str, line: int) -> None:
    assert parse_toml(TANGLED, "x.toml").lines[key] == line


def test_strings_arrays_and_comments_hold_no_keys() -> None:
    lines = parse_toml(TANGLED, "x.toml").lines
    assert not [key for key in lines if "no_key" in key or "no.table" in key or "still" in key]


@pytest.mark.parametrize(
    ("parts", "line"),
    [(("fault", "1", "kind", "name"), 26), (("receivers", "A", "missing"), 5), (("receivers", "B", "x"), 5), (("absent", "key"), None)],
)
def test_a_key_without_a_line_of_its_own_has_that_of_what_is_around_it(parts: tuple[str, ...], line: int | None) -> None:
    assert parse_toml(TANGLED, "x.toml").line_of(*parts) == line


def test_windows_line_ends_and_byte_order_mark_change_no_line() -> None:
    document = parse_toml("\ufeff" + TANGLED.replace("\n", "\r\n"), "x.toml")
    assert document.lines == parse_toml(TANGLED, "x.toml").lines


@pytest.mark.parametrize(
    ("text", "line", "key", "value"),
    [
        ("a = 1\nrule = full\n", 2, "rule", "full"),
        ("[site]\nepoch = 2011,4\n", 2, "site.epoch", "2011,4"),
        ('[site]\nid = "x\nepoch = 1\n', 2, "site.id", '"x'),
        ("[site\nid = 1\n", 1, "site", ""),
        ("\n\n= 3\n", 3, "", "= 3"),
        ("a = 1\nb = [\n 1,\n 2\nc = 3\n", 5, "b", "[ 1, 2 c = 3"),
        ('a = 1\nb = """never\nends\n', 2, "b", '"""never ends'),
    ],
)
def test_a_syntax_error_has_its_line_key_and_value(text: str, line: int, key: str, value: str) -> None:
    with pytest.raises(ConfigProblems) as caught:
        parse_toml(text, "x.toml")
    (problem,) = caught.value.problems
    assert (problem.line, problem.key, problem.value) == (line, key, value)


def test_a_control_character_in_a_comment_is_found_in_the_line_of_the_comment() -> None:
    with pytest.raises(ConfigProblems, match=r"^x\.toml:2: # bell"):
        parse_toml("a = 1\n# bell \x07\n", "x.toml")


def test_a_syntax_error_inside_a_long_value_names_the_line_where_it_begins() -> None:
    with pytest.raises(ConfigProblems, match=r"^x\.toml:4: b = .* in what begins in line 2"):
        parse_toml("a = 1\nb = [\n 1,\n 2 3\n]\n", "x.toml")


def test_every_repeated_key_and_table_is_reported() -> None:
    with pytest.raises(ConfigProblems) as caught:
        parse_toml("[a]\nx = 1\ny = 2\nx = 3\n[b]\n[a]\n", "x.toml")
    assert str(caught.value) == (
        "x.toml:4: a.x = 3: stands twice, first in line 2: keep one of them\nx.toml:6: a: stands twice, first in line 1: keep one of them"
    )


def test_a_syntax_error_is_reported_beside_a_repeated_key() -> None:
    with pytest.raises(ConfigProblems) as caught:
        parse_toml("y = oops\nx = 1\nx = 3\n", "x.toml")
    assert [problem.line for problem in caught.value.problems] == [1, 3]


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigProblems, match="cannot be read \\(No such file or directory\\)"):
        read_toml(tmp_path / "none.toml")


def test_a_file_that_is_not_utf8(tmp_path: Path) -> None:
    (tmp_path / "latin.toml").write_bytes(b'a = 1\nb = "\xe9"\n')
    with pytest.raises(ConfigProblems, match=r"latin\.toml:2: byte 0xe9 is not UTF-8"):
        read_toml(tmp_path / "latin.toml")


def test_a_problem_reads_as_one_line() -> None:
    problem = Problem("site.toml", 12, "integrity.rule", '"ful"', 'expected "full" or "triangle"')
    assert str(problem) == 'site.toml:12: integrity.rule = "ful": expected "full" or "triangle"'


def test_a_problem_without_line_key_and_value() -> None:
    assert str(Problem("site.toml", None, "", "", "cannot be read")) == "site.toml: cannot be read"


def test_problems_stand_by_line_those_without_one_last() -> None:
    found = [Problem("x", line, key, "", "m") for line, key in ((None, "d"), (7, "b"), (2, "a"), (7, "c"))]
    assert [problem.key for problem in ConfigProblems(found).problems] == ["a", "b", "c", "d"]


def test_problems_cross_to_another_process_whole() -> None:
    error = ConfigProblems([Problem("x", 1, "a", "1", "m")], [Problem("x", 2, "b", "1", "w")])
    copy = pickle.loads(pickle.dumps(error))
    assert (copy.problems, copy.warnings) == (error.problems, error.warnings)


@pytest.mark.parametrize(
    ("value", "shown"), [("ntrip://user:pa:ss@host:1/M", '"ntrip://user:***@host:1/M"'), ("tcp://host:1", '"tcp://host:1"')]
)
def test_a_password_is_not_repeated_in_a_problem(value: str, shown: str) -> None:
    document = parse_toml(f'source = "{value}"\n', "x.toml")
    assert document.problem(("source",), "m").value == shown


def test_a_password_is_not_repeated_in_a_syntax_error() -> None:
    with pytest.raises(ConfigProblems) as caught:
        parse_toml("source = ntrip://user:secret@host:1/M\n", "x.toml")
    assert "secret" not in str(caught.value)


def test_a_long_value_is_cut() -> None:
    document = parse_toml(f'key = "{"x" * 500}"\n', "x.toml")
    assert len(document.problem(("key",), "m").value) == 100


@pytest.mark.parametrize(("word", "hint"), [("ful", '; did you mean "full"?'), ("FULL", '; did you mean "full"?'), ("zzz", "")])
def test_did_you_mean(word: str, hint: str) -> None:
    assert did_you_mean(word, ("full", "triangle")) == hint


def test_split_key_and_dotted_are_inverse() -> None:
    parts, rest = split_key("""a . "b.c\\u00e9" .'d e'= 1""")
    assert (parts, rest, split_key(dotted(parts))[0]) == (("a", "b.cé", "d e"), "= 1", parts)


def test_formatted_toml_parses_to_the_same_values() -> None:
    values = {
        "top": True,
        "site": {"id": 'q"\\\n\x7f\u3042', "epoch": 2011.4, "n": 3, "p": 1e-05, "big": 1e22, "empty": [], "list": ["a", 1.5]},
        "receivers": {"A": {"x.y": [1.0, -2.0]}, "B": {}},
        "fault": [{"kind": "x", "truth": {"size_m": 1.0}}],
    }
    assert tomllib.loads(format_toml(values)) == values
