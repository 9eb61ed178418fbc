"""TLS for a page that other machines open: a certificate that is given, or one that signs itself and is known by its fingerprint."""

from __future__ import annotations

import ipaddress
import os
import socket
import ssl
from datetime import datetime, timedelta, timezone
from pathlib import Path

VALID = timedelta(days=825)
NAME = "console.pem"


def server_context(certificate: Path, key: Path) -> ssl.SSLContext:
    """Return the context of a server that speaks TLS 1.2 and later.

    Raises:
        ValueError: the files can't be read, or do not belong together; the message names them.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(certificate, key)
    except ssl.SSLError as error:
        raise ValueError(f"{certificate} and {key} are no certificate and its key, in PEM: {error.reason or error}") from error
    except OSError as error:
        raise ValueError(f"{certificate}, {key}: can't be read: {error.strerror or error}") from error
    return context


def fingerprint(certificate: Path) -> str:
    """Return the SHA-256 fingerprint of the first certificate in a PEM file, as browsers show it: ``AB:CD:...``."""
    from cryptography import x509
    from cryptography.hazmat.primitives.hashes import SHA256

    return x509.load_pem_x509_certificates(certificate.read_bytes())[0].fingerprint(SHA256()).hex(":").upper()


def own_certificate(folder: Path) -> Path:
    """Return a PEM file with a certificate that signs itself, and its key; it is made at the first call, and anew when it has run out.

    Raises:
        OSError: it can't be written.
    """
    path = folder / NAME
    if not path.is_file() or _runs_out(path):
        folder.mkdir(parents=True, exist_ok=True)
        aside = path.with_name(f".{NAME}.{os.getpid()}")
        with os.fdopen(os.open(aside, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "wb") as file:
            file.write(_made())
        aside.replace(path)
    return path


def _runs_out(path: Path) -> bool:
    from cryptography import x509

    try:
        return x509.load_pem_x509_certificate(path.read_bytes()).not_valid_after_utc < datetime.now(tz=timezone.utc) + timedelta(days=1)
    except ValueError:
        return True


def _made() -> bytes:
    """Make a key and its certificate for this machine's name and loopback, as PEM."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.x509.oid import NameOID

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, f"Alula console on {socket.gethostname()}"[:64])])
    names = [x509.DNSName("localhost"), x509.DNSName(socket.gethostname()), x509.IPAddress(ipaddress.ip_address("127.0.0.1"))]
    now = datetime.now(tz=timezone.utc)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(hours=1))  # clocks of other machines differ
        .not_valid_after(now + VALID)
        .add_extension(x509.SubjectAlternativeName(names), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .sign(key, hashes.SHA256())
    )
    secret = key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    return bytes(certificate.public_bytes(serialization.Encoding.PEM) + secret)
