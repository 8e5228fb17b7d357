"""Outputs without a processor of their own that could supervise them: chips, pins, passive boards.

    PassivePwm (life cycle, checks, arming)  -->  PwmChip (bytes and registers)  -->  bus, port or files

Arming sends neutral for as long as the speed controllers take to start, and ends only when neutral is commanded.
Outputs whose last pulse would stay if this program were killed cannot be armed here: they need a supervisor.
"""

from __future__ import annotations

from collections.abc import Callable

from snr_sim.devices.pwm.pwm_backend import LIMITS_US, STOP_US, PwmBackend
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.signals import NOT_ACTIVE

ESC_START_S = 2.0  # a Basic ESC needs steady neutral for about a second (its maker's forum): twice that


class PwmChip:
    """Generator of the pulses, without state except its wire. A chip of your own implements `open`, `send` and `close`.

    Args:
        title: its name in messages.
        channels, limits_us, resolution_us: as in PwmBackend.

    Attributes:
        still_us: the pulses it makes for neutral.
        tripped: why the outputs went to neutral by themselves at the last `send`; empty if they did not.
    """

    has_independent_failsafe: bool = False  # whether they are neutral when this program is killed

    def __init__(
        self,
        title: str,
        channels: int,
        limits_us: tuple[float, float] = LIMITS_US,
        resolution_us: float = 0.0,
    ) -> None:
        self.title: str = title
        self.channels: int = channels
        self.limits_us: tuple[float, float] = limits_us
        self.resolution_us: float = resolution_us
        self.still_us: list[float] = [STOP_US] * channels
        self.tripped: str = ""

    def open(self) -> None:
        """Open the wire, identify the device, and set all outputs to neutral.

        Raises:
            DeviceError: the device does not answer, another one does, or it does not execute commands.
        """
        raise NotImplementedError(f"{type(self).__name__} needs a method open(self)")

    def before_arming(self) -> None:
        """Discard errors from the time in which nothing was sent."""

    def send(self, pulses_us: list[float]) -> list[float]:
        """Send pulses inside the limits; return the generated ones. A wire that is gone raises a DeviceError."""
        raise NotImplementedError(f"{type(self).__name__} needs a method send(self, pulses_us)")

    def close(self) -> None:
        """Release the wire. Safe to call twice, also if it is not open."""

    def counts(self) -> dict[str, int]:
        """Return the chip's counters."""
        return {}


class PassivePwm(PwmBackend):
    """The outputs of a chip. Implements PwmOut.

    Args:
        chip: generates the pulses.
        now_s: the clock of command stamps.
        esc_start_s: how long neutral is sent before outputs follow commands.
        is_supervised: this is the supervisor's process. Without it, outputs that do not fail safe alone stay neutral.
    """

    state: str
    reason: str

    def __init__(
        self, chip: PwmChip, now_s: Callable[[], float], esc_start_s: float = ESC_START_S, is_supervised: bool = False
    ) -> None:
        super().__init__(now_s, chip.channels, chip.limits_us, chip.resolution_us)
        self.chip: PwmChip = chip
        self.title: str = chip.title
        self.still_us: list[float] = chip.still_us
        self.has_independent_failsafe: bool = chip.has_independent_failsafe
        self.esc_start_s: float = esc_start_s
        self._is_supervised = is_supervised
        self._neutral_since_s = 0.0

    def counts(self) -> dict[str, int]:
        """Return the chip's counters."""
        return self.chip.counts()

    def on_configure(self) -> None:
        """Open the chip, at neutral."""
        try:
            self.chip.open()
        finally:
            self.title = self.chip.title  # it may have read its port's name

    def on_activate(self) -> None:
        """Start to send neutral; raise a DeviceError if the last pulse would outlive this program."""
        self.chip.before_arming()
        if not (self.has_independent_failsafe or self._is_supervised):
            raise DeviceError(
                f"{self.title} keeps its last pulse if this program is killed, so it needs a supervisor to arm.",
                fix="open it behind the supervisor: open_pwm(...) of snr_sim.devices.device_strings, as --io does.",
            )
        self.chip.send(self.still_us)
        self._neutral_since_s = self.now_s()
        self.state, self.reason = "activating", "the speed controllers are shown neutral"

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, reasons: list[str]) -> list[float]:
        """Send pulses; end arming when neutral was sent for long enough and is commanded."""
        made = self.chip.send(pulses_us)
        has_started = self.now_s() >= self._neutral_since_s + self.esc_start_s
        if self.chip.tripped:
            if self.state == "active":
                self.state, self.reason = "inactive", self.chip.tripped
                reasons.append(NOT_ACTIVE)
        elif self.state == "activating" and self.is_neutral_requested and has_started:
            self.state, self.reason = "active", ""
        return made

    def on_deactivate(self, reason: str) -> None:
        """Put all at neutral."""
        self.chip.send(self.still_us)

    def on_close(self) -> None:
        """Release the chip's wire."""
        self.chip.close()
