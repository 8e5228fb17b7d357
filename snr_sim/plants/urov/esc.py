"""Electronic speed controller: it needs a stop pulse before it turns a thruster, and again after a loss of signal.

    new --a steady pulse for a second: that is stop--> armed --no pulse for some seconds, or no voltage--> waiting
                                                        ^                                                     |
                                                        '------------ its stop for a second ------------------'

Documented (maker's forum, threads 380 and 2214, Basic ESC R3): 1500 us for about a second arms it. Without pulses it
stops, and after "3 to 10 seconds" it needs 1500 us again. A user who sent another width first found that this had
become its stop, and that 1500 us made the thruster turn the other way.

It keeps its stop pulse also without voltage: BLHeli_S, the firmware of these controllers, stores it in flash memory,
and after a reset or a loss of signal its arming sequence continues only at a stop pulse (its published source). So a
supply that breaks down under thrust leaves the thrusters stopped until they get stop pulses for a second.

Not documented, and chosen here: that a loss of signal counts after 5 s; that arming again takes as long as the first
time; what "steady" is; that a pulse within `STEADY_US` of stop counts as stop; that below 7 V, the lowest voltage that
its maker specifies, it is reset at once.
"""

from __future__ import annotations

from typing import NamedTuple

from snr_sim.plants.urov.t200 import MAX_PULSE_US, MIN_PULSE_US, MIN_VOLTAGE_V, STOP_US

ARMING_S = 1.0
SILENCE_S = 5.0
STEADY_US = 25.0
_ROUNDING_S = 1e-9  # a second is a second, however many steps it is made of


class EscState(NamedTuple):
    """Full state of a speed controller."""

    is_armed: bool = False  # it turns its thruster
    stop_us: float | None = None  # its stop pulse; None if it is new and has had none
    first_us: float | None = None  # while not armed, the pulse that it is receiving
    steady_s: float = 0.0  # while not armed, for how long
    silent_s: float = 0.0  # time since the last pulse


class Esc:
    """One speed controller, new as when it is connected for the first time."""

    def __init__(self) -> None:
        self.state: EscState = EscState()

    @property
    def is_armed(self) -> bool:
        """Whether it turns its thruster."""
        return self.state.is_armed

    @property
    def has_wrong_neutral(self) -> bool:
        """Whether it was shown something else than 1500 us for stop."""
        return self.state.stop_us not in (None, STOP_US)

    @property
    def neutral_offset_us(self) -> float:
        """How much longer than 1500 us the pulse is that it takes for stop."""
        return 0.0 if self.state.stop_us is None else self.state.stop_us - STOP_US

    def update(self, pulse_us: float | None, supply_v: float, dt_s: float) -> float:
        """Take the pulse of the last `dt_s`, None if there was none; return the pulse that the thruster turns by.

        A thruster without an armed controller does what it does at `STOP_US`.
        """
        if supply_v < MIN_VOLTAGE_V:
            self.state = EscState(stop_us=self.state.stop_us)
            return STOP_US
        if pulse_us is None:
            return self._update_silence(dt_s)
        if not self.state.is_armed:
            self._update_arming(pulse_us, dt_s)
            return STOP_US
        if self.state.silent_s:
            self.state = self.state._replace(silent_s=0.0)
        return min(MAX_PULSE_US, max(MIN_PULSE_US, pulse_us - self.neutral_offset_us))

    def _update_silence(self, dt_s: float) -> float:
        state = self.state
        silent_s = state.silent_s + dt_s
        keeps = state.is_armed and silent_s < SILENCE_S - _ROUNDING_S
        self.state = state._replace(silent_s=silent_s) if keeps else EscState(stop_us=state.stop_us, silent_s=silent_s)
        return STOP_US

    def _update_arming(self, pulse_us: float, dt_s: float) -> None:
        state = self.state
        if state.stop_us is not None and abs(pulse_us - state.stop_us) > STEADY_US:
            self.state = EscState(stop_us=state.stop_us)  # not stop: it keeps waiting
            return
        if state.first_us is None or abs(pulse_us - state.first_us) > STEADY_US:
            state = EscState(stop_us=state.stop_us, first_us=pulse_us)
        steady_s = state.steady_s + dt_s
        if steady_s < ARMING_S - _ROUNDING_S:
            self.state = state._replace(steady_s=steady_s, silent_s=0.0)
            return
        stop_us = state.stop_us or state.first_us or pulse_us
        self.state = EscState(is_armed=True, stop_us=STOP_US if abs(stop_us - STOP_US) <= STEADY_US else stop_us)
