"""A plant whose inputs are driven by emulated devices, which advance together with it."""

from __future__ import annotations

from typing import Any, ClassVar

from snr_sim.prelude.errors import PlantError
from snr_sim.prelude.plant import Plant


class WrappedPlant:
    """Implements `Plant` except `snapshot`; a subclass steps both, and what is missing is the plant's.

    Args:
        plant: the driven plant.
        driven: the input that the devices drive; None for all of them.

    Attributes:
        plant: the plant itself.
    """

    driver: ClassVar[tuple[str, str]]  # of the inputs, and how to command it
    devices: ClassVar[str]  # what cannot be reset to an earlier state

    def __init__(self, plant: Plant, driven: str | None = None) -> None:
        self.plant: Plant = plant
        self._driven = driven

    def __getattr__(self, name: str) -> Any:
        return getattr(self.plant, name)

    def write(self, name: str, command: Any) -> None:
        """Write an input; raise a PlantError for those that the devices drive."""
        if self._driven in (None, name):
            raise PlantError(f"'{name}' is driven by {self.driver[0]}.", fix=self.driver[1])
        self.plant.write(name, command)

    def snapshot(self) -> Any:
        """Raise a PlantError: the devices cannot restore a state."""
        raise PlantError(f"{self.devices} cannot be reset to an earlier state.", fix="use --io sim for this.")

    def restore(self, snapshot: Any) -> None:
        """Raise a PlantError, as there is no snapshot."""
        self.snapshot()
