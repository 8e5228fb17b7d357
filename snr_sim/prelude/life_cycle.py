"""The life of a device, kept once for all: a device derives from `LifeCycle` and writes the `on_` methods it needs.

A sensor derives from `SensorLife`, which also knows what `read` answers while nothing is measured.
"""

from __future__ import annotations

from typing import ClassVar

from snr_sim.prelude.device import Health, Stale
from snr_sim.prelude.errors import DeviceError, SensorLost


class LifeCycle:
    """States of a device and the ways between them (`prelude/device.py` has the picture).

    Attributes:
        state: 'unconfigured', 'inactive', 'activating', 'active', 'error' or 'closed'.
        why: why it is not active, in words.
        title: what a message calls the device.
    """

    title: str = "This device"
    state: str = "unconfigured"
    why: str = ""
    _holding: ClassVar[tuple[str, ...]] = ("inactive", "activating", "active")

    def configure(self) -> None:
        """Open the wire; nothing moves. After an error it begins anew.

        Raises:
            DeviceError: it is closed, or what `on_configure` says.
        """
        if self.state == "closed":
            raise DeviceError(f"{self.title} was closed.", fix="open another.")
        if self.state in self._holding:
            return
        try:
            self.on_configure()
        except BaseException as error:
            self.fail(str(error))
            raise
        self.state, self.why = "inactive", ""

    def activate(self) -> None:
        """Start.

        Raises:
            DeviceError: it is not configured, or what `on_activate` says.
        """
        if self.state in ("activating", "active"):
            return
        if self.state != "inactive":
            raise DeviceError(f"{self.title} cannot be activated: it is {self.state}.", fix="configure() it first.")
        self.state, self.why = "active", ""
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
            if self.state in self._holding:
                self.state, self.why = "inactive", reason

    def fail(self, why: str) -> None:
        """Note that the wire does not do as it should."""
        self.state, self.why = "error", why

    def health(self) -> Health:
        """Return how it is."""
        return Health(self.state, self.why, self.counts())

    def close(self) -> None:
        """End it, at neutral. Never raises."""
        if self.state == "closed":
            return
        self.deactivate("closed")
        try:
            self.on_close()
        except Exception as error:
            self.why = str(error)
        self.state = "closed"

    def counts(self) -> dict[str, int]:
        """Return what has been counted."""
        return {}

    def on_configure(self) -> None:
        """Open and tests."""

    def on_activate(self) -> None:
        """Start measuring, or arm; one that takes its time sets `state` to 'activating', and later to 'active'."""

    def on_deactivate(self, reason: str) -> None:
        """Put outputs at neutral."""

    def on_close(self) -> None:
        """Let go of the wire."""


class SensorLife(LifeCycle):
    """The life of a sensor with a wire."""

    def idle(self, since_s: float | None = None) -> Stale | None:
        """Return what `read` answers while nothing is measured; None while it is active, and something is.

        Args:
            since_s: when the newest good reading was measured.

        Raises:
            SensorLost: it was closed.
        """
        if self.state == "active":
            return None
        if self.state == "closed":
            raise SensorLost(f"{self.title} was closed.", fix="open another.")
        return Stale(
            f"{self.title} is {self.state}: {self.why}" if self.why else f"{self.title} is {self.state}.", since_s
        )
