"""Ends the run before it touches the ground, with the words of the referee."""

from falling import falling

from snr_sim import tasks


def act(pilot):
    return [tasks.finish("landed"), tasks.terminate("landed")] if pilot.times > 5 else None


def factories(robot):
    return falling(act)
