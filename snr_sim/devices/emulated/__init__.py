"""Emulated microcontrollers in simavr, running the firmware that is flashed into real ones; devices in Python.

simavr is under the GPL, so nothing compiled with it ships. `board.c` ships as source and is compiled on the machine
that uses it, when it is first used, with the packages of Debian that `toolchain.py` names.
"""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.devices.emulated.board import Board as Board
    from snr_sim.devices.emulated.board import EmulatedPort as EmulatedPort
    from snr_sim.devices.emulated.lock_step import ProcessorInLoopPlant as ProcessorInLoopPlant
    from snr_sim.devices.emulated.pty_plant import PtyPlant as PtyPlant
    from snr_sim.devices.emulated.toolchain import firmware_elf as firmware_elf
    from snr_sim.devices.emulated.vesc_plant import Replug as Replug
    from snr_sim.devices.emulated.vesc_plant import VescPlant as VescPlant
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
