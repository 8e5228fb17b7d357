"""Base class for the life cycle of a device: derive from `LifeCycle` and override the `on_` methods it needs.

A sensor derives from `LifeCycleSensor`, which also defines the result of `read` while it does not measure.
"""

from __future__ import annotations

from typing import ClassVar

from snr_sim.prelude.device import Health, Stale
from snr_sim.prelude.errors import DeviceError, SensorLostError


class LifeCycle:
    """States of a device and the transitions between them (`prelude/device.py` has the diagram).

    Attributes:
        state: 'unconfigured', 'inactive', 'activating', 'active', 'error' or 'closed'.
        reason: as text, why it is not active.
        title: its name in messages.
    """

    title: str = "This device"
    state: str = "unconfigured"
    reason: str = ""
    _open_states: ClassVar[tuple[str, ...]] = ("inactive", "activating", "active")

    def configure(self) -> None:
        """Open the wire, with outputs neutral. After an error it starts again.

        Raises:
            DeviceError: it is closed, or an error of `on_configure`.
        """
        if self.state == "closed":
            raise DeviceError(f"{self.title} was closed.", fix="open another.")
        if self.state in self._open_states:
            return
        try:
            self.on_configure()
        except BaseException as error:
            self.fail(str(error))
            raise
        self.state, self.reason = "inactive", ""

    def activate(self) -> None:
        """Start to measure or to follow commands.

        Raises:
            DeviceError: it is not configured, or an error of `on_activate`.
        """
        if self.state in ("activating", "active"):
            return
        if self.state != "inactive":
            raise DeviceError(f"{self.title} cannot be activated: it is {self.state}.", fix="configure() it first.")
        self.state, self.reason = "active", ""
        try:
            self.on_activate()
        except BaseException as error:
            self.fail(str(error))
            raise

    def deactivate(self, reason: str) -> None:
        """Go to neutral. Never raises."""
        if self.state in ("unconfigured", "closed"):
            return
        try:
            self.on_deactivate(reason)
        except Exception as error:
            self.fail(str(error))
        else:
            if self.state in self._open_states:
                self.state, self.reason = "inactive", reason

    def fail(self, reason: str) -> None:
        """Record that the device has failed."""
        self.state, self.reason = "error", reason

    def health(self) -> Health:
        """Return its state."""
        return Health(self.state, self.reason, self.counts())

    def close(self) -> None:
        """Go to neutral and close. Never raises."""
        if self.state == "closed":
            return
        self.deactivate("closed")
        try:
            self.on_close()
        except Exception as error:
            self.reason = str(error)
        self.state = "closed"

    def counts(self) -> dict[str, int]:
        """Return its counters."""
        return {}

    def on_configure(self) -> None:
        """Open the wire and test the device."""

    def on_activate(self) -> None:
        """Start measuring, or arm; if that takes time, set `state` to 'activating', and later to 'active'."""

    def on_deactivate(self, reason: str) -> None:
        """Put outputs at neutral."""

    def on_close(self) -> None:
        """Release the wire."""


class LifeCycleSensor(LifeCycle):
    """Life cycle of a sensor with a wire."""

    def idle(self, since_s: float | None = None) -> Stale | None:
        """Return the result of `read` while nothing is measured; None while it is active.

        Args:
            since_s: when the newest good reading was measured.

        Raises:
            SensorLostError: it was closed.
        """
        if self.state == "active":
            return None
        if self.state == "closed":
            raise SensorLostError(f"{self.title} was closed.", fix="open another.")
        return Stale(
            f"{self.title} is {self.state}: {self.reason}" if self.reason else f"{self.title} is {self.state}.", since_s
        )
