"""COBS: the same bytes as the package of PyPI, and no input can harm the decoder."""

import pytest
from cobs import cobs as peer
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.devices.wire.cobs import CobsError, decode, encode


@given(st.binary(max_size=900) | st.binary(max_size=3).map(lambda data: data * 300))
def test_cobs_encode_equals_independent_package(data: bytes) -> None:
    encoded = encode(data)
    assert encoded == peer.encode(data)
    assert 0 not in encoded
    assert decode(encoded) == data


@pytest.mark.parametrize("length", [253, 254, 255, 507, 508, 509])
@pytest.mark.parametrize("end", [b"", b"\x01", b"\x00", b"\x00\x01"])
def test_cobs_long_runs_equal_independent_package(length: int, end: bytes) -> None:
    data = b"\x07" * length + end
    assert encode(data) == peer.encode(data)
    assert decode(encode(data)) == data


@given(st.binary(max_size=300))
def test_cobs_decode_rejects_what_the_package_rejects(garbage: bytes) -> None:
    try:
        expected = peer.decode(garbage)
    except peer.DecodeError:
        with pytest.raises(CobsError):
            decode(garbage)
    else:
        assert decode(garbage) == expected
