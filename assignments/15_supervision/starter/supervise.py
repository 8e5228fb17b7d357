"""Which parts of a rover are started again: after which failure, when, and together with which others.

    motors          owns the motors' lines, and brakes when no command comes
    state_manager   passes messages between all others
    camera          takes pictures; needs up to 20 s to start
    detector        looks for stones in the camera's stream: useless without the camera that it was started with
    navigator       plans the way
    page            shows everything to a person; it may fail often, and a person may close it

All times are arguments, in seconds of one clock, so that a story of an hour is tried in no time.
"""

from snr_sim.supervision import Child, Supervisor

RESTARTS, WITHIN_S = 3, 30.0


class Watchdog:
    """Knows which parts have not reported for too long."""

    def __init__(self):
        self.timeouts_s = {}  # by name of the part
        self.reported_s = {}

    def add(self, name, timeout_s, now_s):
        """Begin to watch a part."""
        # Step 2.

    def pet(self, name, now_s):
        """Note that a part works. One that is not watched has ended, or is unknown: nothing happens."""

    def extend(self, name, timeout_s):
        """Give a watched part another timeout, counted from its last report."""

    def hanging(self, now_s):
        """Return the names of all parts that have been silent for their timeout, sorted."""
        return []


def delay_s(failures):
    """Return the delay before a restart, after so many failures in a row before this one."""
    # Step 3: 0.1 s, then twice as long each time, and 5 s at most.
    return 0.0


def may_restart(restarted_s, now_s):
    """Return whether a part that fails now may be started again; `restarted_s` are the times of its restarts."""
    # Step 4: RESTARTS times in WITHIN_S.
    return True


def plan():
    """Return the tree of supervisors."""
    # Step 5.
    return Supervisor("root", [Child("motors"), Child("page")])
