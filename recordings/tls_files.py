"""The files by which one end of a link shows who it is, looked at before they are used: of a refusal the other end says nothing.

All errors of certificates look alike to who dials ("timeout"), so what can be known beforehand is said here, by file.
"""

from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from cryptography.x509.oid import NameOID

from integrity.errors import ConfigError
from recordings.keys import read_private
from recordings.site_schema import TlsSection


class TlsFiles(NamedTuple):
    """Who is believed, who one is, and the proof of it: a CA's certificates, an own chain, and its private key, all PEM."""

    root_ca: Path
    certificate: Path
    private_key: Path


def files_of(section: TlsSection | None, folder: Path) -> TlsFiles | None:
    """The paths of a table `[publish.tls]`; relative ones count from the folder of the file that it stands in."""
    if section is None:
        return None
    return TlsFiles(folder / section.root_ca, folder / section.certificate, folder / section.private_key)


def files_beside(certificate: Path) -> TlsFiles:
    """The names that `wayside keys certificate` gives: NAME.pem, and beside it NAME.key and ca.pem."""
    return TlsFiles(certificate.with_name("ca.pem"), certificate, certificate.with_suffix(".key"))


def check_tls(files: TlsFiles | None) -> None:
    """Raises ConfigError for files that the other end would refuse: not there, open to others, ended, of another key or authority."""
    if files is None:
        return
    roots = _certificates(files.root_ca)
    own, *between = _certificates(files.certificate)
    _check_dates(files.certificate, own)
    issuers = [root for root in roots if _issued([own, *between][-1], root)]
    if not issuers:
        raise ConfigError(f"{files.certificate}: no authority in {files.root_ca} has issued it: give a certificate of that authority")
    _check_dates(files.root_ca, max(issuers, key=lambda root: root.not_valid_after_utc))
    if not own.subject.get_attributes_for_oid(NameOID.COMMON_NAME):
        raise ConfigError(f"{files.certificate}: has no common name, by which rights are given: expected the id of a site or train")
    pem = read_private(files.private_key, "give the path of the certificate's private key")
    try:
        private = load_pem_private_key(pem, password=None)
    except (ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise ConfigError(f"{files.private_key}: cannot be used: expected a private key in PEM without a password") from error
    if private.public_key() != own.public_key():
        raise ConfigError(f"{files.private_key}: does not belong to the certificate {files.certificate}: give the two that belong together")


def _check_dates(path: Path, certificate: x509.Certificate) -> None:
    now, begins, ends = datetime.now(UTC), certificate.not_valid_before_utc, certificate.not_valid_after_utc
    if not begins <= now <= ends:
        dates = f"counts from {begins:%Y-%m-%dT%H:%M:%SZ} to {ends:%Y-%m-%dT%H:%M:%SZ}"
        raise ConfigError(f"{path}: {dates}, and it is {now:%Y-%m-%dT%H:%M:%SZ} by this machine's clock: renew it, or set the clock")


def _certificates(path: Path) -> list[x509.Certificate]:
    try:
        return x509.load_pem_x509_certificates(path.read_bytes())
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror}): expected certificates in PEM") from error
    except ValueError as error:
        raise ConfigError(f"{path}: holds no certificate: expected one in PEM, or a chain with one's own first") from error


def _issued(certificate: x509.Certificate, root: x509.Certificate) -> bool:
    try:
        certificate.verify_directly_issued_by(root)
    except (ValueError, TypeError, InvalidSignature):
        return False
    return True
