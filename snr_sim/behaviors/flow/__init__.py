"""Flows: states whose work is a function that waits, and the containers that put them in order.

State (run: a generator) --> Flow, Concurrence, Iterator --> flow_parts --> page "<name>", event "<name>.transition"

Outcomes, userdata, containers and preemption mean what they do in executive_smach of ROS (Bohren), but for threads:
everything runs on the node's one thread, so a flow is recorded and replayed like any other component.
"""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.behaviors.flow.concurrence import Concurrence as Concurrence
    from snr_sim.behaviors.flow.endpoint import FlowFactory as FlowFactory
    from snr_sim.behaviors.flow.endpoint import flow_parts as flow_parts
    from snr_sim.behaviors.flow.event_state import EventState as EventState
    from snr_sim.behaviors.flow.flow import Flow as Flow
    from snr_sim.behaviors.flow.iterator import Iterator as Iterator
    from snr_sim.behaviors.flow.movement import movement_parts as movement_parts
    from snr_sim.behaviors.flow.state import State as State
    from snr_sim.behaviors.flow.thread_state import ThreadState as ThreadState
    from snr_sim.behaviors.flow.userdata import Userdata as Userdata
    from snr_sim.behaviors.flow.waits import Preempted as Preempted
    from snr_sim.behaviors.flow.waits import ask as ask
    from snr_sim.behaviors.flow.waits import event as event
    from snr_sim.behaviors.flow.waits import page as page
    from snr_sim.behaviors.flow.waits import until as until
    from snr_sim.behaviors.flow.waits import wait as wait
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
