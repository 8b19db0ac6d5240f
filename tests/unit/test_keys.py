"""Private keys that stay private, and files of trusted keys that are refused whole."""

import os
import stat
from datetime import date, timedelta
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric import ed25519, rsa
from cryptography.hazmat.primitives.serialization import BestAvailableEncryption, Encoding, NoEncryption, PrivateFormat
from hypothesis import given
from hypothesis import strategies as st

from integrity.errors import ConfigError
from integrity.messages import wayside_pb2 as pb
from integrity.messages.signatures import key_id
from recordings.keys import KeyDates, TrustedKey, keys_of, load_key, new_key, read_trusted, trusted_table
from recordings.toml_file import ConfigProblems
from wayside import run

PUBLIC = bytes(range(32))


def test_a_new_key_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / "keys" / "kokubunji-1.pem"
    made = new_key(path)
    assert load_key(path).public == made.public


def test_only_its_owner_may_touch_a_new_key_whatever_the_umask(tmp_path: Path) -> None:
    path = tmp_path / "keys" / "kokubunji-1.pem"
    before = os.umask(0)
    try:
        new_key(path)
    finally:
        os.umask(before)
    assert [stat.S_IMODE(p.stat().st_mode) for p in (path, path.parent)] == [0o600, 0o700]


def test_no_key_is_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "a.pem"
    path.write_bytes(b"precious")
    with pytest.raises(ConfigError, match="is there already"):
        new_key(path)
    assert path.read_bytes() == b"precious"


@pytest.mark.parametrize("mode", [0o640, 0o620, 0o604, 0o602, 0o666])
def test_a_key_that_others_may_touch_is_refused_with_the_remedy(tmp_path: Path, mode: int) -> None:
    path = tmp_path / "a.pem"
    new_key(path)
    path.chmod(mode)
    with pytest.raises(ConfigError, match=rf"mode {mode:o} .*run `chmod 600 {path}`"):
        load_key(path)


@pytest.mark.parametrize("mode", [0o600, 0o400, 0o700])
def test_a_key_that_others_may_not_touch_is_taken(tmp_path: Path, mode: int) -> None:
    path = tmp_path / "a.pem"
    made = new_key(path)
    path.chmod(mode)
    assert load_key(path).key_id == made.key_id


def _of_another_kind() -> bytes:
    return rsa.generate_private_key(65537, 2048).private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())


def _with_a_password() -> bytes:
    private = ed25519.Ed25519PrivateKey.generate()
    return private.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, BestAvailableEncryption(b"secret"))


@pytest.mark.parametrize(
    "pem, why",
    [(_of_another_kind, "of another kind"), (_with_a_password, "cannot be used"), (lambda: b"", "cannot be used")],
    ids=["rsa", "password", "empty"],
)
def test_a_file_that_is_no_ed25519_key_is_refused(tmp_path: Path, pem: object, why: str) -> None:
    path = tmp_path / "a.pem"
    assert callable(pem)
    path.write_bytes(pem())
    path.chmod(0o600)
    with pytest.raises(ConfigError, match=f"{why}.*expected an Ed25519 private key"):
        load_key(path)


def test_a_key_that_is_not_there_is_refused_with_the_remedy(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=f"wayside keys new {tmp_path}/a.pem"):
        load_key(tmp_path / "a.pem")


def test_a_site_may_have_two_keys(tmp_path: Path) -> None:
    path = tmp_path / "trusted.toml"
    path.write_text("# keys\n" + trusted_table("north-1", PUBLIC) + trusted_table("south", PUBLIC) + trusted_table("north-1", PUBLIC[::-1]))
    assert read_trusted(path) == {"north-1": (TrustedKey(PUBLIC), TrustedKey(PUBLIC[::-1])), "south": (TrustedKey(PUBLIC),)}


def test_everything_wrong_with_trusted_keys_is_said_at_once(tmp_path: Path) -> None:
    path = tmp_path / "trusted.toml"
    sound, placeholder, short = PUBLIC.hex(), "00" * 32, "ab" * 31
    path.write_text(
        f'[[key]]\nsite = "north-1"\npublic = "{sound}"\n'
        f'[[key]]\nsite = "north-1"\npublic = "{sound.upper()}"\n'
        f'[[key]]\nsite = "a/b"\npublic = "{short}"\n'
        f'[[key]]\nsite = "c"\npublic = "{placeholder}"\n'
        f'[[key]]\nsites = "d"\npublic = "{sound}"\n'
        "[extra]\n"
    )
    with pytest.raises(ConfigProblems) as refused:
        read_trusted(path)
    assert [(p.line, p.key, p.message.split(":")[0]) for p in refused.value.problems] == [
        (6, "key.1.public", "stands twice for site north-1"),
        (8, "key.2.site", "expected the id of a site"),
        (9, "key.2.public", "expected 64 hex digits, as `wayside keys new` and `wayside keys show` print them"),
        (12, "key.3.public", "is a placeholder, no key"),
        (13, "key.4.site", "expected the id of a site"),
        (14, "key.4.sites", "no such key"),
        (16, "extra", "no such key here"),
    ]


