"""Watchdog: runs the autopilot also without readings, so that outputs become neutral and the surface gets a reason."""

from __future__ import annotations

from snr_sim import Loop, tasks

UNANSWERED_S = 0.1  # the inertial unit is answered with a command 50 times a second


class Watch(Loop):
    """Loop that repeats page 'imu' ten times a second while nothing is commanded; never in a healthy run."""

    max_tick_rate_hz = 10.0
    first_tick_after_s = 0.5

    def loop(self) -> None:
        """Check the age of the newest command."""
        page = self.parent.datastore.pages.get("pwm")
        if page is None or self.get_time_s() - page.created_at_s > UNANSWERED_S + 1e-9:
            self.schedule(tasks.process_data("imu"))
