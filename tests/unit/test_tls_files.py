"""Certificates of a test authority, and what is said of files by which nobody would be let in."""

import ipaddress
import ssl
import stat
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.x509.oid import NameOID

from integrity.errors import ConfigError
from recordings.certificates import Role, new_authority, new_certificate
from recordings.site_file import parse_site
from recordings.tls_files import TlsFiles, check_tls, files_beside, files_of
from recordings.toml_file import ConfigProblems, parse_toml
from station.check import check_site
from tests.unit.sites import edited
from train_client.train_file import load_train, parse_train
from wayside import run

TLS = '[publish.tls]\nroot_ca = "tls/ca.pem"\ncertificate = "tls/a.pem"\nprivate_key = "tls/a.key"\n'
SECURED = ('listen = ["tcp/0.0.0.0:7447"]', 'listen = ["tls/0.0.0.0:7447"]\nreaders = ["r291"]')
BOTH = (SECURED[0], SECURED[1].replace("[", '["tcp/127.0.0.1:7448", ', 1))
WITH_TABLE = ("[record]", f"{TLS}[record]")
TRAIN = (Path(__file__).parents[2] / "recordings" / "samples" / "train.toml").read_text()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    new_authority(tmp_path, 30)
    new_certificate(tmp_path, "north-1", Role.SITE, ["10.0.0.1", "north.example"], 20)
    return tmp_path


def certificate(path: Path) -> x509.Certificate:
    return x509.load_pem_x509_certificate(path.read_bytes())


def test_a_certificate_of_a_site_is_taken(folder: Path) -> None:
    check_tls(files_beside(folder / "north-1.pem"))


def test_openssl_takes_it_for_both_ends_and_for_its_hosts(folder: Path) -> None:
    """The judge is another implementation than the one that made it."""
    names = certificate(folder / "north-1.pem").extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    for purpose in (ssl.Purpose.SERVER_AUTH, ssl.Purpose.CLIENT_AUTH):
        context = ssl.create_default_context(purpose, cafile=str(folder / "ca.pem"))
        context.load_cert_chain(folder / "north-1.pem", folder / "north-1.key")
    assert (ipaddress.ip_address("10.0.0.1") in names.get_values_for_type(x509.IPAddress), "north.example" in names) == (True, False)


def test_private_keys_are_for_their_owner_alone(folder: Path) -> None:
    assert [stat.S_IMODE((folder / name).stat().st_mode) for name in ("ca.key", "north-1.key")] == [0o600, 0o600]


def test_a_certificate_ends_no_later_than_its_authority(folder: Path) -> None:
    assert new_certificate(folder, "long", Role.TRAIN, [], 3000) == certificate(folder / "ca.pem").not_valid_after_utc


def test_a_train_only_dials(folder: Path) -> None:
    new_certificate(folder, "r291", Role.TRAIN, [], 1)
    usage = certificate(folder / "r291.pem").extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    assert list(usage) == [x509.oid.ExtendedKeyUsageOID.CLIENT_AUTH]


def _ended(folder: Path) -> TlsFiles:
    new_certificate(folder, "old", Role.TRAIN, [], 1, datetime.now(UTC) - timedelta(days=9))
    return files_beside(folder / "old.pem")


def _open_to_others(folder: Path) -> TlsFiles:
    (folder / "north-1.key").chmod(0o640)
    return files_beside(folder / "north-1.pem")


def _of_another_authority(folder: Path) -> TlsFiles:
    new_authority(folder / "other", 30)
    return files_beside(folder / "north-1.pem")._replace(root_ca=folder / "other" / "ca.pem")


def _of_another_certificate(folder: Path) -> TlsFiles:
    new_certificate(folder, "south", Role.TRAIN, [], 1)
    return files_beside(folder / "north-1.pem")._replace(private_key=folder / "south.key")


@pytest.mark.parametrize(
    "files, why",
    [
        (lambda folder: files_beside(folder / "none.pem"), r"none\.pem: cannot be read"),
        (lambda folder: files_beside(folder / "north-1.pem")._replace(certificate=folder / "ca.key"), r"ca\.key: holds no certificate"),
        (lambda folder: files_beside(folder / "north-1.pem")._replace(private_key=folder / "ca.pem"), r"ca\.pem: mode 644"),
        (lambda folder: files_beside(folder / "north-1.pem")._replace(private_key=folder / "none"), "there is no key here: give the path"),
        (_ended, r"old\.pem: counts from .* renew it, or set the clock"),
        (_open_to_others, r"mode 640 lets others read or write this private key: run `chmod 600"),
        (_of_another_authority, r"no authority in .*other/ca\.pem has issued it"),
        (_of_another_certificate, r"south\.key: does not belong to the certificate"),
    ],
    ids=["not there", "no certificate", "a certificate as key", "no key", "ended", "open", "other authority", "other key"],
)
def test_what_the_other_end_would_refuse_is_said_beforehand(folder: Path, files: Callable[[Path], TlsFiles], why: str) -> None:
    with pytest.raises(ConfigError, match=why):
        check_tls(files(folder))


