"""Hardware checks of `snr doctor`: devices, missing permissions, and with --io which device answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from snr_sim.devices.host_ports import HostInfo, HostPort
from snr_sim.devices.mcu.mcu_board import McuBoard
from snr_sim.devices.mcu.mcu_handshake import CHANNELS, FLASH, incompatibilities
from snr_sim.devices.pwm.pwm_backend import STOP_US
from snr_sim.devices.wire.mcu_messages import BAUD, Ident, McuFault, ResetCause, Telemetry
from snr_sim.devices.wire.serial_port import BytePort, SerialPort
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.io import Io
from snr_sim.scenario.device_bench import Bench, bench_of, devices_of

_NEEDS = {"mcu": "serial", "maestro": "serial", "pca9685": "i2c", "sysfs": "pwm"}
_WORDS = {"serial": "serial port", "i2c": "I2C bus", "pwm": "PWM chip"}


class Finding(NamedTuple):
    """Result of one check: whether it passed, what was found, and the fix or an optional improvement."""

    is_ok: bool
    message: str
    fix: str = ""

    @property
    def tag(self) -> str:
        """Start of the line: MISS only if a required item is missing."""
        if not self.is_ok:
            return "MISS"
        return "note" if self.fix else "ok"


def wires(machine: HostInfo, io: Io | None) -> Iterator[Finding]:
    """Yield the devices that are present. Only requested devices count as missing: a laptop needs no ports."""
    needed = _NEEDS.get(io.kind, "") if io is not None else ""
    if machine.is_pi:
        yield Finding(True, machine.model)
    found = list(machine.host_ports())
    for wire in found:
        is_meant = wire.kind == needed and io is not None and _is_meant(wire, io)
        name = f"/dev/i2c-{wire.name}" if wire.kind == "i2c" else wire.name
        what = f"{_WORDS[wire.kind]} {name}{f' ({wire.about})' if wire.about else ''}"
        yield Finding(not (wire.fix and is_meant), what, wire.fix)
    if needed and io is not None and not any(wire.kind == needed and _is_meant(wire, io) for wire in found):
        if needed == "serial" and (machine.root / io.address.partition(",")[0].lstrip("/")).exists():
            return  # a link, or a port of an emulator, which is not in any list
        which = f" {io.address.partition(':')[0]}" if io.address else " of a Raspberry Pi's header"
        yield Finding(False, f"there is no {_WORDS[needed]}{which}", machine.missing(needed))


def _is_meant(wire: HostPort, io: Io) -> bool:
    place = io.address.partition(",")[0]  # settings follow the comma
    if wire.kind == "serial":
        return wire.name == place or wire.about.endswith(place)
    if wire.kind == "i2c":
        return wire.name == place.partition(":")[0].removeprefix("/dev/").removeprefix("i2c-")
    return "the one of a" in wire.about


def answers(io: Io, open_port: Callable[[], BytePort] | None = None) -> Iterator[Finding]:
    """Identify the device at a port, or open the devices as `snr io` does, and yield their states."""
    try:
        if io.kind == "mcu":
            yield from _microcontroller(open_port or (lambda: SerialPort(io.address, BAUD)))
        else:
            with bench_of(devices_of("urov_depth_hold", str(io))) as bench:
                bench.settle()
                yield from _of_bench(bench)
    except SnrError as error:
        yield Finding(False, f"--io {io}: {error.message}", error.fix)


def _microcontroller(open_port: Callable[[], BytePort]) -> Iterator[Finding]:
    from snr_sim.core.clocks import WallClock

    board = McuBoard(open_port, WallClock().now_s)
    try:
        ident = board.open(board)
        telemetry = board.telemetry
    finally:
        board.release(board)
    yield Finding(True, _describe_board(ident))
    for wrong in incompatibilities(ident, CHANNELS):
        yield Finding(False, f"it must not drive thrusters: {wrong}", FLASH)
    if telemetry is None:
        yield Finding(False, "it sends no telemetry", "snr io shows what comes; the cable may be loose.")
    else:
        yield from _state(ident, telemetry)


def _describe_board(ident: Ident) -> str:
    return (
        f"'{ident.name}' on {ident.mcu}: firmware {'.'.join(map(str, ident.firmware))}, protocol {ident.protocol}, "
        f"{ident.channels} channels, {ident.lowest_us:g} to {ident.highest_us:g} us in steps of "
        f"{ident.resolution_ns / 1000.0:g}, neutral {ident.neutral_us:g}, dead band {ident.dead_band_us:g}, "
        f"lease {ident.max_lease_ms} ms at most"
    )


def _state(ident: Ident, telemetry: Telemetry) -> Iterator[Finding]:
    widths = " ".join(f"{width:g}" for width in telemetry.widths_us)
    causes, since_s = telemetry.reset_cause, telemetry.uptime_ms / 1000.0
    reason = f", started by {causes.name}" if causes.name else ""
    yield Finding(True, f"it is {telemetry.state.name.lower()} since {since_s:.1f} s{reason}; {widths} us")
    off = [i for i, width in enumerate(telemetry.widths_us) if width != ident.neutral_us]
    if off:
        channels = ", ".join(map(str, off))
        yield Finding(False, f"channels {channels} are not at neutral", "another program drives them: end it first.")
    if McuFault.STOPPED in telemetry.faults:
        yield Finding(False, "its emergency stop is on", "clear it where it was pressed, or switch its power off.")
    if ResetCause.WATCHDOG in causes:
        fix = "report it to the maintainers; it is neutral since."
        yield Finding(True, "it restarted because its firmware had hung", fix)
    if ResetCause.BROWN_OUT in causes:
        fix = "power it from USB, not from a speed controller."
        yield Finding(True, "its supply was too low for a moment (brown-out)", fix)


def _of_bench(bench: Bench) -> Iterator[Finding]:
    for one in bench.outputs:
        health = one.health
        if health.state == "error":
            yield _trouble(one.key, health.reason)
            continue
        out: Any = one.device
        what = f"{health.state}, {out.channels} channels, resolution {out.resolution_us:g} us"
        yield Finding(True, f"outputs '{one.key}': {what}")
        pulses = one.reading.pulses_us if one.reading is not None else []
        off = [i for i, pulse in enumerate(pulses) if abs(pulse - STOP_US) > out.resolution_us]
        if off:
            what = f"are not at neutral ({', '.join(f'{i}: {pulses[i]:g} us' for i in off)})"
            yield Finding(False, f"outputs '{one.key}' {what}", "end the program that drives them.")
    for one in bench.sensors:
        health = one.health
        if health.state == "error" or one.stale:
            yield _trouble(one.key, one.stale or health.reason)
        else:
            yield Finding(True, f"sensor '{one.key}' answers")


def _trouble(key: str, reason: str) -> Finding:
    """Return a finding about an error, with the fix from its message."""
    message, _, fix = reason.partition("\n  Try: ")
    return Finding(False, f"'{key}': {message}", fix or "snr io shows it while you look at the wires.")
