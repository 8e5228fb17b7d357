"""A plant whose thrusters are connected to the pins of an emulated board: both advance together, step by step.

    McuPwm --> serial line --> firmware in simavr --> pulses at the pins --> plant
    McuPower <----------------- its ADC <-- battery's voltage and current <--'

So thrust comes from the pulses that the firmware generates, not from the requested ones.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from snr_sim.devices.emulated.board import Board, EmulatedPort
from snr_sim.devices.emulated.wrapped_plant import WrappedPlant
from snr_sim.devices.mcu.mcu import PowerScale
from snr_sim.devices.mcu.mcu_board import McuBoard
from snr_sim.devices.pwm.pwm_backend import STOP_US
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.signals import PwmCommand

STEP_S = 0.01
SIGNAL_TIMEOUT_US = 50_000.0  # without a pulse for this time, a speed controller assumes that the signal is lost


class ProcessorInLoopPlant(WrappedPlant):
    """A plant and a board in lock step.

    Args:
        plant: the driven plant.
        open_board: powers up a new board.
        channels: how many of its pins drive the plant, from the first on.
        input_name: of the plant's input that the pulses drive.
        command_of: makes that input's command from the pulses [us].
        power: name of the plant's output with `voltage_v` and `current_a`, which are applied to the board's ADC.
        scale: of the power module in between.
        up_s: how long the board has been powered before the start.

    Attributes:
        board: the board.
        mcu: the board as the robot's computer sees it, over its serial line.
    """

    driver = ("the board's pins", "command it over the serial line.")
    devices = "An emulated board"

    def __init__(
        self,
        plant: Plant,
        open_board: Callable[[], Board],
        channels: int,
        input_name: str = "pwm",
        command_of: Callable[[list[float]], Any] = PwmCommand,
        power: str | None = None,
        scale: PowerScale = PowerScale(),  # noqa: B008
        up_s: float = 0.0,
    ) -> None:
        super().__init__(plant, input_name)
        self._open_board, self._channels, self._input, self._command_of = open_board, channels, input_name, command_of
        self._power, self._scale, self._up_s = power, scale, up_s
        self._pulses_us: list[float] | None = None
        self._power_up()

    def _power_up(self) -> None:
        self.board: Board = self._open_board()
        board = self.board
        self._connect_battery()  # before its first measurement, which would be 0 V otherwise
        board.run_us(self._up_s * 1e6)
        self._pulses_us = None
        self.mcu: McuBoard = McuBoard(
            lambda: EmulatedPort(board), lambda: self.plant.time_s, lambda: board.now_us * 1e-6, session=1
        )

    @property
    def engine(self) -> str:
        """Names of the plant's and of the board's simulation."""
        return f"{self.plant.engine}, {self.board.mcu} in simavr"

    @property
    def step_s(self) -> float:
        """The plant's step; a plant without a fixed step is stepped often enough to follow the pulses."""
        return self.plant.step_s or STEP_S

    def reset(self, seed: int) -> None:
        """Reset the plant, and power up a new board."""
        self.plant.reset(seed)
        self.board.close()
        self._power_up()

    def step(self, dt_s: float) -> None:
        """Advance both: first the board, then the plant with the pulses at the pins by then."""
        board = self.board
        self._connect_battery()
        board.run_us(dt_s * 1e6)
        self._apply_pulses()
        self.plant.step(dt_s)

    def _connect_battery(self) -> None:
        if self._power is not None:
            battery = self.plant.read(self._power)
            for pin, millivolts in enumerate(self._scale.pins_mv(battery.voltage_v, battery.current_a)):
                self.board.set_millivolts(pin, millivolts)

    def _apply_pulses(self) -> None:
        oldest_us = self.board.now_us - SIGNAL_TIMEOUT_US
        pulses_us = []
        for rise_us, width_us, pulses in self.board.pins()[: self._channels]:
            if not pulses or rise_us < oldest_us:
                pulses_us = [STOP_US] * self._channels  # speed controllers stop without pulses, as at neutral
                break
            pulses_us.append(width_us)
        if pulses_us != self._pulses_us:
            self._pulses_us = pulses_us
            self.plant.write(self._input, self._command_of(pulses_us))
