"""Conversion between a thruster's force and its pulse width, in both directions.

Around neutral there are pulses that produce zero force (the dead band). The pulse therefore jumps from one edge of the
band to the other between a small force ahead and a small one astern.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from itertools import pairwise

from snr_sim.prelude.errors import ParameterError


class ThrustCurve:
    """Thrust curve: measured pairs of pulse and force with linear interpolation.

    Args:
        pulses_us: increasing.
        forces_n: one for each pulse; increasing, but for zeros in the dead band, which is not at either end.
        stop_us: pulse for zero force, within the dead band.

    Raises:
        ParameterError: the pairs do not form such a curve.

    >>> curve = ThrustCurve([1100.0, 1470.0, 1530.0, 1900.0], [-40.0, 0.0, 0.0, 50.0])
    >>> curve.pulse_us(25.0), curve.pulse_us(0.0), curve.pulse_us(-0.4), curve.pulse_us(999.0)
    (1715.0, 1500.0, 1466.3, 1900.0)
    """

    def __init__(self, pulses_us: Sequence[float], forces_n: Sequence[float], stop_us: float = 1500.0) -> None:
        pulses, forces = [float(pulse) for pulse in pulses_us], [float(force) for force in forces_n]
        rises = all(a < b for a, b in pairwise(pulses)) and all(a < b or a == b == 0.0 for a, b in pairwise(forces))
        still = [i for i, force in enumerate(forces) if force == 0.0]
        if len(pulses) != len(forces) or not rises or not still or not 0 < still[0] <= still[-1] < len(forces) - 1:
            raise ParameterError(
                "A thruster's curve must rise from astern over a dead band, where its force is 0, to ahead.",
                fix="pulses and forces in rising order, as many of one as of the other.",
            )
        if not pulses[still[0]] <= stop_us <= pulses[still[-1]]:
            raise ParameterError(
                f"A thruster that stops at {stop_us:g} us, outside its dead band "
                f"of {pulses[still[0]]:g} to {pulses[still[-1]]:g} us.",
                fix="the curve of another thruster, or another stop_us.",
            )
        self.stop_us: float = stop_us
        self._pulses, self._forces = pulses, forces
        self._astern = pulses[: still[0] + 1], forces[: still[0] + 1]
        self._ahead = pulses[still[-1] :], forces[still[-1] :]

    @property
    def limits_n(self) -> tuple[float, float]:
        """Force at full astern and at full ahead [N]."""
        return self._forces[0], self._forces[-1]

    def pulse_us(self, force_n: float) -> float:
        """Return the pulse that produces a force; beyond the curve, the pulse of full thrust.

        Raises:
            ParameterError: the force is NaN.
        """
        if force_n == 0.0:
            return self.stop_us
        pulses, forces = self._ahead if force_n > 0.0 else self._astern
        if force_n != force_n:
            raise ParameterError("A thruster was to give a force of NaN.", fix="look for what made it NaN.")
        return _interpolate(force_n, forces, pulses, bisect_left(forces, force_n))

    def force_n(self, pulse_us: float) -> float:
        """Return the force that a pulse produces; full thrust for a pulse beyond the curve."""
        return _interpolate(pulse_us, self._pulses, self._forces, bisect_right(self._pulses, pulse_us))


def _interpolate(x: float, xs: list[float], ys: list[float], i: int) -> float:
    """Return y at x, which lies before point i; at the end of the curve beyond it."""
    if i == 0 or i == len(xs):
        return ys[max(0, i - 1)]
    return ys[i - 1] + (x - xs[i - 1]) / (xs[i] - xs[i - 1]) * (ys[i] - ys[i - 1])
