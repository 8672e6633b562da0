"""A small authority for a team, and the certificates that it signs.

Needs the package cryptography: extra ``access``.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta, timezone
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from ual.shared import whole_file

AUTHORITY = "authority"
_CLOCKS_DIFFER = timedelta(days=1)
"""A field computer without a clock of its own may be late."""
_KEY_USAGES = (
    "digital_signature",
    "content_commitment",
    "key_encipherment",
    "data_encipherment",
    "key_agreement",
    "key_cert_sign",
    "crl_sign",
    "encipher_only",
    "decipher_only",
)


@dataclass(frozen=True, slots=True)
class Files:
    """A certificate and its private key, PEM."""

    certificate: Path
    key: Path


@dataclass(frozen=True, slots=True)
class _Signer:
    key: ec.EllipticCurvePrivateKey
    certificate: x509.Certificate


def files(directory: Path, name: str) -> Files:
    """Returns where the certificate of a name is, or would be."""
    return Files(directory / f"{name}.pem", directory / f"{name}.key")


def make_authority(directory: Path, name: str, days: float) -> Files:
    """Makes an authority: whatever it signs is trusted wherever its certificate is trusted.

    Raises:
        OSError: Its files are there already, or cannot be written.

    """
    key = ec.generate_private_key(ec.SECP256R1())
    subject = _subject(name)
    builder = _builder(subject, subject, key.public_key(), days)
    builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
    builder = builder.add_extension(_usage("key_cert_sign", "crl_sign"), critical=True)
    return _write(directory, AUTHORITY, builder.sign(key, hashes.SHA256()), key)


def make_daemon(directory: Path, name: str, hosts: Sequence[str], days: float) -> Files:
    """Makes the certificate of a daemon or a router, for the host names and addresses by which others know it.

    Raises:
        OSError: The authority cannot be read, or the files cannot be written.
        ValueError: The authority's files are none.

    """
    signer, key = _signer(directory), ec.generate_private_key(ec.SECP256R1())
    # A router of the network is a client of the other routers, too, and a UAV is one of its router.
    both = (ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH)
    builder = _signed_builder(signer, name, key, days, both)
    builder = builder.add_extension(x509.SubjectAlternativeName([_host(each) for each in hosts]), critical=False)
    return _write(directory, name, builder.sign(signer.key, hashes.SHA256()), key)


def make_caller(directory: Path, name: str, days: float) -> Files:
    """Makes the certificate of a caller. The daemon's roles file says what its name may do.

    Raises:
        OSError: The authority cannot be read, or the files cannot be written.
        ValueError: The authority's files are none.

    """
    signer, key = _signer(directory), ec.generate_private_key(ec.SECP256R1())
    builder = _signed_builder(signer, name, key, days, (ExtendedKeyUsageOID.CLIENT_AUTH,))
    return _write(directory, name, builder.sign(signer.key, hashes.SHA256()), key)


def _signer(directory: Path) -> _Signer:
    where = files(directory, AUTHORITY)
    key = serialization.load_pem_private_key(where.key.read_bytes(), password=None)
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise ValueError(f"{where.key} is no key of `ual certificates authority`")  # noqa: TRY004  a wrong file
    return _Signer(key, x509.load_pem_x509_certificate(where.certificate.read_bytes()))


def _signed_builder(
    signer: _Signer,
    name: str,
    key: ec.EllipticCurvePrivateKey,
    days: float,
    purposes: Sequence[x509.ObjectIdentifier],
) -> x509.CertificateBuilder:
    issuer = signer.certificate
    builder = _builder(_subject(name), issuer.subject, key.public_key(), days)
    builder = builder.add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
    builder = builder.add_extension(_usage("digital_signature"), critical=True)
    builder = builder.add_extension(x509.ExtendedKeyUsage(purposes), critical=False)
    identifier = issuer.extensions.get_extension_for_class(x509.SubjectKeyIdentifier).value
    return builder.add_extension(
        x509.AuthorityKeyIdentifier.from_issuer_subject_key_identifier(identifier), critical=False
    )


def _builder(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePublicKey, days: float
) -> x509.CertificateBuilder:
    now = datetime.now(timezone.utc)
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - _CLOCKS_DIFFER)
        .not_valid_after(now + timedelta(days=days))
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key), critical=False)
    )


def _usage(*allowed: str) -> x509.KeyUsage:
    return x509.KeyUsage(**{name: name in allowed for name in _KEY_USAGES})


def _subject(name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])


def _host(text: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(text))
    except ValueError:
        return x509.DNSName(text)


def _write(directory: Path, name: str, certificate: x509.Certificate, key: ec.EllipticCurvePrivateKey) -> Files:
    directory.mkdir(parents=True, exist_ok=True)
    where = files(directory, name)
    unencrypted = serialization.NoEncryption()
    private = key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, unencrypted)
    whole_file.create(where.key, private)
    try:
        whole_file.create(
            where.certificate, certificate.public_bytes(serialization.Encoding.PEM), whole_file.READABLE_PERMISSIONS
        )
    except OSError:
        where.key.unlink()  # a key without its certificate would be in the way of the next try
        raise
    return where
