"""Messages for TLS errors. OpenSSL's own text, for readers who know OpenSSL, follows in parentheses."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import ssl

# Codes of X509_verify_cert, from OpenSSL's x509_vfy.h.
_CERTIFICATES = {
    9: "the other end's certificate is not valid yet. Try: set both clocks",
    10: "the other end's certificate has expired. Try: a new one there; or are both clocks right?",
    62: "the other end's certificate is for another name. Try: Tls(server_name=...) with the name that it is for",
    64: "the other end's certificate is for another address. Try: Tls(server_name=...) with the name that it is for",
}
_UNKNOWN_AUTHORITY = (
    "the other end's certificate is not signed by the authority this end trusts. Try: the authority= that signed it"
)
_NO_TLS = "this end speaks TLS, the other does not. Try: tls=Tls(...) on both ends"
# Bytes that are not TLS cause different errors, depending on OpenSSL's version and on the bytes.
_NO_TLS_REASONS = (
    "BAD_RECORD_TYPE HTTP_REQUEST PACKET_LENGTH_TOO_LONG RECORD_LAYER_FAILURE UNKNOWN_PROTOCOL WRONG_VERSION_NUMBER"
)
_REASONS = dict.fromkeys(_NO_TLS_REASONS.split(), _NO_TLS) | {
    "PEER_DID_NOT_RETURN_A_CERTIFICATE": (
        "the client shows no certificate. Try: Tls(client_certificate=..., client_key=...) there"
    )
}
_REJECTED = "the other end does not take this end's certificate. Try: what the other end says about it"


def describe_tls_error(error: ssl.SSLError) -> str:
    """Return what happened and what to try, followed by OpenSSL's text in parentheses."""
    openssl = (error.strerror or str(error)).partition(" (_ssl.c")[0]
    name = getattr(error, "reason", None) or ""  # only errors raised by OpenSSL have one
    code = getattr(error, "verify_code", None)
    if code is not None:
        words = _CERTIFICATES.get(code, _UNKNOWN_AUTHORITY)
    elif "ALERT" in name and any(part in name for part in ("CERTIFICATE", "UNKNOWN_CA")):
        words = _REJECTED
    else:
        words = _REASONS.get(name, "")
    return f"{words} ({openssl})" if words else openssl
