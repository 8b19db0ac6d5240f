"""Keys in files: a station's private key, which only its owner may read, and the public keys that a train trusts, by site.

A file of trusted keys is TOML, a table per key; a site has several while its key is being changed:

    [[key]]
    site = "kokubunji-1"
    public = "9f2c..."        # 64 hex digits: the raw Ed25519 public key
    not_before = 2027-04-01   # optional, UTC: the first day on which it counts
    not_after = 2029-03-31    # optional, UTC: the last one

Dates are judged by the clock of the machine that reads, each time a message comes, and they only ever take belief away: what makes a
message fresh is the challenge, never a date. So a clock that is wrong or attacked can make a right key refused, which stops (that is
said), or let a key count that stands in the file but has ended: as if it had no dates. GNSS time would not do, it is what is to be
judged; a date in a message would not do, whoever stole the key writes it. To withdraw a key for certain, take it out of the file.
"""

import os
import re
import stat
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat, load_pem_private_key
from google.protobuf.message import DecodeError

from integrity.errors import ConfigError
from integrity.messages import wayside_pb2 as pb
from integrity.messages.signatures import PUBLIC_KEY_BYTES, SigningKey, key_id, signing_key
from recordings.site_schema import NAME_PATTERN
from recordings.sources.host_clock import mono_now_ns, tick
from recordings.toml_file import ConfigProblems, Problem, TomlDocument, did_you_mean, read_toml

FEWEST_DISTINCT_BYTES = 8  # of 32 random bytes fewer are distinct once in 1e30; zeros and the other keys that sign anything have at most 3
EXPECTED_PUBLIC = f"expected {2 * PUBLIC_KEY_BYTES} hex digits, as `wayside keys new` and `wayside keys show` print them"

FIELDS = ("site", "public", "not_before", "not_after")


@dataclass(frozen=True)
class TrustedKey:
    """A raw public key, and the first and the last day (UTC) on which it counts; None: without bound."""

    public: bytes
    not_before: date | None = None
    not_after: date | None = None

    def refusal(self, day: date) -> str:
        """Why it does not count on a day; "" if it does."""
        if self.not_before is not None and day < self.not_before:
            return f"key not yet valid: {key_id(self.public).hex()} counts from {self.not_before} on; by this machine's clock it is {day}"
        if self.not_after is not None and day > self.not_after:
            return f"key no longer valid: {key_id(self.public).hex()} counted until {self.not_after}; by this machine's clock it is {day}"
        return ""


TrustedKeys = Mapping[str, tuple[TrustedKey, ...]]


def new_key(path: Path) -> SigningKey:
    """Draw a key and write it to a new file (PKCS 8, PEM, mode 600). Raises ConfigError if the file is there or cannot be made."""
    private = Ed25519PrivateKey.generate()
    write_private(path, private.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    return signing_key(private)


def write_private(path: Path, pem: bytes) -> None:
    """Write a private key to a new file with mode 600; its folder is made. Raises ConfigError if the file is there or cannot be made."""
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError as error:
        raise ConfigError(f"{path}: is there already, and no key is ever overwritten: choose another name, or move it away") from error
    except OSError as error:
        raise ConfigError(f"{path}: cannot be made ({error.strerror}): choose a place where you may write") from error
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(pem)
            file.flush()
            os.fsync(descriptor)
    except OSError as error:
        path.unlink()
        raise ConfigError(f"{path}: cannot be written ({error.strerror}): choose a place with room") from error


def read_private(path: Path, remedy: str) -> bytes:
    """The bytes of a private key's file. Raises ConfigError if others may read or write it; `remedy`: what to do if it is not there."""
    try:
        with path.open("rb") as file:
            mode = os.fstat(file.fileno()).st_mode
            pem = file.read()
    except FileNotFoundError as error:
        raise ConfigError(f"{path}: there is no key here: {remedy}") from error
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror}): give the path of a private key that this user may read") from error
    if mode & (stat.S_IRGRP | stat.S_IWGRP | stat.S_IROTH | stat.S_IWOTH):
        raise ConfigError(f"{path}: mode {stat.S_IMODE(mode):03o} lets others read or write this private key: run `chmod 600 {path}`")
    return pem


def load_key(path: Path) -> SigningKey:
    """A station's key. Raises ConfigError if others may read or write the file, or if it holds no Ed25519 key."""
    pem = read_private(path, f"make one with `wayside keys new {path}`")
    expected = f"expected an Ed25519 private key in PEM without a password, as `wayside keys new {path}` makes it"
    try:
        private = load_pem_private_key(pem, password=None)
    except (ValueError, TypeError, UnsupportedAlgorithm) as error:  # TypeError: a password is needed
        raise ConfigError(f"{path}: cannot be used as a key: {expected}") from error
    if not isinstance(private, Ed25519PrivateKey):
        raise ConfigError(f"{path}: holds a key of another kind ({type(private).__name__}): {expected}")
    return signing_key(private)


