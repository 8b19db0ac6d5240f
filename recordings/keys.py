"""Keys in files: a station's private key, which only its owner may read, and the public keys that a train trusts, by site.

A file of trusted keys is TOML, a table per key; a site has several while its key is being changed:

    [[key]]
    site = "kokubunji-1"
    public = "9f2c..."        # 64 hex digits: the raw Ed25519 public key
"""

import os
import re
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat, load_pem_private_key

from integrity.errors import ConfigError
from integrity.messages.signatures import PUBLIC_KEY_BYTES, SigningKey, signing_key
from recordings.site_schema import NAME_PATTERN
from recordings.toml_file import ConfigProblems, Problem, TomlDocument, did_you_mean, read_toml

FEWEST_DISTINCT_BYTES = 8  # of 32 random bytes fewer are distinct once in 1e30; zeros and the other keys that sign anything have at most 3
EXPECTED_PUBLIC = f"expected {2 * PUBLIC_KEY_BYTES} hex digits, as `wayside keys new` and `wayside keys show` print them"

TrustedKeys = Mapping[str, tuple[bytes, ...]]


def new_key(path: Path) -> SigningKey:
    """Draw a key and write it to a new file (PKCS 8, PEM, mode 600). Raises ConfigError if the file is there or cannot be made."""
    private = Ed25519PrivateKey.generate()
    pem = private.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
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
    return signing_key(private)


def load_key(path: Path) -> SigningKey:
    """A station's key. Raises ConfigError if others may read or write the file, or if it holds no Ed25519 key."""
    try:
        with path.open("rb") as file:
            mode = os.fstat(file.fileno()).st_mode
            pem = file.read()
    except FileNotFoundError as error:
        raise ConfigError(f"{path}: there is no key here: make one with `wayside keys new {path}`") from error
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror}): give the path of a private key that this user may read") from error
    if mode & (stat.S_IRGRP | stat.S_IWGRP | stat.S_IROTH | stat.S_IWOTH):
        raise ConfigError(f"{path}: mode {stat.S_IMODE(mode):03o} lets others read or write this private key: run `chmod 600 {path}`")
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
    """Raw public keys by site. Raises ConfigProblems with everything that is wrong with the file at once."""
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
    trusted: dict[str, tuple[bytes, ...]] = {}
    for index, table in enumerate(tables):
        found = _key_problems(document, ("key", str(index)), table)
        problems += found
        if found:
            continue
        public = bytes.fromhex(table["public"])
        known = trusted.get(table["site"], ())
        if public in known:
            problems.append(document.problem(("key", str(index), "public"), f"stands twice for site {table['site']}: keep one of them"))
        trusted[table["site"]] = (*known, public)
    if problems:
        raise ConfigProblems(problems)
    return trusted


def keys_of(trusted: TrustedKeys, site: str, file: Path) -> tuple[bytes, ...]:
    """The keys trusted for a site. Raises ConfigError if there is none; `file` is where they were read."""
    if site not in trusted:
        others = ", ".join(sorted(trusted)) or "none"
        hint = "append what `wayside keys show` prints at the station"
        raise ConfigError(f"{file}: no key is trusted for site {site}{did_you_mean(site, trusted)} (there are keys for {others}): {hint}")
    return trusted[site]


def _key_problems(document: TomlDocument, at: tuple[str, str], table: dict[str, Any]) -> list[Problem]:
    problems = [
        document.problem((*at, key), "no such key: expected site and public" + did_you_mean(key, ["site", "public"]))
        for key in table
        if key not in ("site", "public")
    ]
    site, public = table.get("site"), table.get("public")
    if not isinstance(site, str) or not re.fullmatch(NAME_PATTERN, site):
        problems.append(document.problem((*at, "site"), 'expected the id of a site: letters, digits, "-" and "_", such as "kokubunji-1"'))
    if not isinstance(public, str) or not re.fullmatch(f"[0-9A-Fa-f]{{{2 * PUBLIC_KEY_BYTES}}}", public):
        problems.append(document.problem((*at, "public"), EXPECTED_PUBLIC))
    elif len(set(bytes.fromhex(public))) < FEWEST_DISTINCT_BYTES:
        problems.append(document.problem((*at, "public"), f"is a placeholder, no key: {EXPECTED_PUBLIC}"))
    return problems
