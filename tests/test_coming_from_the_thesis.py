"""The page for people who come from the thesis tells the truth: what it names is there, and nothing is left out."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import pytest

import snr_sim

TOP = Path(__file__).parents[1]
PAGE = TOP / "docs" / "coming_from_the_thesis.md"

STARRED = """
tasks Mode DataKey Page TaskType TaskName TaskId Task SomeTasks TaskHandlerMap ComponentsByRole AbstractComponent
AbstractFactory AbstractEndpoint Endpoint EndpointFactory AbstractLoop ThreadLoop LoopFactory AbstractContext
AbstractNode AbstractProfiler AbstractMultiRunner Context Timer Node Config TestRunner CliRunner MultiProcRunner
Consumer SocketsWrapper MovingAvgFilter SocketsLoopFactory SocketsListenerFactory SocketsPair CommandReceiverFactory
RemoteConsole LocalConsole MovingAvgFilterFactory PipeLoopFactory RecorderEndpointFactory TextReader PageReader
TextReplayerFactory ReplayerLoopFactory ListReplayerFactory PrinterEndpointFactory StopwatchEndpointFactory
SNRTestCase Expectations ExpectorProtocol Expector MPExpector OrderedExpector TaskExpectations
ExpectorEndpointFactory TimeoutLoopFactory
"""
REACHABLE = """
SynchronousRunner Role TaskHandler TaskPriority TaskSource TaskScheduler AbstractConfig AbstractConnection
AbstractRunner AbstractTaskQueue CommsLoop CommandProcessorFactory DummyEndpointFactory RootContext TempFile
JsonData Serializable LogLevel ProfilerGetter ReloadTargets TimerProtocol
"""


def rows() -> list[tuple[list[str], list[str]]]:
    """Of each row of a table: the thesis' names, and ours."""
    found = []
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        if line.startswith("| `"):
            there, here, _ = line.strip().strip("|").split("|")
            found.append((re.findall(r"`([^`]+)`", there), re.findall(r"`([^`]+)`", here)))
    return found


def resolve(name: str) -> object:
    """The thing of a name: a public one, a member of one, or one with its whole address."""
    parts = name.removeprefix("snr_sim.").split(".")
    thing: object = snr_sim
    for i, part in enumerate(parts):
        address = ".".join(["snr_sim", *parts[: i + 1]])
        thing = getattr(thing, part) if hasattr(thing, part) else import_module(address)
    return thing


OURS = sorted({name for _, here in rows() for name in here})


@pytest.mark.parametrize("name", OURS)
def test_what_the_page_says_is_here_is_here(name: str) -> None:
    assert resolve(name) is not None


def test_all_58_names_and_those_behind_them_are_in_the_tables() -> None:
    assert (len(STARRED.split()), len(set(STARRED.split()))) == (58, 58)
    told = {name for there, _ in rows() for name in there}
    assert set((STARRED + REACHABLE).split()) - told == set()


def test_a_name_of_the_thesis_that_we_have_is_not_told_to_be_another_or_missing() -> None:
    for there, here in rows():
        for name in there:
            if name in snr_sim.__all__:
                assert name in here, f"{name} is told to be {here or 'missing'}"


def test_the_star_of_core_and_prelude_gives_what_the_page_promises() -> None:
    names: dict[str, object] = {}
    exec(re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)[0], names)
    assert set(snr_sim.__all__) <= set(names)
    for room, wanted in (("core", {"Node", "Endpoint", "LoopFactory"}), ("prelude", {"Task", "Page", "tasks"})):
        alone: dict[str, object] = {}
        exec(f"from snr_sim.{room} import *", alone)
        assert wanted <= set(alone)
        assert set(alone) - {"__builtins__"} <= set(snr_sim.__all__)


def test_the_readme_leads_to_the_page_and_the_page_to_files_that_are_there() -> None:
    assert f"docs/{PAGE.name}" in (TOP / "README.md").read_text(encoding="utf-8")
    text = PAGE.read_text(encoding="utf-8")
    for link in re.findall(r"\]\(([^)#]+)\)", text):
        assert (PAGE.parent / link).exists(), link
    for path in re.findall(r"`(snr_sim/[a-z_/]+\.py)`", text):
        assert (TOP / path).is_file(), path
