"""Private keys that stay private, and files of trusted keys that are refused whole."""

import os
import stat
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric import ed25519, rsa
from cryptography.hazmat.primitives.serialization import BestAvailableEncryption, Encoding, NoEncryption, PrivateFormat

from integrity.errors import ConfigError
from recordings.keys import keys_of, load_key, new_key, read_trusted, trusted_table
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
    assert read_trusted(path) == {"north-1": (PUBLIC, PUBLIC[::-1]), "south": (PUBLIC,)}


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
        keys_of({"north-1": (PUBLIC,)}, "nort-1", Path("trusted.toml"))


def test_what_the_commands_print_is_a_file_of_trusted_keys(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, trusted = tmp_path / "keys" / "north-1.pem", tmp_path / "trusted.toml"
    codes = [run(["keys", "new", str(path)]), run(["keys", "show", str(path), "--site", "south"])]
    trusted.write_text(capsys.readouterr().out)
    public = load_key(path).public
    assert (codes, read_trusted(trusted)) == ([0, 0], {"north-1": (public,), "south": (public,)})


@pytest.mark.parametrize("command", ["new", "show"])
def test_a_name_that_is_no_site_is_refused_before_anything_is_written(tmp_path: Path, command: str) -> None:
    path = tmp_path / "north 1.pem"
    assert (run(["keys", command, str(path)]), path.exists()) == (2, False)
