"""Display of the rover's pages for the person at the surface."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from snr_sim.teleop import DisplayFactory, Rows

KEYS = ("vehicle", "odometry", "power")
NEWS = ("state", "rejected")


def display(has_gamepad: bool = False, in_lock_step: bool = True, lines: Sequence[str] = ()) -> DisplayFactory:
    """Return what makes the display, for a person who commands if it `has_gamepad`; see `DisplayFactory`."""
    keys = (*KEYS, "gamepad") if has_gamepad else KEYS
    return DisplayFactory(status_rows, keys, "link_radio", NEWS, in_lock_step=in_lock_step, lines=lines)


def status_rows(vehicle: dict[str, Any], pages: Mapping[str, Any]) -> Rows:
    """Return names, texts and styles of the rover's last reported state."""
    state = "EMERGENCY STOP" if vehicle["is_stopped"] else "armed" if vehicle["is_armed"] else "disarmed"
    if pages.get("gamepad") is not None and not vehicle["is_armed"]:
        state += ": c (Y) clears it, then 1 (start) arms" if vehicle["is_stopped"] else ": 1 (start) arms"
    style = "red" if vehicle["is_stopped"] else ""
    shown: Rows = [("state", f"{state}, {vehicle['mode']}, control: {vehicle['control_state']}", style)]
    if vehicle["rejected_command"]:
        shown.append(("rejected", str(vehicle["rejected_command"]), "red"))
    if pages["odometry"] is not None:
        place = pages["odometry"].data
        (x, y), heading = place["position_m"], round(math.degrees(place["yaw_rad"]))
        shown.append(("place", f"{x:.1f} m east, {y:.1f} m north of the start, heading {heading} deg", ""))
        shown.append(("speed", f"{place['speed_mps']:.1f} m/s, {place['way_m']:.0f} m so far", ""))
    if pages["power"] is not None:
        power = pages["power"].data
        shown.append(("battery", f"{power['voltage_v']:.1f} V, {power['current_a']:.0f} A", ""))
    return shown
