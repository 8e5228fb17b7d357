"""Processes that exist in a test only: they execute the orders of a tree, and check what must hold for each order."""

from snr_sim.supervision.members import Branch, Process
from snr_sim.supervision.plan import Backoff, Intensity, Restart, Strategy, Supervisor, Timeouts
from snr_sim.supervision.plan import Child as Child
from snr_sim.supervision.tree import Order, Tree

TIMEOUTS = Timeouts(setup_s=4.0, hang_s=3.0, end_s=2.0)
BACKOFF = Backoff(first_s=1.0, longest_s=4.0, healthy_s=20.0)


def child(name: str, restart: Restart = "always") -> Child:
    return Child(name, restart, TIMEOUTS)


def group(
    name: str, *children: Child | Supervisor | str, strategy: Strategy = "one_for_one", restarts: int = 3
) -> Supervisor:
    members = [child(one) if isinstance(one, str) else one for one in children]
    return Supervisor(name, members, strategy, Intensity(restarts, 10.0))


class World:
    """A tree, its processes, and the time.

    Attributes:
        asked_s: for each process that runs, when it was asked to end; None if it was not.
        log: all orders, as text.
    """

    def __init__(self, plan: Supervisor) -> None:
        self.tree = Tree(plan, BACKOFF)
        self.now_s = 0.0
        self.asked_s: dict[str, float | None] = {}
        self.log: list[str] = []
        self.stops = 0
        self.is_latched = False
        self.execute(self.tree.begin(0.0))

    def take_log(self) -> list[str]:
        log, self.log = self.log, []
        return log

    # Events

    def tick(self, seconds: float) -> None:
        """Lets time pass; all at once, as on a computer that was busy."""
        self.now_s += seconds
        self.execute(self.tree.tick(self.now_s))

    def run(self, seconds: int, *working: str) -> None:
        """Lets time pass second by second, while some processes report."""
        for _ in range(seconds):
            for name in working:
                if self.asked_s.get(name, 0.0) is None:
                    self.pet(name)
            self.tick(1.0)

    def pet(self, name: str) -> None:
        if name in self.asked_s:
            self.tree.petted(name, self.now_s)

    def end(self, name: str, status: int = 0, why: str = "it broke") -> None:
        if name in self.asked_s:
            del self.asked_s[name]
            self.execute(self.tree.ended(name, status, why, self.now_s))

    def answer(self) -> None:
        """Ends each process that was asked to, and those asked then, until none is."""
        while asked := [name for name, asked_s in self.asked_s.items() if asked_s is not None]:
            self.end(asked[0])

    def stop(self) -> None:
        self.stops += 1
        self.is_latched = True
        self.execute(self.tree.stop(self.now_s))

    # Orders

    def execute(self, orders: list[Order]) -> None:
        for what, name in orders:
            self.log.append(f"{what} {name}".strip())
            if what == "start":
                assert name not in self.asked_s, "two instances"
                assert not self.is_latched, "a start after the stop"
                self.asked_s[name] = None
            elif what == "end":
                assert self.asked_s[name] is None, "asked twice"
                self.asked_s[name] = self.now_s
                self._check_order(name)
            elif what == "kill":
                asked_s = self.asked_s[name]
                assert asked_s is not None
                assert self.stops > 2 or self.now_s - asked_s >= TIMEOUTS.end_s
            else:
                assert self.tree.safe_stop != "", "a safe stop without a reason"
                assert self.log.count("safe stop") == 1
                self.is_latched = True
        self._check_members(self.tree.root)

    def _check_order(self, name: str) -> None:
        """What was started after a process has ended before it is asked; a hang, or a second Ctrl-C, does not wait."""
        process = self.tree.process(name)
        if process.life == "hung" or self.stops > 1:
            return
        group = self.tree.root if self.is_latched else process.parent
        assert group is not None
        names = [one.name for one in group.processes()]
        assert not [later for later in names[names.index(name) + 1 :] if later in self.asked_s]

    def _check_members(self, branch: Branch) -> None:
        """No supervisor restarts more than it may, and nothing that is to run is forgotten."""
        for part in branch.parts():
            if isinstance(part, Process):
                assert part.is_up == (part.name in self.asked_s)
                is_required = part.child.restart == "always" and not self.is_latched
                assert part.is_up or not is_required or is_changing(part)
        for group in (branch, *branch.parts()):
            if isinstance(group, Branch) and not self.is_latched and not is_changing(group):
                assert group.budget_left(self.now_s) >= 0


def is_changing(member: Branch | Process) -> bool:
    """Whether it, or a group that it is in, is to be started again, or is being ended."""
    is_ending = isinstance(member, Branch) and member.down_from is not None
    return (
        is_ending
        or member.restart_at_s is not None
        or (member.parent is not None and (member.is_going_down or is_changing(member.parent)))
    )
