"""Judge of a dive: the record of true depth and heading, and the conclusions from it."""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, NamedTuple, overload

from snr_sim.devices import position_fix_of
from snr_sim.plants import Dive, Pool, Urov, Urov2D, Vehicle
from snr_sim.plants.urov.t200 import STOP_US
from snr_sim.scenario import Verdict, ordered_sum, roll_pitch_yaw_rad

SAMPLE_S = 0.1
_NUMBERS = 8  # of a sample


class Sample(NamedTuple):
    """The true state at a moment, as far as scenarios judge it."""

    time_s: float
    position_m: tuple[float, float, float]
    roll_rad: float
    pitch_rad: float
    yaw_rad: float
    thrust_n: float  # of all thrusters, sum of absolute values

    @property
    def depth_m(self) -> float:
        """Positive down."""
        return -self.position_m[2]


class Course(Sequence[Sample]):
    """Samples in the order in which they were taken, in 64 bytes each: as objects they took 0.22 MB a minute."""

    def __init__(self, samples: Iterable[Sample] = ()) -> None:
        self._numbers = array("d")
        for sample in samples:
            self.append(sample)

    def append(self, sample: Sample) -> None:
        """Add the newest."""
        time_s, position_m, *others = sample
        self._numbers.extend((time_s, *position_m, *others))

    def __len__(self) -> int:
        return len(self._numbers) // _NUMBERS

    @overload
    def __getitem__(self, index: int) -> Sample: ...

    @overload
    def __getitem__(self, index: slice) -> list[Sample]: ...

    def __getitem__(self, index: int | slice) -> Sample | list[Sample]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        begin = range(len(self))[index] * _NUMBERS
        time_s, x_m, y_m, z_m, *others = self._numbers[begin : begin + _NUMBERS]
        return Sample(time_s, (x_m, y_m, z_m), *others)


class Tracked(Urov):
    """A vehicle with an observer above that records its course, ten times a second; its output "position_fix"."""

    def __init__(
        self, vehicle: Vehicle, pool: Pool, start_of: Callable[[int], Dive], thrusters: Any, seed: int
    ) -> None:
        super().__init__(vehicle, pool, start_of, thrusters, seed)
        self.outputs = (*self.outputs, "position_fix")
        self._readers["position_fix"] = partial(position_fix_of, self)

    def reset(self, seed: int) -> None:
        """Reset, with an empty course."""
        self.course: Course = Course()
        self.max_contact_n: float = 0.0  # the hardest contact
        super().reset(seed)

    def step(self, dt_s: float) -> None:
        """Advance, and record a sample when it is due."""
        super().step(dt_s)
        if self.contact_n is not None:
            self.max_contact_n = max(self.max_contact_n, math.hypot(*self.contact_n))
        if self.time_s >= len(self.course) * SAMPLE_S - 1e-9:
            thrust_n = 0.0 if self.thrusters is None else ordered_sum(map(abs, self.thrusters.forces_n))
            angles = roll_pitch_yaw_rad(self.attitude)
            self.course.append(Sample(self.time_s, self.position_m, *angles, thrust_n))

    def restore(self, snapshot: Any) -> None:
        """Restore the vehicle, and drop the samples recorded since."""
        super().restore(snapshot)
        self.course = Course(sample for sample in self.course if sample.time_s <= self.time_s)

    def samples_between(self, from_s: float, to_s: float) -> list[Sample]:
        """Return the samples between two moments."""
        return [sample for sample in self.course if from_s - 1e-9 <= sample.time_s <= to_s + 1e-9]


def hold_verdict(plant: Tracked, misses: Sequence[str]) -> Verdict:
    """Return the verdict of a finished dive: held, if nothing was missed."""
    if not misses:
        return Verdict("held", True)
    return Verdict("failed", False, "; ".join([*misses, *arming_problems(plant)]))


def arming_problems(plant: Tracked) -> list[str]:
    """Return remarks on speed controllers that were not armed as they should be: a beginner's mistake."""
    if plant.thrusters is None:
        return []
    problems = []
    if not any(esc.is_armed for esc in plant.thrusters.escs):
        problems.append("no speed controller is armed: each must be sent 1500 us for a second first")
    false = {esc.neutral_offset_us + STOP_US for esc in plant.thrusters.escs if esc.has_wrong_neutral}
    if false:
        pulses = ", ".join(f"{pulse_us:g}" for pulse_us in sorted(false))
        problems.append(f"speed controllers were first sent {pulses} us and took that for stop: begin with 1500 us")
    return problems


class TrackedUrov(Tracked):
    """In space, under MuJoCo."""


class TrackedUrov2D(Tracked, Urov2D):
    """In the plane of surge, heave and pitch, under pymunk."""


# For scenarios that ask nothing of sway, roll and yaw; the first is the default.
BODIES: dict[str, type[Tracked]] = {"mujoco": TrackedUrov, "pymunk": TrackedUrov2D}


class StepResponse(NamedTuple):
    """How well a step of a held quantity was followed; None where the dive ended before that could be seen."""

    settling_s: float | None  # from the step until the error stayed within the band; None if it did not
    overshoot: float | None  # beyond the new value, in the direction of the step; 0 if it never was
    steady: float | None  # mean size of the error at the end


def step_response(
    course: Sequence[Sample],
    value_of: Callable[[Sample], float],
    times_s: tuple[float, float],
    values: tuple[float, float],
    band: float,
) -> StepResponse:
    """Judge how a quantity followed a step.

    Args:
        course: what happened.
        value_of: the quantity at a sample.
        times_s: of the step, and until when it is judged.
        values: before and after it.
        band: size of an error that is small enough.
    """
    begin_s, end_s = times_s
    errors = [(sample.time_s, value_of(sample) - values[1]) for sample in course if begin_s <= sample.time_s <= end_s]
    outside = [time_s for time_s, error in errors if abs(error) > band]
    reached = bool(errors) and (not outside or outside[-1] < errors[-1][0])
    last = [abs(error) for time_s, error in errors if time_s > end_s - 5.0]
    side = math.copysign(1.0, values[1] - values[0])
    return StepResponse(
        settling_s=(outside[-1] + SAMPLE_S - begin_s if outside else 0.0) if reached else None,
        overshoot=max(0.0, *(side * error for _, error in errors)) if errors else None,
        steady=ordered_sum(last) / len(last) if last else None,
    )