def trusted_table(site: str, public: bytes) -> str:
    """The table that makes a train trust the key, ready to be appended to a file of trusted keys."""
    return f'[[key]]\nsite = "{site}"\npublic = "{public.hex()}"\n'


def read_trusted(path: Path) -> TrustedKeys:
    """Trusted keys by site. Raises ConfigProblems with everything that is wrong with the file at once."""
    document = read_toml(path)
    problems = [
        document.problem((key,), "no such key here: expected tables [[key]]" + did_you_mean(key, ["key"]))
        for key in document.values
        if key != "key"
    ]
    tables = document.values.get("key", [])
    if not isinstance(tables, list) or not tables or not all(isinstance(table, dict) for table in tables):
        problems.append(document.problem(("key",), "expected one table [[key]] or more, each with site and public"))
        tables = []
    trusted: dict[str, tuple[TrustedKey, ...]] = {}
    for index, table in enumerate(tables):
        found = _key_problems(document, ("key", str(index)), table)
        problems += found
        if found:
            continue
        public = bytes.fromhex(table["public"])
        known = trusted.get(table["site"], ())
        if any(key.public == public for key in known):
            problems.append(document.problem(("key", str(index), "public"), f"stands twice for site {table['site']}: keep one of them"))
        trusted[table["site"]] = (*known, TrustedKey(public, table.get("not_before"), table.get("not_after")))
    if problems:
        raise ConfigProblems(problems)
    return trusted


def keys_of(trusted: TrustedKeys, site: str, file: Path) -> tuple[bytes, ...]:
    """The raw public keys of a site, whatever their dates (those are for `KeyDates`).

    Raises ConfigError if there is none; `file` is where they were read.
    """
    if site not in trusted:
        others = ", ".join(sorted(trusted)) or "none"
        hint = "append what `wayside keys show` prints at the station"
        raise ConfigError(f"{file}: no key is trusted for site {site}{did_you_mean(site, trusted)} (there are keys for {others}): {hint}")
    return tuple(key.public for key in trusted[site])


class KeyDates:
    """Judges, by the key that a message names, whether it counts today. Of signatures and unknown keys it says nothing."""

    def __init__(self, keys: Iterable[TrustedKey]) -> None:
        self._dated = {key_id(key.public): key for key in keys if key.not_before or key.not_after}

    def of_health(self, data: bytes) -> str:
        """Why a SignedHealth is not to be believed today; "" if dates are no reason, and for bytes that are none."""
        return self._of(pb.SignedHealth, data)

    def of_answer(self, data: bytes) -> str:
        """The same of a SignedChallengeReply."""
        return self._of(pb.SignedChallengeReply, data)

    def warnings(self) -> list[str]:
        """Keys that do not count today, and whether anybody vouches for this machine's day."""
        found = [why for key in self._dated.values() if (why := key.refusal(_today()))]
        if self._dated and tick("ntp", mono_now_ns()).utc_uncertainty_ns is None:
            found.append(f"keys have dates, and nothing keeps this machine's clock right, by which it is {_today()}: is it?")
        return found

    def _of(self, kind: type[pb.SignedHealth] | type[pb.SignedChallengeReply], data: bytes) -> str:
        if not self._dated:
            return ""
        try:
            key = self._dated.get(kind.FromString(data).key_id)
        except DecodeError:
            return ""
        return "" if key is None else key.refusal(_today())


def _today() -> date:
    return datetime.now(UTC).date()


def _key_problems(document: TomlDocument, at: tuple[str, str], table: dict[str, Any]) -> list[Problem]:
    problems = [
        document.problem((*at, key), f"no such key: expected {', '.join(FIELDS)}" + did_you_mean(key, FIELDS))
        for key in table
        if key not in FIELDS
    ]
    site, public = table.get("site"), table.get("public")
    if not isinstance(site, str) or not re.fullmatch(NAME_PATTERN, site):
        problems.append(document.problem((*at, "site"), 'expected the id of a site: letters, digits, "-" and "_", such as "kokubunji-1"'))
    if not isinstance(public, str) or not re.fullmatch(f"[0-9A-Fa-f]{{{2 * PUBLIC_KEY_BYTES}}}", public):
        problems.append(document.problem((*at, "public"), EXPECTED_PUBLIC))
    elif len(set(bytes.fromhex(public))) < FEWEST_DISTINCT_BYTES:
        problems.append(document.problem((*at, "public"), f"is a placeholder, no key: {EXPECTED_PUBLIC}"))
    dates = {key: table[key] for key in ("not_before", "not_after") if key in table}
    wrong = [key for key, day in dates.items() if type(day) is not date]  # a datetime is a date too
    problems += [document.problem((*at, key), "expected a date (UTC) without quotes, such as 2029-03-31") for key in wrong]
    if len(dates) == 2 and not wrong and dates["not_after"] < dates["not_before"]:
        problems.append(document.problem((*at, "not_after"), f"expected a day from not_before = {dates['not_before']} on"))
    return problems
