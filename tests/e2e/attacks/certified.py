"""Certificates, and who shows them: what the tests of TLS and the attacks on it set up alike."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from integrity.messages.key_expressions import CHALLENGE, HEALTH, site_key
from recordings.certificates import Role, new_authority, new_certificate
from recordings.link import Access, open_link
from recordings.tls_files import TlsFiles, files_beside
from tests.e2e.field import REPOSITORY, SITE_ID

SITE, OTHER_SITE = "kokubunji-1", "kokubunji-2"  # those that the shipped router lets in
READERS = ("r291", "r292", "router")


def certificates_in(folder: Path) -> Path:
    """A folder with certificates of one authority; `guest` has a right one, and no rights; that of `late` has ended."""
    new_authority(folder, 30)
    for name, role in ((SITE, Role.SITE), (OTHER_SITE, Role.SITE), (SITE_ID, Role.SITE), ("router", Role.ROUTER)):
        new_certificate(folder, name, role, [], 30)
    for name in ("r291", "r292", "guest"):
        new_certificate(folder, name, Role.TRAIN, [], 30)
    new_certificate(folder, "late", Role.TRAIN, [], 1, datetime(2025, 1, 1, tzinfo=UTC))
    return folder


def strangers_in(folder: Path) -> Path:
    """The same names by another authority."""
    new_authority(folder, 30)
    new_certificate(folder, "r291", Role.TRAIN, [], 30)
    new_certificate(folder, SITE, Role.SITE, [], 30)
    return folder


def of(folder: Path, name: str) -> TlsFiles:
    return files_beside(folder / f"{name}.pem")


def tls_table(files: TlsFiles) -> str:
    """`[publish.tls]` of a site or train file."""
    return "[publish.tls]\n" + "".join(f'{key} = "{path}"\n' for key, path in files._asdict().items())


def secured(files: TlsFiles, site_file: Path, endpoint: str, lines: str) -> None:
    """The site file with TLS in the place of its open endpoint."""
    key = f'key = "{site_file.parent}/keys/{SITE_ID}.pem"\n'
    text = site_file.read_text().replace(f'listen = ["{endpoint}"]', lines)
    site_file.write_text(text.replace(key, key + tls_table(files)))


def speaker_process(listen: list[str], connect: list[str], certificate: str, site: str, honest: bool) -> None:
    """Runs in a process of its own: a station's link, on which each line of stdin, `KEY TEXT`, is put.

    Who is not honest has taken off his own rules, by which he would not put at the keys of another site.
    """
    with open_link(listen, connect, files_beside(Path(certificate)), Access(site, READERS) if honest else None) as link:
        link.answer(site_key(site, CHALLENGE), "x", lambda nonce: nonce + b"!")
        puts = {key: link.urgent(key, "x") for key in (site_key(SITE, HEALTH), site_key(OTHER_SITE, HEALTH))}
        print("ready", flush=True)
        for line in sys.stdin:
            key, _, text = line.strip().partition(" ")
            puts[key](text.encode())


class Speaker:
    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self.process = process

    def put(self, key: str, text: str) -> None:
        assert self.process.stdin
        self.process.stdin.write(f"{key} {text}\n")
        self.process.stdin.flush()


@contextmanager
def speaking(folder: Path, site: str, listen: list[str], connect: list[str], honest: bool = True) -> Iterator[Speaker]:
    call = "from tests.e2e.attacks.certified import speaker_process as run; "
    call += f"run({listen!r}, {connect!r}, {str(folder / f'{site}.pem')!r}, {site!r}, {honest})"
    command = [sys.executable, "-c", call]
    with subprocess.Popen(command, cwd=REPOSITORY, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout
            assert process.stdout.readline() == "ready\n"
            yield Speaker(process)
        finally:
            process.kill()
