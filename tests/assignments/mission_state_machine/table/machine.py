"""The state machine of the mission as a table. It knows no pages; `known` is from mission.py."""

from snr_sim.behaviors import Interpreter, after, always, exits, machine, on, state

READY_S = 2.0  # the vehicle's speed controllers need this time before they are armed
STAY_S, NEAR_M = 1.0, 0.25  # lined up after this time within this distance of the point before a gate
BEHIND_M = 0.4  # passed within this distance of the point behind a gate
UP_M = 0.5  # who is less deep than this has come up


def known(name):
    return lambda m: m.data(name)


def is_over(limit_s):
    return lambda m: m.in_state_s > limit_s


def is_not_seen(m):
    return not m.data("has_fix")


def is_near(m):
    return m.data("distance_m") <= NEAR_M


def is_far(m):
    return m.data("distance_m") > NEAR_M


def is_behind(m):
    return m.data("distance_m") <= BEHIND_M


def is_up(m):
    return m.data("depth_m") < UP_M


def is_released(m):
    return m.data("reset") and not m.data("stop")


def are_all_passed(m):
    return m.variables["gate"] == m.variables["gates"]


def goes_up_at_once(m):
    return m.data("is_ready") and (m.data("is_wet") or are_all_passed(m))


def may_begin(m):
    return m.data("is_ready") and m.data("has_fix")


def count(m):
    m.variables["gate"] += 1


LINE = machine(
    "line",
    initial="far",
    states=[
        state("far", on(is_near, to="near")),
        state("near", on(is_far, to="far"), exits(after(STAY_S, to="passing"))),
    ],
)

MISSION = machine(
    "mission",
    initial="waiting",
    variables={"gate": 0, "gates": 3},
    anywhere=[on(known("stop"), to="stopped")],
    states=[
        state(
            "waiting",
            after(READY_S, to="surfacing", when=goes_up_at_once),
            after(READY_S, to="lining_up", when=may_begin),
        ),
        state(
            "lining_up",
            on(known("is_wet"), to="surfacing"),
            on(is_over(30.0), to="surfacing"),
            on(is_not_seen, to="holding"),
            machines=[LINE],
        ),
        state(
            "passing",
            on(known("is_wet"), to="surfacing"),
            on(is_over(20.0), to="surfacing"),
            on(is_not_seen, to="holding"),
            on(is_behind, to="passed"),
        ),
        state("passed", always(to="surfacing", when=are_all_passed), always(to="lining_up"), enter=count),
        state(
            "holding",
            on(known("is_wet"), to="surfacing"),
            on(is_over(5.0), to="surfacing"),
            on(known("has_fix"), to="lining_up"),
        ),
        state("surfacing", on(is_up, to="done"), on(is_over(20.0), to="done")),
        state("done"),
        state("stopped", on(is_released, to="waiting")),
    ],
)


class Machine:
    """What mission.py uses: a state, a gate, and since when."""

    def __init__(self, gates):
        self.known = {}
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