def test_the_commands_make_files_that_are_taken(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tls = tmp_path / "tls"
    codes = [run(["keys", "ca", str(tls)]), run(["keys", "certificate", str(tls), "r291", "--train"])]
    table = parse_toml(capsys.readouterr().out, "stdout").values["publish"]["tls"]
    check_tls(TlsFiles(*(Path(table[key]) for key in TlsFiles._fields)))
    name = certificate(tls / "r291.pem").subject.get_attributes_for_oid(NameOID.COMMON_NAME)[0].value
    assert (codes, name) == ([0, 0], "r291")


@pytest.mark.parametrize(
    "arguments, why",
    [
        (["certificate", "{}", "a"], "0 kinds of certificate given"),
        (["certificate", "{}", "a", "--site", "--train"], "2 kinds of certificate given"),
        (["certificate", "{}", "a", "--train", "--host", "b"], "a train only dials"),
        (["certificate", "{}", "a", "--site", "--host", "b:7447"], "'b:7447' is no host"),
        (["certificate", "{}", "ca", "--site"], "'ca' cannot name a certificate"),
        (["certificate", "{}", "a/b", "--site"], "'a/b' cannot name a certificate"),
        (["certificate", "{}", "north-1", "--site"], "is there already"),
        (["certificate", "{}/none", "a", "--site"], "make an authority with `wayside keys ca"),
        (["ca", "{}"], "is there already"),
    ],
)
def test_a_command_that_cannot_be_done_changes_nothing(
    folder: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], why: str
) -> None:
    before = {path: path.read_bytes() for path in folder.iterdir()}
    code = run(["keys", *(argument.format(folder) for argument in arguments)])
    after = {path: path.read_bytes() for path in folder.iterdir()}
    assert (code, why in capsys.readouterr().err, after == before) == (2, True, True)


def test_paths_of_a_site_file_count_from_where_it_lies() -> None:
    site = parse_site(edited(SECURED, WITH_TABLE), "site.toml")
    assert (files_of(site.tls, Path("/etc")), site.publish.readers) == (
        TlsFiles(Path("/etc/tls/ca.pem"), Path("/etc/tls/a.pem"), Path("/etc/tls/a.key")),
        ("r291",),
    )


def test_paths_of_a_train_file_count_from_where_it_lies(tmp_path: Path) -> None:
    (tmp_path / "train.toml").write_text(TRAIN + TLS)
    tls = load_train(tmp_path / "train.toml").tls
    assert tls == TlsFiles(tmp_path / "tls" / "ca.pem", tmp_path / "tls" / "a.pem", tmp_path / "tls" / "a.key")


@pytest.mark.parametrize(
    "edits, key, why",
    [
        ((SECURED,), "publish.listen", "tls and quic need certificates"),
        ((("connect = []", 'connect = ["quic/10.0.0.1:7447"]'),), "publish.connect", "tls and quic need certificates"),
        ((("connect = []", 'readers = ["r291"]'),), "publish.readers", "names are shown by certificates"),
        ((SECURED, ("[record]", '[publish.tls]\nroot_ca = "a"\n[record]')), "publish.tls.certificate", "missing: add certificate"),
        ((SECURED, ("[record]", f"{TLS}key = 1\n[record]")), "publish.tls.key", "it belongs in [publish]"),
        ((("connect = []", "tls = 3"),), "publish.tls", "expected a table: write [publish.tls]"),
    ],
)
def test_a_site_file_that_cannot_be_secured_is_refused_by_its_key(edits: tuple[tuple[str, str], ...], key: str, why: str) -> None:
    with pytest.raises(ConfigProblems) as refused:
        parse_site(edited(*edits), "site.toml")
    assert [why in problem.message for problem in refused.value.problems if problem.key == key] == [True]


def test_a_train_that_dials_tls_needs_certificates() -> None:
    with pytest.raises(ConfigProblems, match=r"publish\.connect.*tls and quic need certificates"):
        parse_train(TRAIN.replace("tcp/127.0.0.1:7447", "tls/127.0.0.1:7447"), "train.toml")


@pytest.mark.parametrize(
    "edits, warned",
    [
        ((), ["tcp/0.0.0.0:7447 is open"]),
        ((('"tcp/0.0.0.0:7447"', '"tcp/127.0.0.1:7447", "tcp/[::1]:7447", "tcp/localhost:7447", "unixsock-stream/a"'),), []),
        ((('"tcp/0.0.0.0:7447"', '"udp/10.0.0.1:7447", "tcp/127.0.0.1:7447", "ws/[::]:7448"'),), ["udp/10.0.0.1:7447", "ws/[::]:7448"]),
        ((SECURED, WITH_TABLE), []),
        ((('"tcp/0.0.0.0:7447"', '"tls/0.0.0.0:7447"'), WITH_TABLE), ["nobody may read"]),
        ((BOTH, WITH_TABLE), ["tcp/127.0.0.1:7448 serves nobody"]),
    ],
    ids=["open", "local", "open to some", "secured", "nobody", "tcp beside tls"],
)
def test_check_warns_of_endpoints_that_are_open_or_serve_nobody(
    tmp_path: Path, edits: tuple[tuple[str, str], ...], warned: list[str]
) -> None:
    (tmp_path / "site.toml").write_text(edited(*edits))
    found = [warning.message for warning in check_site(tmp_path / "site.toml").warnings if warning.key.startswith("publish")]
    assert [text in message for text, message in zip(warned, found, strict=True)] == [True] * len(warned)
