"""Messages for OpenSSL's errors; test_security.py has the same over real sockets."""

from __future__ import annotations

import ssl

import pytest

from snr_sim.links.tls_errors import tls_words


@pytest.mark.parametrize("name", ["TLSV1_ALERT_UNKNOWN_CA", "SSLV3_ALERT_CERTIFICATE_EXPIRED"])
def test_an_alert_about_a_certificate_is_that_of_this_end(name: str) -> None:
    error = ssl.SSLError(1, f"[SSL: {name}] an alert (_ssl.c:1006)")
    error.reason = name
    words = tls_words(error)
    assert words.startswith("the other end does not take this end's certificate. Try: ")
    assert words.endswith(f" ([SSL: {name}] an alert)")


def test_what_has_no_words_of_ours_is_said_in_those_of_openssl() -> None:
    assert tls_words(ssl.SSLError(1, "[SSL: ODD] odd thing (_ssl.c:7)")) == "[SSL: ODD] odd thing"
