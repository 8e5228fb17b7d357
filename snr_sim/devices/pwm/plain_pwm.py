"""What outputs do alike that have no program of their own to watch over them: chips, pins, boards that only obey.

Arming shows the speed controllers neutral for as long as they take to start, and ends only when neutral is commanded.
Where the last pulse would stay if this program were killed, it is refused: such outputs belong behind a supervisor.
"""

from __future__ import annotations

from collections.abc import Callable

from snr_sim.devices.pwm.pwm_backend import LIMITS_US, PwmBackend
from snr_sim.prelude.errors import DeviceError

ESC_START_S = 2.0  # steady neutral that a Basic ESC needs is about a second (its maker's forum): twice that


class PlainPwm(PwmBackend):
    """Outputs that only obey. A backend writes `send`, and `on_configure`, which ends with all at neutral.

    Args:
        now_s, channels, limits_us, resolution_us: as in PwmBackend.
        esc_start_s: how long neutral is shown before outputs follow commands.
        is_supervised: this is the supervisor's process. Without it outputs that do not fail safe alone stay neutral.
    """

    def __init__(
        self,
        now_s: Callable[[], float],
        channels: int,
        limits_us: tuple[float, float] = LIMITS_US,
        resolution_us: float = 0.0,
        esc_start_s: float = ESC_START_S,
        is_supervised: bool = False,
    ) -> None:
        super().__init__(now_s, channels, limits_us, resolution_us)
        self.esc_start_s = esc_start_s
        self._is_supervised = is_supervised
        self._neutral_since_s = 0.0

    def on_activate(self) -> None:
        """Begins to show neutral.

        Raises:
            DeviceError: the last pulse would stay if this program were killed.
        """
        if not (self.fails_safe_alone or self._is_supervised):
            raise DeviceError(
                f"{self.title} keeps its last pulse for ever if this program is killed: it is not armed from here.",
                fix="open it behind the supervisor: open_pwm(...) of snr_sim.devices.opening, as --io does.",
            )
        self.send(self.still_us)
        self._neutral_since_s = self.now_s()
        self.state, self.why = "activating", "the speed controllers are shown neutral"

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, why: list[str]) -> list[float]:
        """Sends pulses; ends arming when its time has come."""
        made = self.send(pulses_us)
        if self.state == "activating" and self.asks_neutral and self.has_started():
            self.state, self.why = "active", ""
        return made

    def has_started(self) -> bool:
        """Returns whether neutral has been shown for long enough."""
        return self.now_s() >= self._neutral_since_s + self.esc_start_s

    def on_deactivate(self, reason: str) -> None:
        """Puts all at neutral."""
        self.send(self.still_us)

    def send(self, pulses_us: list[float]) -> list[float]:
        """Sends pulses, and returns those that are made.

        Raises:
            DeviceError: the wire is gone.
        """
        raise NotImplementedError(f"{type(self).__name__} needs a method send(self, pulses_us)")
