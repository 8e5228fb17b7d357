"""The newest command page of a key, whose data are converted to a command or rejected with an explanation."""

import math
from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest

from snr_sim.devices.commands import CommandInput, command_of
from snr_sim.prelude.errors import CommandError
from snr_sim.prelude.task import Page


class Pwm(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    pulses_us: list[float]
    gear: int = 1
    mode: str = "idle"


LIMITS = {"pulses_us": (1100.0, 1900.0)}


@pytest.mark.parametrize(
    "data",
    [Pwm([1500.0]), {"pulses_us": [1500]}, {"pulses_us": np.array([1500.0])}, {"pulses_us": (np.float32(1500),)}],
)
def test_command_of_accepts_struct_dict_and_numpy(data: Any) -> None:
    assert command_of(data, Pwm, LIMITS) == Pwm([1500.0])


@pytest.mark.parametrize(
    ("data", "message", "fix"),
    [
        ({}, "it has no field 'pulses_us'.", '{"pulses_us": ..., "gear": 1, "mode": \'idle\'}'),
        ({"pulses_us": [1500, "x"]}, "pulses_us[1] is the text 'x', but must be a number from 1100 to 1900.", "pulses"),
        ({"pulses_us": 5}, "pulses_us is the number 5, but must be a list, each a number from 1100 to 1900.", "pulses"),
        ({"pulses_us": [], "gear": 1.5}, "gear is the number 1.5, but must be a whole number.", "gear"),
        ({"pulses_us": [], "mode": 7}, "mode is the number 7, but must be a str.", "mode"),
        ({"puls_us": []}, "it has the field 'puls_us', which this actuator does not know.", "mean 'pulses_us'?"),
        ({5: []}, "it has the field 5, which this actuator does not know.", "one of: gear, mode, pulses_us."),
        (["x"], "it is the list ['x'], but must be a dict.", "store a dict"),
        (object, "it is <class 'object'>, which is of the type type, but must be a dict.", "store a dict"),
        ({"pulses_us": ["x" * 500]}, "xxx..., but must be a number", "pulses_us"),
    ],
)
def test_command_of_invalid_data_raises_command_error(data: Any, message: str, fix: str) -> None:
    with pytest.raises(CommandError) as caught:
        command_of(data, Pwm, LIMITS)
    assert message in caught.value.message
    assert fix in caught.value.fix
    assert len(caught.value.message) < 200


class Store:
    """Page store of a loop's node."""

    name = "robot"

    def __init__(self) -> None:
        self.page: Page | None = None
        self.listeners: list[Any] = []
        self.time_s = 0.0

    def add_store_listener(self, key: str, callback: Any) -> None:
        self.listeners.append(callback)

    def remove_store_listener(self, key: str, callback: Any) -> None:
        self.listeners.remove(callback)

    def get_page(self, key: str) -> Page | None:
        return self.page

    def get_time_s(self) -> float:
        return self.time_s

    def store(self, data: Any) -> Page:
        self.page = Page("engine", data, self.name, self.time_s)
        for callback in self.listeners:
            callback(self.page)
        return self.page


def test_newest_page_is_the_nodes_before_and_after_begin() -> None:
    store = Store()
    wakes: list[float] = []
    loop: Any = SimpleNamespace(parent=store, wake=lambda: wakes.append(store.time_s))
    commands = CommandInput(loop, "engine")
    assert commands.newest() == (None, math.inf)
    early = store.store(1)
    store.time_s = 0.5
    assert commands.newest() == (early, 0.5)
    commands.begin()
    assert commands.newest() == (early, 0.5)
    late = store.store(2)
    assert commands.newest() == (late, 0.0)
    assert wakes == [0.5]
    commands.end()
    commands.end()
    missed = store.store(3)
    commands.begin()
    assert commands.newest() == (missed, 0.0)
    assert wakes == [0.5]
