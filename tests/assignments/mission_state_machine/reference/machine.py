"""The state machine of the mission: which state it is in, since when, and for which gate. It knows no pages.

Try it without a robot:

    machine = Machine(gates=3)
    machine.step({"now_s": 3.0, "stop": False, "reset": False, "is_ready": True, ...})
"""

READY_S = 2.0  # the vehicle's speed controllers need this time before they are armed
STAY_S, NEAR_M = 1.0, 0.25  # lined up after this time within this distance of the point before a gate
BEHIND_M = 0.4  # passed within this distance of the point behind a gate

UP_M = 0.5  # who is less deep than this has come up
LIMIT_S = {"lining_up": 30.0, "passing": 20.0, "holding": 5.0, "surfacing": 20.0}

FOLLOWS = {
    "waiting": ("lining_up", "surfacing", "stopped"),
    "lining_up": ("passing", "holding", "surfacing", "stopped"),
    "passing": ("lining_up", "holding", "surfacing", "stopped"),
    "holding": ("lining_up", "surfacing", "stopped"),
    "surfacing": ("done", "stopped"),
    "done": ("stopped",),
    "stopped": ("waiting",),
}


class Machine:
    def __init__(self, gates):
        self.gates = gates
        self.state = "waiting"
        self.since_s = 0.0
        self.gate = 0  # the gate it is at: 0, 1, 2, and 3 when all are passed
        self.near_since_s = None

    def go(self, state, now_s):
        """Goes to another state, if there is an arrow."""
        if state not in FOLLOWS[self.state]:
            raise ValueError(f"no arrow leads from {self.state} to {state}")
        self.state, self.since_s, self.near_since_s = state, now_s, None

    def step(self, known):
        """Looks at what is known now, and goes to another state if that is due."""
        following = self.following(known, known["now_s"] - self.since_s)
        if following is not None:
            self.go(following, known["now_s"])

    def following(self, known, in_state_s):
        """Return the state that is due now, or None."""
        if self.state == "stopped":
            return "waiting" if known["reset"] and not known["stop"] else None
        if known["stop"]:
            return "stopped"
        if self.state == "waiting":
            return self.from_waiting(known, in_state_s)
        if self.state == "surfacing":
            return "done" if known["depth_m"] < UP_M or in_state_s > LIMIT_S["surfacing"] else None
        if self.state == "done":
            return None
        if known["is_wet"] or in_state_s > LIMIT_S[self.state]:
            return "surfacing"
        if self.state == "holding":
            return "lining_up" if known["has_fix"] else None
        if not known["has_fix"]:
            return "holding"
        return self.from_lining_up(known) if self.state == "lining_up" else self.from_passing(known)

    def from_waiting(self, known, in_state_s):
        if in_state_s < READY_S or not known["is_ready"]:
            return None
        if known["is_wet"] or self.gate == self.gates:
            return "surfacing"
        return "lining_up" if known["has_fix"] else None

    def from_lining_up(self, known):
        if known["distance_m"] > NEAR_M:
            self.near_since_s = None
        elif self.near_since_s is None:
            self.near_since_s = known["now_s"]
        elif known["now_s"] - self.near_since_s >= STAY_S:
            return "passing"
        return None

    def from_passing(self, known):
        if known["distance_m"] > BEHIND_M:
            return None
        self.gate += 1
        return "lining_up" if self.gate < self.gates else "surfacing"
