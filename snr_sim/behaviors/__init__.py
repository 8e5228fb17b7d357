"""Behaviours: nested state machines that decide what a robot does next.

machine(), state(), on(), after() --> Program --> MachineFactory --> page "<name>", event "<name>.transition"
"""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.behaviors.bridge import Bridge as Bridge
    from snr_sim.behaviors.bridge import Drive as Drive
    from snr_sim.behaviors.bridge import Read as Read
    from snr_sim.behaviors.context import FixedPages as FixedPages
    from snr_sim.behaviors.context import MachineContext as MachineContext
    from snr_sim.behaviors.endpoint import MachineFactory as MachineFactory
    from snr_sim.behaviors.endpoint import StepLoopFactory as StepLoopFactory
    from snr_sim.behaviors.endpoint import machine_parts as machine_parts
    from snr_sim.behaviors.export import draw as draw
    from snr_sim.behaviors.imports import action as action
    from snr_sim.behaviors.interpreter import Change as Change
    from snr_sim.behaviors.interpreter import Interpreter as Interpreter
    from snr_sim.behaviors.language import parse as parse
    from snr_sim.behaviors.program import Program as Program
    from snr_sim.behaviors.program import ProgramError as ProgramError
    from snr_sim.behaviors.tables import after as after
    from snr_sim.behaviors.tables import always as always
    from snr_sim.behaviors.tables import exits as exits
    from snr_sim.behaviors.tables import machine as machine
    from snr_sim.behaviors.tables import on as on
    from snr_sim.behaviors.tables import side_by_side as side_by_side
    from snr_sim.behaviors.tables import state as state
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
