"""A certificate authority in a folder, for tests and first steps: `ca.pem` and its key, and certificates of stations, trains, routers.

ECDSA on P-256, X.509 version 3 (RFC 5280). Such an authority is one file on one machine: nothing is revoked, nobody is told when a
certificate ends. Where an operator runs an authority of its own, certificates come from there; a certificate's common name is what access
control goes by, its alternative names are the hosts at which it is dialled.
"""

import ipaddress
import os
import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from enum import Enum
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives.asymmetric.ec import SECP256R1, EllipticCurvePrivateKey, generate_private_key
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat, load_pem_private_key
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from integrity.errors import ConfigError
from recordings.keys import read_private, write_private
from recordings.site_schema import NAME_PATTERN

CA_CERTIFICATE = "ca.pem"
CA_KEY = "ca.key"
CA_DAYS = 730
CERTIFICATE_DAYS = 365
BEGINS_BEFORE = timedelta(hours=1)  # a machine whose clock is a little behind takes a new certificate at once
LOCAL_HOSTS = ("localhost", "127.0.0.1", "::1")
HOST_PATTERN = r"[A-Za-z0-9]([A-Za-z0-9.-]*[A-Za-z0-9])?"


class Role(Enum):
    """What a certificate may be used for: a train only dials, the others are dialled too."""

    SITE = "site"
    ROUTER = "router"
    TRAIN = "train"


def new_authority(folder: Path, days: int) -> datetime:
    """Write `ca.pem` and `ca.key` (mode 600) into the folder; when the authority ends, UTC. Raises ConfigError if it cannot."""
    private = generate_private_key(SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, f"Wayside test authority {folder.resolve().name}"[:64])])
    now = datetime.now(UTC).replace(microsecond=0)
    usage = x509.KeyUsage(False, False, False, False, False, True, True, False, False)  # signs certificates and lists, nothing else
    certificate = (
        _begun(name, name, private, now, now + timedelta(days=days))
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(usage, critical=True)
        .sign(private, SHA256())
    )
    write_private(folder / CA_KEY, _pem(private))
    _write(folder / CA_CERTIFICATE, certificate)
    return certificate.not_valid_after_utc


def new_certificate(folder: Path, name: str, role: Role, hosts: Sequence[str], days: int, begins: datetime | None = None) -> datetime:
    """Write `NAME.pem` and `NAME.key` (mode 600), signed by the folder's authority; when the certificate ends, UTC, never after it.

    `hosts`: addresses and names at which a site or router is dialled, besides this machine's own. Raises ConfigError if it cannot.
    """
    if not re.fullmatch(NAME_PATTERN, name) or name == Path(CA_KEY).stem:
        raise ConfigError(f'{name!r} cannot name a certificate: expected letters, digits, "-" and "_", and not "ca"')
    authority, authority_key = _read_authority(folder)
    private = generate_private_key(SECP256R1())
    now = begins or datetime.now(UTC).replace(microsecond=0)
    ends = min(now + timedelta(days=days), authority.not_valid_after_utc)
    if ends <= now:
        raise ConfigError(f"{folder / CA_CERTIFICATE}: this authority ended at {ends:%Y-%m-%d}: make another in a new folder")
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    usages = [ExtendedKeyUsageOID.CLIENT_AUTH] + [ExtendedKeyUsageOID.SERVER_AUTH] * (role is not Role.TRAIN)
    certificate = (
        _begun(subject, authority.subject, private, now, ends)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.KeyUsage(True, False, False, False, False, False, False, False, False), critical=True)
        .add_extension(x509.ExtendedKeyUsage(usages), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(authority_key.public_key()), critical=False)
    )
    if role is not Role.TRAIN:
        certificate = certificate.add_extension(x509.SubjectAlternativeName([_host(h) for h in (*LOCAL_HOSTS, *hosts)]), critical=False)
    write_private(folder / f"{name}.key", _pem(private))
    _write(folder / f"{name}.pem", certificate.sign(authority_key, SHA256()))
    return ends


def _begun(
    subject: x509.Name, issuer: x509.Name, private: EllipticCurvePrivateKey, now: datetime, ends: datetime
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(private.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - BEGINS_BEFORE)
        .not_valid_after(ends)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(private.public_key()), critical=False)
    )


def _read_authority(folder: Path) -> tuple[x509.Certificate, EllipticCurvePrivateKey]:
    remedy = f"make an authority with `wayside keys ca {folder}`"
    pem = read_private(folder / CA_KEY, remedy)
    try:
        private = load_pem_private_key(pem, password=None)
        certificate = x509.load_pem_x509_certificate((folder / CA_CERTIFICATE).read_bytes())
    except (OSError, ValueError, TypeError) as error:
        raise ConfigError(f"{folder}: {CA_CERTIFICATE} and {CA_KEY} are no authority ({error}): {remedy} in another folder") from error
    if not isinstance(private, EllipticCurvePrivateKey) or private.public_key() != certificate.public_key():
        raise ConfigError(f"{folder}: {CA_KEY} is not the key of {CA_CERTIFICATE}: {remedy} in another folder")
    return certificate, private


def _host(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        if re.fullmatch(HOST_PATTERN, host):
            return x509.DNSName(host)
    raise ConfigError(f"{host!r} is no host: expected a name or an address without a port, such as 10.0.0.1")


def _pem(private: EllipticCurvePrivateKey) -> bytes:
    return private.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())


def _write(path: Path, certificate: x509.Certificate) -> None:
    try:
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644), "wb") as file:
            file.write(certificate.public_bytes(Encoding.PEM))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be made ({error.strerror}): choose another name, or move it away") from error
