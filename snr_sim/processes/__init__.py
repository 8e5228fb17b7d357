"""RoverProcesses: the parts of a robot as processes that publish and subscribe, in lock step or on the wall clock."""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.processes.message import RoverMessage as RoverMessage
    from snr_sim.processes.rover_process import ProcessSpec as ProcessSpec
    from snr_sim.processes.rover_process import RoverProcess as RoverProcess
    from snr_sim.processes.rover_server import RoverServer as RoverServer
    from snr_sim.processes.runner import ProcessRunner as ProcessRunner
    from snr_sim.processes.state_manager import StateManager as StateManager
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
