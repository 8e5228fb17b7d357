"""Display of this vehicle's pages for the person at the surface."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from snr_sim.teleop import DisplayFactory, Rows

KEYS = ("vehicle", "depth", "altitude", "power", "leak")
NEWS = ("state", "outputs", "rejected", "failsafe", "low", "leak")


def display(has_gamepad: bool = False, in_lock_step: bool = True, lines: Sequence[str] = ()) -> DisplayFactory:
    """Return what makes the display, for a person who commands if it `has_gamepad`; see `DisplayFactory`."""
    keys = (*KEYS, "gamepad", "position_fix") if has_gamepad else KEYS
    return DisplayFactory(status_rows, keys, "link_tether", NEWS, in_lock_step=in_lock_step, lines=lines)


def status_rows(vehicle: dict[str, Any], pages: Mapping[str, Any]) -> Rows:
    """Return names, texts and styles of the vehicle's last reported state."""
    shown: Rows = []
    state = "EMERGENCY STOP" if vehicle["is_stopped"] else "armed" if vehicle["is_armed"] else "disarmed"
    if pages.get("gamepad") is not None and not vehicle["is_armed"]:
        state += ": c (Y) clears it, then 1 (start) arms" if vehicle["is_stopped"] else ": 1 (start) arms"
    style = "red" if vehicle["is_stopped"] else ""
    shown.append(("state", f"{state}, {vehicle['mode']}, control: {vehicle['control_state']}", style))
    if vehicle.get("output_fault"):
        reason = vehicle["output_fault"].splitlines()[0]
        shown.append(("outputs", f"disarmed: {reason}", "red"))
    for cause, text in vehicle.get("failsafes", {}).items():
        shown.append(("failsafe", f"{cause}: {text}", "red"))
    if vehicle["rejected_command"]:
        shown.append(("rejected", str(vehicle["rejected_command"]), "red"))
    if pages["depth"] is not None:
        held = vehicle["depth_m"]
        target = "" if held is None else f" (holds {held:.2f} m)"
        shown.append(("depth", f"{pages['depth'].data['depth_m']:.2f} m{target}", ""))
    if pages.get("position_fix") is not None:
        east, north, up = pages["position_fix"].data["position_m"]
        shown.append(("position", f"{east:.1f} m east, {north:.1f} m north, {-up:.1f} m deep", ""))
    roll, pitch, yaw = (math.degrees(angle) for angle in vehicle["attitude_rad"])
    held = vehicle["heading_rad"]
    target = "" if held is None else f" (holds {round(math.degrees(held))})"
    shown.append(("attitude", f"roll {round(roll)}, pitch {round(pitch)}, yaw {round(yaw)} deg{target}", ""))
    if pages["altitude"] is not None and pages["altitude"].data["confidence"] > 0.0:
        shown.append(("floor", f"{pages['altitude'].data['distance_m']:.2f} m below", ""))
    if pages["power"] is not None:
        power = pages["power"].data
        shown.append(("battery", f"{power['voltage_v']:.1f} V, {power['current_a']:.0f} A", ""))
    if vehicle["is_battery_low"]:
        does = ", the vehicle comes up" if vehicle["control_state"] == "surface" else ""
        shown.append(("low", f"BATTERY LOW{does}", "red"))
    if vehicle["thrust_scale"] < 1.0:
        shown.append(("thrusters", f"at their limits: {vehicle['thrust_scale']:.0%} of what is asked", "yellow"))
    if pages["leak"] is not None and pages["leak"].data["is_wet"]:
        shown.append(("leak", "WATER IN THE HULL", "red"))
    return shown
