"""Commands of every strange kind: not finite, huge, nested, and objects that say they are equal to everything."""

from falling import falling


class Lie(float):
    def __eq__(self, other):
        return True

    __hash__ = None

    def __lt__(self, other):
        return False

    __le__ = __gt__ = __ge__ = __lt__


STRANGE = [
    Lie(float("nan")),
    float("nan"),
    float("inf"),
    10**400,
    [[[1.0]]],
    {"throttle": 1.0},
    None,
    "1",
    b"1",
    object(),
]


def act(pilot):
    return pilot.store_data_task("engine", {"throttle": STRANGE[pilot.times % len(STRANGE)]})


def factories(robot):
    return falling(act)