@pytest.mark.parametrize("text", ["", "key = 1\n", "key = [1]\n", '[key]\nsite = "a"\n'])
def test_a_file_without_tables_of_keys_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "trusted.toml"
    path.write_text(text)
    with pytest.raises(ConfigProblems, match=r"expected one table \[\[key\]\] or more"):
        read_trusted(path)


def test_a_site_without_a_key_is_named_with_those_that_have_one() -> None:
    with pytest.raises(ConfigError, match=r'site nort-1; did you mean "north-1"\? \(there are keys for north-1\)'):
        keys_of({"north-1": (TrustedKey(PUBLIC),)}, "nort-1", Path("trusted.toml"))


def test_what_the_commands_print_is_a_file_of_trusted_keys(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, trusted = tmp_path / "keys" / "north-1.pem", tmp_path / "trusted.toml"
    codes = [run(["keys", "new", str(path)]), run(["keys", "show", str(path), "--site", "south"])]
    trusted.write_text(capsys.readouterr().out)
    public = TrustedKey(load_key(path).public)
    assert (codes, read_trusted(trusted)) == ([0, 0], {"north-1": (public,), "south": (public,)})


@pytest.mark.parametrize("command", ["new", "show"])
def test_a_name_that_is_no_site_is_refused_before_anything_is_written(tmp_path: Path, command: str) -> None:
    path = tmp_path / "north 1.pem"
    assert (run(["keys", command, str(path)]), path.exists()) == (2, False)


DAY = date(2027, 4, 1)


@pytest.mark.parametrize(
    "not_before, not_after, counts",
    [
        (None, None, True),
        (DAY, None, True),
        (DAY + timedelta(1), None, False),
        (None, DAY, True),
        (None, DAY - timedelta(1), False),
        (DAY, DAY, True),
        (date.min, date.max, True),
    ],
)
def test_a_key_counts_from_its_first_day_to_its_last(not_before: date | None, not_after: date | None, counts: bool) -> None:
    assert (TrustedKey(PUBLIC, not_before, not_after).refusal(DAY) == "") == counts


def test_dates_are_read_and_are_optional(tmp_path: Path) -> None:
    path = tmp_path / "trusted.toml"
    path.write_text(
        trusted_table("a", PUBLIC) + "not_after = 2027-03-31\n" + trusted_table("a", PUBLIC[::-1]) + "not_before = 2027-03-01\n"
    )
    old, new = TrustedKey(PUBLIC, None, date(2027, 3, 31)), TrustedKey(PUBLIC[::-1], date(2027, 3, 1), None)
    assert read_trusted(path) == {"a": (old, new)}


@pytest.mark.parametrize(
    "line, key",
    [
        ('not_before = "2027-03-01"', "key.0.not_before"),
        ("not_after = 2027-03-01T00:00:00Z", "key.0.not_after"),
        ("not_after = 2027", "key.0.not_after"),
        ("not_before = 2027-03-02\nnot_after = 2027-03-01", "key.0.not_after"),
        ("not_befor = 2027-03-02", "key.0.not_befor"),
    ],
)
def test_a_date_that_is_none_is_refused(tmp_path: Path, line: str, key: str) -> None:
    path = tmp_path / "trusted.toml"
    path.write_text(trusted_table("a", PUBLIC) + line + "\n")
    with pytest.raises(ConfigProblems) as refused:
        read_trusted(path)
    assert [problem.key for problem in refused.value.problems] == [key]


def test_dates_judge_what_names_the_key_and_nothing_else() -> None:
    dates = KeyDates([TrustedKey(PUBLIC, None, date(2001, 1, 1)), TrustedKey(PUBLIC[::-1], date(2001, 1, 1), None)])
    ended, counting = key_id(PUBLIC), key_id(PUBLIC[::-1])
    judged = [dates.of_health(pb.SignedHealth(key_id=named).SerializeToString())[:20] for named in (ended, counting, b"unknown")]
    answers = [dates.of_answer(pb.SignedChallengeReply(key_id=named).SerializeToString())[:20] for named in (ended, counting, b"unknown")]
    assert (judged, answers) == (["key no longer valid:", "", ""], ["key no longer valid:", "", ""])


@given(data=st.binary(max_size=200))
def test_bytes_that_are_no_message_are_left_to_who_verifies(data: bytes) -> None:
    dates = KeyDates([TrustedKey(PUBLIC, date(2001, 1, 1), None)])
    assert (dates.of_health(data), dates.of_answer(data)) == ("", "")


def test_keys_that_do_not_count_today_are_warned_of() -> None:
    warnings = KeyDates([TrustedKey(PUBLIC, date(9000, 1, 1), None), TrustedKey(PUBLIC[::-1])]).warnings()
    assert [w[:18] for w in warnings if "clock right" not in w] == ["key not yet valid:"]


def test_without_dates_nobody_asks_the_clock() -> None:
    assert KeyDates([TrustedKey(PUBLIC)]).warnings() == []
