"""Takes the engine out, brings another one in, and has everything reloaded."""

from falling import falling

from snr_sim import tasks


def act(pilot):
    requested = [
        tasks.remove_component("engine_actuator"),
        tasks.remove_component("radar_sensor"),
        tasks.reload_component("all"),
    ]
    return requested[pilot.times % 3]


def factories(robot):
    return falling(act)
