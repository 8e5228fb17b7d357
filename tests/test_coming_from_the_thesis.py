"""The page for people who come from the thesis is correct: what it names exists, and nothing is left out."""

import inspect
import pickle
import re
from copy import deepcopy
from importlib import import_module
from pathlib import Path
from typing import Any, Optional

import pytest

import snr_sim
from snr_sim.prelude.errors import ConfigError, RetiredNameError
from snr_sim.prelude.retired import Retired

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


# Of modules' __all__ that were not starred further: reached by `from snr.prelude import *` and the like.
OF_ROOMS = "ComponentName DataDict NodeProtocol OrderedExpectations KalmanFilterFactory RecorderFactory ReplayerFactory"
OF_THE_THESIS = """
MovingAvgEndpointFactory ExpecterEndpointFactory ListReplayerLoop ListReplayerEndpoint CommandProcessorEndpoint
"""
NAMES = (STARRED + REACHABLE + OF_ROOMS + OF_THE_THESIS).split()


def rows(section: str = "") -> list[tuple[list[str], list[str]]]:
    """Of each row of a table: the thesis' names, and ours."""
    found = []
    text = PAGE.read_text(encoding="utf-8")
    if section:
        (text,) = re.findall(rf"\n## {section}\n(.*?)\n## ", text, flags=re.DOTALL)
    for line in text.splitlines():
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
def test_names_listed_as_present_exist(name: str) -> None:
    assert resolve(name) is not None


def test_all_58_names_and_those_behind_them_are_in_the_tables() -> None:
    assert (len(STARRED.split()), len(set(STARRED.split()))) == (58, 58)
    named = {name for there, _ in rows() for name in there}
    assert set(NAMES) - named == set()


@pytest.mark.parametrize("module", ["snr_sim", "snr_sim.core", "snr_sim.prelude"])
def test_a_star_import_gives_every_name_of_the_2021_library(module: str) -> None:
    names: dict[str, object] = {}
    exec(f"from {module} import *", names)
    assert set(NAMES) - set(names) == set()


def test_each_old_name_exists_or_raises_with_replacement() -> None:
    for there, here in rows():
        for place, name in enumerate(there):
            if name not in NAMES:
                continue
            thing = getattr(snr_sim, name)
            if isinstance(thing, Retired):
                assert name not in here, f"{name} is listed as present"
                with pytest.raises(RetiredNameError, match=rf"(?s)^'{name}' of the 2021 library.*Try: .+\."):
                    thing()
            else:
                assert here, f"{name} is listed as missing"
                assert thing == resolve(here[place if len(here) == len(there) else 0]), name


def test_a_retired_name_can_be_imported_and_annotated_with_and_nothing_else() -> None:
    retired: Any = snr_sim.Consumer

    def takes(one: retired, several: list[retired], maybe: Optional[retired], made: retired[int]) -> None: ...  # noqa: UP045

    with pytest.raises(RetiredNameError):
        retired[int]("name", print, 0.1)
    with pytest.raises(RetiredNameError):
        exec("class Mine(retired): ...", {"retired": retired})
    with pytest.raises(RetiredNameError):
        isinstance(takes, retired)
    assert not hasattr(retired, "put")
    for copy in (
        deepcopy(retired),
        pickle.loads(pickle.dumps(retired)),
    ):
        with pytest.raises(RetiredNameError, match="'Consumer' of the 2021 library"):
            copy()


def test_console_of_2021_raises_with_replacement() -> None:
    with pytest.raises(
        ConfigError, match=r"(?s)LocalConsole is a loop of the node.*RemoteConsole\(\('127\.0\.0\.1', port\)"
    ):
        snr_sim.LocalConsole(54321, ["list endpoints", "exit"])


def test_joining_a_profiler_raises_with_reason() -> None:
    for name in ("is_alive", "join_from"):
        with pytest.raises(RetiredNameError, match="it has no thread"):
            getattr(snr_sim.Profiler(), name)


# What there was of endpoints, loops and nodes, and whether it works or answers with what to write instead.
MEMBERS = {
    "self": "begin halt terminate join schedule page get_page get_data store_data store_data_task store_page "
    "dbg info warn err fatal "
    "task_store_page task_store_data timer profiler profile check_main_thread get_task_handler",
    "loop": "setup loop set_terminate_flag is_terminated delay_s set_delay",
    "node": "loop schedule page store_page store_data get_page get_data get_time_s set_terminate_flag is_terminated "
    "dbg info warn err fatal log "
    "terminate synchronous_store get_task_handlers handle_task execute_task get_new_tasks dump_data timer",
}


@pytest.mark.parametrize(
    ("owner", "kind", "section"),
    [
        ("self", snr_sim.Endpoint, "What a component has"),
        ("loop", snr_sim.Loop, "What a component has"),
        ("node", snr_sim.Node, "Node"),
    ],
)
def test_member_exists_or_raises_and_is_listed_in_page(owner: str, kind: Any, section: str) -> None:
    named = {name.removeprefix("self.").removesuffix("()") for there, _ in rows(section) for name in there}
    for name in MEMBERS[owner].split():
        assert name in named
        member = inspect.getattr_static(kind, name, None)
        if isinstance(member, Retired):
            with pytest.raises(RetiredNameError, match=rf"(?s){name}' of the 2021 library.*Try: .+\."):
                getattr(kind, name)
        else:
            assert member is not None, name


def test_star_import_of_core_and_prelude_equals_page() -> None:
    names: dict[str, object] = {}
    exec(re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)[0], names)
    assert set(snr_sim.__all__) <= set(names)


def test_the_readme_leads_to_the_page_and_the_page_to_files_that_are_there() -> None:
    assert f"docs/{PAGE.name}" in (TOP / "README.md").read_text(encoding="utf-8")
    text = PAGE.read_text(encoding="utf-8")
    for link in re.findall(r"\]\(([^)#]+)\)", text):
        assert (PAGE.parent / link).exists(), link
    for path in re.findall(r"`(snr_sim/[a-z_/]+\.py)`", text):
        assert (TOP / path).is_file(), path


def test_names_of_the_library_can_be_imported_from_std_mods() -> None:
    from snr_sim.std_mods import Endpoint, SocketsLoopFactory  # type: ignore[attr-defined]

    assert (Endpoint, SocketsLoopFactory) == (snr_sim.Endpoint, snr_sim.SocketsLoopFactory)
    with pytest.raises(AttributeError, match="no attribute 'Endpiont'"):
        _ = snr_sim.std_mods.Endpiont  # type: ignore[attr-defined]
