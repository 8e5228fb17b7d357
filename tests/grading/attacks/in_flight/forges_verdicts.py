"""Says by pages and events of every name that it has landed."""

from falling import falling

from snr_sim import tasks


def act(pilot):
    made = [tasks.event(name, ["landed", True, 100]) for name in ("verdict", "landed", "result", "score", "referee")]
    data = {"outcome": "landed", "success": True, "altitude_m": 0.0, "points": 100}
    keys = ("verdict", "truth", "score", "result", "outcome", "metrics", "telemetry", "node_core")
    return [*made, *(pilot.store_data_task(key, data) for key in keys)]


def factories(robot):
    return falling(act)
