"""The page for people who come from roveberrypy is correct: what it names exists, and nothing is left out."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

import snr_sim.processes
from snr_sim.processes.rover_server import RoverServer
from snr_sim.processes.seed_names import SEED_NAMES
from snr_sim.processes.state_manager import StateManager

TOP = Path(__file__).parents[1]
PAGE = TOP / "docs" / "coming_from_roveberrypy.md"
DOCUMENTED = """
RoverProcess RoverMessage RoverServer StateManager Watchdog uplink downlink quit main enabledModules
setup loop messageTrigger on_quit cleanup publish subscribe unsubscribe subscriptions log
watchdogPet watchdogExtend watchdogReset getHanging
spawnThread getDevice getSubscription reqSubscription listenToDevice readCmd sendCmd
addSubscriber removeSubscriber dumpSubscribers terminateState
"""


def rows() -> list[tuple[list[str], list[str]]]:
    """Of each row of a table: the seed's names, and ours."""
    lines = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| `")]
    cells = [line.strip().strip("|").split("|") for line in lines]
    return [(re.findall(r"`([^`]+)`", there), re.findall(r"`([^`]+)`", here)) for there, here, *_ in cells]


def resolve(name: str) -> Any:
    """The thing of a name: a public one of the room, a member of one, or one with its whole address."""
    if name.startswith("snr_sim."):
        parts = name.split(".")
        end = next(i for i, part in enumerate(parts) if part[0].isupper())
        thing, parts = import_module(".".join(parts[:end])), parts[end:]
    else:
        thing, parts = snr_sim.processes, name.split(".")
    for part in parts:
        thing = getattr(thing, part)
    return thing


@pytest.mark.parametrize("name", sorted({name for _, here in rows() for name in here}))
def test_names_listed_as_present_exist(name: str) -> None:
    assert resolve(name) is not None


def test_every_documented_name_is_in_the_tables() -> None:
    named = {name for there, _ in rows() for name in there}
    assert set(DOCUMENTED.split()) - named == set()


@pytest.mark.parametrize("old", sorted(SEED_NAMES))
def test_alias_is_documented_and_is_the_method_of_its_present_name(old: str) -> None:
    ((here, place),) = [(here, there.index(old)) for there, here in rows() if old in there]
    new = SEED_NAMES[old]
    assert here[place].rpartition(".")[2] == new
    kind = StateManager if here[place].startswith("StateManager") else RoverServer
    one = kind.__new__(kind)
    assert getattr(one, old) == getattr(one, new)


def test_readme_leads_to_the_page_and_its_program_runs() -> None:
    assert f"docs/{PAGE.name}" in (TOP / "README.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    names: dict[str, Any] = {"__name__": "rover"}
    exec(program, names)
    assert names["runner"].nodes["Drive"].exit_reason == "time limit"
