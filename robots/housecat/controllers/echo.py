"""Two control processes that log a line a second in each of three states, and a generator of events.

After the example of Kooi (2018), chapter 8. The order of the events is our own.
"""

from __future__ import annotations

from collections.abc import Generator

from snr_sim import Loop, LoopFactory, tasks
from snr_sim.behaviors.flow import wait
from snr_sim.behaviors.processes import ControlProcessFactory, ObserverState, reference_parts
from snr_sim.scenario import Factory, NodeApi, RobotInfo

STATES = {
    "StateA": {"EventA": "StateB"},
    "StateB": {"EventB": "StateA", "EventC": "StateC"},
    "StateC": {"EventA": "StateA"},
}
EVENTS = ("EventA", "EventC", "EventA", "EventA", "EventB", "NOOP", "EventA", "EventB")
PERIOD_S = 4.0


class EchoState(ObserverState):
    """Logs how many lines it has logged since the state began, once a second."""

    def run_state(self) -> Generator[object, None, None]:
        """See `ObserverState`."""
        self.log_value(self.turns)
        self.store_data(self.parent.name, {"state": self.name, "turns": self.turns}, process=False)
        yield wait(1.0)


class EventGenerator(Loop):
    """Sends the eight events, one every four seconds, again and again."""

    def setup(self) -> None:
        """Begin before the first event; the vehicle stands."""
        self.store_data("dozer", {"left_mps": 0.0, "right_mps": 0.0, "blade": 0.0})
        self.sent = -1  # the first call is at 0 s

    def loop(self) -> None:
        """Send the next event."""
        if self.sent >= 0:
            self.schedule(tasks.event(EVENTS[self.sent % len(EVENTS)]))
        self.sent += 1


class GeneratorFactory(LoopFactory):
    """Makes the generator."""

    def get(self, parent: NodeApi) -> EventGenerator:
        """Return it."""
        return EventGenerator(self, parent, "event_generator", 1.0 / PERIOD_S)


def factories(robot: RobotInfo) -> list[Factory]:
    """Return the reference machine, two control processes and the generator."""
    states = dict.fromkeys(STATES, EchoState)
    return [
        *reference_parts(STATES, "StateA", observers=["Process1", "Process2"]),
        ControlProcessFactory("Process1", of="reference", states=states),
        ControlProcessFactory("Process2", of="reference", states=states),
        GeneratorFactory(),
    ]
