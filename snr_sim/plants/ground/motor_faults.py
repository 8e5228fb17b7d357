"""Motors of a rover that break."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, TypeAlias, get_args

from snr_sim.plants.ground.dc_motor import Drive
from snr_sim.plants.parameter_limits import LIMITS, Record
from snr_sim.prelude.errors import ParameterError, suggest

MotorFaultKind: TypeAlias = Literal["dead", "drags", "silent"]
FAULTS: tuple[str, ...] = get_args(MotorFaultKind)
DRAG_NM = 15.0  # more than its motor and the ground together can: the wheel is locked


@dataclass(frozen=True)
class MotorFault(Record, who="The motor fault's "):
    """A motor that breaks.

    dead: it gives no torque, and its wheel turns freely; its readings say what is true. drags: its gear jams, which is
    a friction of `DRAG_NM`. silent: its controller has no power, so it is dead and sends no more readings.

    Args:
        at_s: when.
        motor: name of its wheel.
        fault: one of the three.
    """

    at_s: Annotated[float, LIMITS["time_s"]]
    motor: str
    fault: MotorFaultKind = "dead"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.fault not in FAULTS:
            raise ParameterError(f"A motor cannot be {self.fault!r}.", fix=suggest(str(self.fault), FAULTS))


class MotorFaults:
    """Which motors are broken by now.

    Args:
        faults: of a run.
        names: of the wheels with motors, in order.

    Raises:
        ParameterError: there is no such motor.

    Attributes:
        next_s: when the next one breaks; infinity if no more do.
        broken: the fault of each broken motor, by its index.
    """

    def __init__(self, faults: Sequence[MotorFault], names: Sequence[str]) -> None:
        for fault in faults:
            if fault.motor not in names:
                raise ParameterError(
                    f"At {fault.at_s:g} s the motor {fault.motor!r} is to break, and there is no such one.",
                    fix=suggest(str(fault.motor), names),
                )
        self._faults = sorted(faults, key=lambda fault: fault.at_s)
        self._names = list(names)
        self.restore(0)

    def snapshot(self) -> int:
        """Return how many have happened."""
        return self._count

    def restore(self, snapshot: int) -> None:
        """Put back what `snapshot` returned."""
        self._count = snapshot
        self.broken: Mapping[int, MotorFaultKind] = {
            self._names.index(fault.motor): fault.fault for fault in self._faults[:snapshot]
        }
        self.next_s: float = self._faults[snapshot].at_s if snapshot < len(self._faults) else float("inf")

    def advance(self, time_s: float) -> None:
        """Break what is due by now."""
        while self.next_s <= time_s:
            self.restore(self._count + 1)

    def apply(self, drives: list[Drive]) -> list[Drive]:
        """Return what the motors do that were to do this."""
        for i, fault in self.broken.items():
            if fault == "drags":
                drives[i] = drives[i]._replace(friction_nm=drives[i].friction_nm + DRAG_NM)
            else:
                drives[i] = Drive(friction_nm=drives[i].friction_nm)
        return drives
