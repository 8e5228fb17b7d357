"""What links are told, and what they say: options, keys, messages."""

from __future__ import annotations

from typing import Any

import pytest

from snr_sim import Config, Node, SocketsPair
from snr_sim.prelude.errors import ConfigError, ParameterError
from snr_sim.std_mods.comms.link import LinkOptions

HERE = "127.0.0.1"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"timeout_s": 0.1}, r"timeout_s=0\.1 and keep_alive_s=0\.5(.|\n)*timeout_s=1 or more"),
        ({"timeout_s": float("nan")}, "timeout_s=nan"),
        ({"timeout_s": "3"}, "timeout_s='3'"),
        ({"keep_alive_s": 0}, "keep_alive_s=0"),
        ({"keep_alive_s": -1.0}, r"keep_alive_s=-1\.0"),
        ({"queue_pages": 0}, "queue_pages=0"),
        ({"queue_pages": 1.5}, r"queue_pages=1\.5"),
        ({"max_frame_bytes": 0}, "max_frame_bytes=0"),
        ({"max_frame_bytes": 1 << 32}, "max_frame_bytes=4294967296"),
        ({"policy": "drop"}, "policy='drop'(.|\n)*drop_oldest, refuse"),
        ({"faults": 0.1}, r"faults=0\.1"),
    ],
)
def test_an_option_that_makes_no_sense_is_refused_where_it_is_given(options: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        LinkOptions("t", **options)
    with pytest.raises(ParameterError, match=said):
        SocketsPair((HERE, 0), **options)


def test_a_timeout_of_two_keep_alives_is_enough() -> None:
    assert LinkOptions("t", timeout_s=1.0).timeout_s == 1.0


def test_tls_is_certificates_and_not_a_switch() -> None:
    with pytest.raises(ConfigError, match=r"tls=True(.|\n)*Tls\(certificate="):
        SocketsPair((HERE, 0), tls=True)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("localhost", 9120), "'localhost' and 9120(.|\n)*in parentheses"),
        (("localhost",), "address is 'localhost'"),
        ((("localhost", 91200),), "its port is 91200(.|\n)*0 to 65535"),
        ((("localhost", "9120"),), "its port is '9120'(.|\n)*whole number"),
        ((("localhost", 9120.0),), r"its port is 9120\.0"),
        ((("", 9120),), "its host is ''"),
        ((9120,), "address is 9120"),
    ],
)
def test_an_address_that_is_none_is_refused_with_what_is_wrong_in_it(arguments: Any, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        SocketsPair(*arguments)


@pytest.mark.parametrize(
    ("keys", "said"),
    [(3, "keys are 3"), ([3], "hold 3, which"), (["3", ""], "hold '', which"), ([[]], r"hold \[\], which")],
)
def test_what_is_no_key_is_shown_as_it_stands(keys: Any, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        SocketsPair((HERE, 0)).server(keys)


def test_a_role_that_lists_an_end_without_calling_it_is_told_to_call_it() -> None:
    listed: Any = SocketsPair((HERE, 0)).server
    with pytest.raises(ConfigError, match=r"lists SocketsPair\.server(.|\n)*call it: .*\.server\(\.\.\.\)"):
        Node("robot", Config(factories={"robot": [listed]}))
