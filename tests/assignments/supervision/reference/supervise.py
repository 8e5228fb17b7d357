from snr_sim.supervision import Child, Intensity, Supervisor, Timeouts

RESTARTS, WITHIN_S = 3, 30.0


class Watchdog:
    def __init__(self):
        self.timeouts_s = {}
        self.reported_s = {}

    def add(self, name, timeout_s, now_s):
        self.timeouts_s[name] = timeout_s
        self.reported_s[name] = now_s

    def pet(self, name, now_s):
        if name in self.timeouts_s:
            self.reported_s[name] = now_s

    def extend(self, name, timeout_s):
        if name in self.timeouts_s:
            self.timeouts_s[name] = timeout_s

    def hanging(self, now_s):
        return sorted(name for name, timeout_s in self.timeouts_s.items() if now_s - self.reported_s[name] >= timeout_s)


def delay_s(failures):
    return min(0.1 * 2.0 ** min(failures, 20), 5.0)


def may_restart(restarted_s, now_s):
    recent = [one for one in restarted_s if now_s - one < WITHIN_S]
    return len(recent) < RESTARTS


def plan():
    camera = Child("camera", "on_failure", Timeouts(setup_s=30.0))
    return Supervisor(
        "root",
        [
            Child("motors", "on_failure", Timeouts(hang_s=0.5)),
            Child("state_manager", "on_failure"),
            Supervisor("vision", [camera, Child("detector", "on_failure")], strategy="rest_for_one"),
            Child("navigator", "on_failure"),
            Supervisor("surface", [Child("page", "on_failure")], intensity=Intensity(10, 30.0)),
        ],
    )
