"""The real MS5837-30BA on an I2C bus: the part that `devices/sensors/ms5837.py` simulates.

A conversion takes 18 ms at the highest oversampling, and no call waits for it: each `read` fetches the finished
conversion and starts the next one. Temperature, which changes slowly, is measured in one of ten. Depth 0 is where it
is switched on: the first measurement is the surface pressure, if it is in the range of air.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from itertools import count

from snr_sim.devices.sensors.ms5837 import OVERSAMPLING, Ms5837, Pressure
from snr_sim.devices.wire import ms5837_bytes as wire
from snr_sim.devices.wire.i2c_bus import I2cBus
from snr_sim.devices.wire.wire_handle import WireHandle
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.life_cycle import LifeCycleSensor
from snr_sim.prelude.signals import DepthReading

ADDRESS = 0x76
CONVERSION_S_PER_SAMPLE = 2.5e-6  # 2.2 at most, plus a margin
RESET_S = 0.01
STALE_S = 0.5
TEMPERATURE_EVERY = 10
AIR_PA: tuple[float, float] = (85_000.0, 108_500.0)  # highest at sea level, and of a town at 1400 m
_NOTHING, _RESET, _PRESSURE, _TEMPERATURE = "nothing", "reset", "pressure", "temperature"  # the command in progress
_PLAUSIBLE_PA = (20_000.0, 3_100_000.0)


class Ms5837I2c(LifeCycleSensor):
    """The sensor. Implements `Sensor`; reads `DepthReading`.

    Args:
        open_bus: opens the bus.
        now_s: the clock that stamps readings.
        part: its settings. If it `is_zeroed`, the pressure at the start is the surface pressure.
        address: it has only one.
        sleep: waits at the start.
    """

    def __init__(
        self,
        open_bus: Callable[[], I2cBus],
        now_s: Callable[[], float],
        part: Ms5837 | None = None,
        address: int = ADDRESS,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.title: str = f"The depth sensor MS5837 at 0x{address:02x}"
        self._now_s, self._sleep = now_s, sleep
        self._address, self._part = address, part or Ms5837()
        self._conversion_s = CONVERSION_S_PER_SAMPLE * self._part.oversampling
        self._bus = WireHandle(open_bus, self)
        self._reading = self._part.reading
        self._surface_pa: float | None = None
        self._newest: DepthReading | None = None
        self._errors = 0
        self._error = ""

    def counts(self) -> dict[str, int]:
        """Return how often it did not answer, or answered with impossible values."""
        return {"errors": self._errors}

    def on_configure(self) -> None:
        """Reset it; read its calibration and check the sum."""
        bus = self._bus.open()
        self._command(wire.RESET)
        self._sleep(RESET_S)
        registers = range(wire.READ_PROM, wire.READ_PROM + 2 * wire.PROM_WORDS, 2)
        words = [int.from_bytes(bus.read(self._address, register, 2), "big") for register in registers]
        try:
            self._calibration = wire.calibration(words)
        except DeviceError as error:
            raise DeviceError(f"{self.title} on {bus.name}: {error.message}", fix=error.fix) from None
        self._convert(_TEMPERATURE)
        self._d2 = self._wait_for_conversion()
        self._conversion_count = count(1)
        self._convert(_PRESSURE)
        self._newest = None

    def on_activate(self) -> None:
        """Take the first measurement; use it as surface pressure if it is in the range of air."""
        measured = self._compensate(self._wait_for_conversion())
        if self._surface_pa is None and self._part.is_zeroed and AIR_PA[0] <= measured.pressure_pa <= AIR_PA[1]:
            self._surface_pa = measured.pressure_pa
            self._reading = replace(self._part, surface_pa=measured.pressure_pa).reading
        self._newest = self._reading(measured)
        self._convert(_PRESSURE)

    def read(self) -> DepthReading | Stale:
        """Return the newest reading, and start the next conversion; raise a SensorLostError once it is closed."""
        idle = self.idle(self._newest.stamp_s if self._newest else None)
        if idle is not None:
            return idle
        try:
            self._poll()
        except DeviceError as error:
            self._errors += 1
            self._error = str(error)
            self._set_pending(_NOTHING, self._conversion_s)
        newest = self._newest
        if newest is None or self._now_s() > newest.stamp_s + STALE_S:
            return Stale(self._error or f"{self.title} has measured nothing.", newest.stamp_s if newest else None)
        return newest

    def on_close(self) -> None:
        """Close the bus."""
        self._bus.close()

    def _poll(self) -> None:
        if self._now_s() < self._due_s:
            return
        if self._pending == _NOTHING:  # it may have lost its power, so it starts again
            self._command(wire.RESET)
            self._set_pending(_RESET, RESET_S)
            return
        if self._pending == _RESET:
            self._convert(_PRESSURE)
            return
        raw = self._raw()
        if self._pending == _TEMPERATURE:
            self._d2 = raw
        else:
            self._newest = self._reading(self._compensate(raw))
        self._error = ""
        self._convert(_TEMPERATURE if next(self._conversion_count) % TEMPERATURE_EVERY == 0 else _PRESSURE)

    def _compensate(self, d1: int) -> Pressure:
        pressure_pa, temperature_c = wire.compensated(self._calibration, d1, self._d2)
        low_pa, high_pa = _PLAUSIBLE_PA
        if not low_pa <= pressure_pa <= high_pa:
            raise DeviceError(
                f"{self.title} reports {pressure_pa:.0f} Pa, outside its range of {low_pa:g} to {high_pa:g} Pa.",
                fix="check its wires; then switch it off and on.",
            )
        return Pressure(pressure_pa, temperature_c, self._started_s + 0.5 * self._conversion_s)

    def _wait_for_conversion(self) -> int:
        self._sleep(self._conversion_s)
        return self._raw()

    def _raw(self) -> int:
        raw = int.from_bytes(self._bus.get().read(self._address, wire.READ_ADC, wire.ADC_BYTES), "big")
        if raw == 0:  # its answer when there is no finished conversion
            raise DeviceError(
                f"{self.title} has no finished conversion.", fix="check its power: it may have been reset."
            )
        return raw

    def _convert(self, what: str) -> None:
        base = wire.CONVERT_TEMPERATURE if what == _TEMPERATURE else wire.CONVERT_PRESSURE
        self._command(base + 2 * OVERSAMPLING.index(self._part.oversampling))
        self._set_pending(what, self._conversion_s)

    def _set_pending(self, what: str, seconds: float) -> None:
        self._pending = what
        self._started_s = self._now_s()
        self._due_s = self._started_s + seconds

    def _command(self, byte: int) -> None:
        self._bus.get().command(self._address, byte)
