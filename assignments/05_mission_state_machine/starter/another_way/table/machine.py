"""The state machine of the mission as a table. It knows no pages; `known` is from mission.py."""

from snr_sim.behaviors import Interpreter, after, machine, state

READY_S = 2.0  # the vehicle's speed controllers need this time before they are armed


def may_begin(m):
    return m.data("is_ready") and m.data("has_fix")


# Also useful here: on(condition, to=...), always(to=...), exits(...), enter=function, anywhere=[...], machines=[...].
MISSION = machine(
    "mission",
    initial="waiting",
    variables={"gate": 0, "gates": 3},
    states=[
        state("waiting", after(READY_S, to="lining_up", when=may_begin)),
        state("lining_up"),
    ],
)


class Machine:
    """What mission.py uses: a state, a gate, and since when. Do not change it."""

    def __init__(self, gates):
        self.known: dict[str, object] = {}
        self.interpreter = Interpreter(MISSION, self.known)
        self.interpreter.set("mission.gates", gates)
        self.interpreter.spawn(0)

    @property
    def state(self):
        return self.interpreter.active["mission"]

    @property
    def since_s(self):
        return self.interpreter.since_ns["mission"] / 1e9

    @property
    def gate(self):
        return self.interpreter.variables["mission.gate"]

    def step(self, known):
        """Looks at what is known now, and goes to another state if that is due."""
        self.known.update(known)
        self.interpreter.step(round(known["now_s"] * 1e9))
