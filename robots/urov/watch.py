"""Watchdog: runs the autopilot also without readings, so that outputs become neutral and the surface gets a reason."""

from __future__ import annotations

from snr_sim import Loop, LoopFactory, tasks
from snr_sim.scenario import NodeApi

RATE_HZ = 10.0
UNANSWERED_S = 0.1  # the inertial unit is answered with a command 50 times a second


class WatchFactory(LoopFactory):
    """Makes the watch."""

    def get(self, parent: NodeApi) -> Watch:
        """Return the loop 'watch'."""
        return Watch(self, parent, "watch", RATE_HZ)


class Watch(Loop):
    """Loop that repeats page 'imu' ten times a second while nothing is commanded; never in a healthy run."""

    first_tick_after_s = 0.5

    def loop(self) -> None:
        """Check the age of the newest command."""
        page = self.parent.datastore.pages.get("pwm")
        if page is None or self.get_time_s() - page.created_at_s > UNANSWERED_S + 1e-9:
            self.schedule(tasks.process_data("imu"))
