"""Control processes that change their state together: a reference machine, and loops that follow it.

event --> Reference --> page "reference": state, epoch, phase --> ControlProcess: ObserverState.run_state
             ^------------- event "reference.ended" -----------------'

Source: Kooi, "Creating a State-Synchronized Multi-Processes Software Architecture in ROS and Python" (UC Santa Cruz,
2018).
"""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.behaviors.processes.control_process import ControlProcessFactory as ControlProcessFactory
    from snr_sim.behaviors.processes.control_process import ObserverState as ObserverState
    from snr_sim.behaviors.processes.reference import ReferenceFactory as ReferenceFactory
    from snr_sim.behaviors.processes.reference import reference_parts as reference_parts
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
