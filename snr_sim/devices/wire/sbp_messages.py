"""Messages of a Piksi receiver that are used here: position, velocity, precision, sign of life. From payloads, in SI.

Older firmware sends position and velocity as 0x0201 and 0x0205: the same fields, but other flags. Those of a position
have no value for "no fix": without one it is not sent.

Source: Swift Navigation, "Swift Binary Protocol", MSG_POS_LLH, MSG_VEL_NED, MSG_DOPS, MSG_HEARTBEAT, and the two
messages DEP_A.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from functools import partial
from typing import TypeAlias

import msgspec

from snr_sim.devices.wire.sbp_frames import SbpFrame

BAUD = 115_200
_MODE = 0x07  # bits of the flags
_SATELLITE_FIXES = (1, 2, 3, 4, 6)  # single point, differential, float, fixed, SBAS. 0: invalid, 5: dead reckoning
_ABOVE_SEA = 0x08  # of the older position
_S, _MPS, _PRECISION_STEP = 1e-3, 1e-3, 0.01  # in the units of the wire


class PosLlh(msgspec.Struct, frozen=True):
    """Position."""

    tow_s: float  # time of the GPS week; velocity and precision of the same moment have the same
    latitude_deg: float  # north positive
    longitude_deg: float  # east positive
    height_m: float
    is_above_sea: bool  # else the height is above the ellipsoid of WGS84, which is up to 107 m away from sea level
    satellites: int
    has_fix: bool


class VelNed(msgspec.Struct, frozen=True):
    """Velocity over ground."""

    tow_s: float
    north_mps: float
    east_mps: float
    is_valid: bool


class Dops(msgspec.Struct, frozen=True):
    """Dilution of precision."""

    tow_s: float
    hdop: float


class Heartbeat(msgspec.Struct, frozen=True):
    """Sign of life, once a second."""


SbpMessage: TypeAlias = PosLlh | VelNed | Dops | Heartbeat


def decode(frame: SbpFrame) -> SbpMessage | None:
    """Return the message in a frame; None if it is not used here, or its length or position is impossible."""
    layout, make = _LAYOUTS.get(frame.kind, (None, None))
    if layout is None or make is None or len(frame.payload) != layout.size:
        return None
    return make(*layout.unpack(frame.payload))


def _position(
    tow_ms: int, latitude_deg: float, longitude_deg: float, height_m: float, satellites: int, flags: int,
    is_older: bool = False,
) -> PosLlh | None:  # fmt: skip
    # The wire can carry NaN, which fails these comparisons.
    if not (abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 180.0 and math.isfinite(height_m)):
        return None
    is_above_sea = is_older and bool(flags & _ABOVE_SEA)
    has_fix = is_older or flags & _MODE in _SATELLITE_FIXES
    return PosLlh(tow_ms * _S, latitude_deg, longitude_deg, height_m, is_above_sea, satellites, has_fix)


def _velocity(tow_ms: int, north_mmps: int, east_mmps: int, flags: int, is_older: bool = False) -> VelNed:
    return VelNed(tow_ms * _S, north_mmps * _MPS, east_mmps * _MPS, is_valid=is_older or flags & _MODE != 0)


# Left out: accuracies, velocity down, other precisions, and the flags of precision and heartbeat.
_POSITION = struct.Struct("<I3d4xBB")
_VELOCITY = struct.Struct("<Iii4x4xxB")
_LAYOUTS: dict[int, tuple[struct.Struct, Callable[..., SbpMessage | None]]] = {
    0x020A: (_POSITION, _position),
    0x0201: (_POSITION, partial(_position, is_older=True)),
    0x020E: (_VELOCITY, _velocity),
    0x0205: (_VELOCITY, partial(_velocity, is_older=True)),
    0x0208: (struct.Struct("<I6xH2xx"), lambda tow_ms, hdop: Dops(tow_ms * _S, hdop * _PRECISION_STEP)),
    0xFFFF: (struct.Struct("<4x"), Heartbeat),
}
