"""The state machine of the mission: which state it is in, since when, and for which gate. It knows no pages.

Try it without a robot:

    machine = Machine(gates=3)
    machine.step({"now_s": 3.0, "stop": False, "reset": False, "is_ready": True, ...})
"""

READY_S = 2.0  # the vehicle's speed controllers need this time before they are armed
STAY_S, NEAR_M = 1.0, 0.25  # lined up after this time within this distance of the point before a gate
BEHIND_M = 0.4  # passed within this distance of the point behind a gate

# Step 2: for each state the states that may follow. The picture in the README has seven states and all their arrows.
FOLLOWS = {
    "waiting": ("lining_up",),
    "lining_up": (),
}


class Machine:
    def __init__(self, gates):
        self.gates = gates
        self.state = "waiting"
        self.since_s = 0.0
        self.gate = 0  # the gate it is at: 0, 1, 2, and 3 when all are passed

    def go(self, state, now_s):
        """Goes to another state, if there is an arrow."""
        if state not in FOLLOWS[self.state]:
            raise ValueError(f"no arrow leads from {self.state} to {state}")
        self.state, self.since_s = state, now_s

    def step(self, known):
        """Looks at what is known now, and goes to another state if that is due."""
        now_s = known["now_s"]
        in_state_s = now_s - self.since_s
        is_due = in_state_s >= READY_S and known["is_ready"] and known["has_fix"]
        if self.state == "waiting" and is_due:
            self.go("lining_up", now_s)
