"""Messages for OpenSSL's errors; test_security.py has the same over real sockets."""

from __future__ import annotations

import ssl

import pytest

from snr_sim.links.socket_port import describe_tls_error


@pytest.mark.parametrize("name", ["TLSV1_ALERT_UNKNOWN_CA", "SSLV3_ALERT_CERTIFICATE_EXPIRED"])
def test_certificate_alert_refers_to_this_end(name: str) -> None:
    error = ssl.SSLError(1, f"[SSL: {name}] an alert (_ssl.c:1006)")
    error.reason = name
    words = describe_tls_error(error)
    assert words.startswith("the other end does not take this end's certificate. Try: ")
    assert words.endswith(f" ([SSL: {name}] an alert)")


def test_unknown_tls_error_returns_the_text_of_openssl() -> None:
    assert describe_tls_error(ssl.SSLError(1, "[SSL: ODD] odd thing (_ssl.c:7)")) == "[SSL: ODD] odd thing"
