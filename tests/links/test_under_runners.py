"""Every link under every runner: pages are exchanged and both nodes end in order, or an error names the alternative."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import pytest

from snr_sim import (
    CommandReceiverFactory,
    Config,
    Endpoint,
    EndpointFactory,
    LocalConsoleFactory,
    MemoryLink,
    MultiProcRunner,
    Node,
    PipeLoopFactory,
    RemoteConsole,
    SimRunner,
    SocketsPair,
    SynchronousRunner,
    Task,
    TaskType,
    TimeoutLoopFactory,
    Tls,
    ZenohNet,
    tasks,
)
from snr_sim.core.process.factory_pickling import pickle_factory, unpickle_factory
from snr_sim.links.options import LinkOptions
from snr_sim.links.pipes import PipesPair
from snr_sim.prelude.errors import ComponentFailedError, ConfigError, LinkError
from snr_sim.testing.function_components import FunctionLoopFactory

from .conftest import free_port

README = Path(__file__).parents[2] / "README.md"
SECRET = "a secret of more than 16 bytes"
LIMIT_S = 60.0
WIRES = ("tcp", "tls", "pipe", "zenoh")
PAGES = 3  # per link and direction


class Asks(Endpoint):
    """Sends a number on each link, the next after each reply; ends after all replies and the console's event."""

    factory: AsksFactory

    def __init__(self, factory: AsksFactory, parent: Node) -> None:
        super().__init__(factory, parent, "asks")
        self.back = dict.fromkeys(factory.links, 0)
        self.task_handlers = {(TaskType.process_data, f"back_{link}"): self.on_back for link in factory.links}
        self.task_handlers[TaskType.process_data, "go"] = self.on_go
        self.may_go = not factory.waits_for_console

    def begin(self) -> None:
        """Send the first number on each link."""
        for link in self.back:
            self.store_data(f"there_{link}", 1)

    def on_back(self, task: Task, task_id: Any) -> Any:
        link = task.name.removeprefix("back_")
        self.back[link] = self.get_data(task.name)
        if self.back[link] < PAGES:
            return self.store_data_task(f"there_{link}", self.back[link] + 1)
        return self.ends()

    def on_go(self, task: Task, task_id: Any) -> Any:
        self.may_go = True
        return self.ends()

    def ends(self) -> Any:
        if not self.may_go or set(self.back.values()) != {PAGES}:
            return None
        return [self.store_data_task("over", True), tasks.finish("all came back")]

    def terminate(self) -> None:
        """Print the numbers received."""
        print("asked", self.back, self.parent.exit_reason)


class AsksFactory(EndpointFactory):
    def __init__(self, links: tuple[str, ...], waits_for_console: bool = False) -> None:
        super().__init__()
        self.links = links
        self.waits_for_console = waits_for_console

    def get(self, parent: Node) -> Asks:
        return Asks(self, parent)


class Answers(Endpoint):
    """Sends each number back on the link that it arrived on."""

    factory: AnswersFactory

    def __init__(self, factory: AnswersFactory, parent: Node) -> None:
        super().__init__(factory, parent, "answers")
        self.came = dict.fromkeys(factory.links, 0)
        self.task_handlers = {(TaskType.process_data, f"there_{link}"): self.on_there for link in factory.links}
        self.task_handlers[TaskType.process_data, "over"] = lambda task, task_id: tasks.terminate("as requested")

    def on_there(self, task: Task, task_id: Any) -> Task:
        link = task.name.removeprefix("there_")
        self.came[link] = self.get_data(task.name)
        return self.store_data_task(f"back_{link}", self.came[link])

    def terminate(self) -> None:
        """Print the numbers received."""
        print("answered", self.came, self.parent.exit_reason)


class AnswersFactory(EndpointFactory):
    def __init__(self, links: tuple[str, ...]) -> None:
        super().__init__()
        self.links = links

    def get(self, parent: Node) -> Answers:
        return Answers(self, parent)


def ends_of(link: str, files: dict[str, str], zenoh_port: int) -> tuple[Any, Any]:
    """Return the factories of a link's two ends."""
    there, back = [f"there_{link}", "over"], f"back_{link}"
    if link == "zenoh":
        pytest.importorskip("zenoh")  # part of snr_sim[dev]
        listen = f"tcp/127.0.0.1:{zenoh_port}"
        net = ZenohNet(name="zenoh")
        return net.link(there, listen=listen), net.link(back, connect=listen)
    pair: Any
    if link == "pipe":
        pair = PipesPair()
    else:
        tls = Tls(files["robot_cert"], files["robot_key"], files["authority"]) if link == "tls" else None
        pair = SocketsPair(("127.0.0.1", 0), name=link, secret=SECRET, tls=tls)
    return pair.server(there), pair.client(back)


def both_roles(links: tuple[str, ...], files: dict[str, str], *more: Any, zenoh_port: int = 7447) -> Config:
    """Return two roles with all these links between them; `more` are further components of the first."""
    ends = [ends_of(link, files, zenoh_port) for link in links if link != "memory"]
    timeout = TimeoutLoopFactory(seconds=LIMIT_S)
    return Config(
        factories={
            "left": [*(end for end, _ in ends), AsksFactory(links, bool(more)), timeout, *more],
            "right": [*(end for _, end in ends), AnswersFactory(links), timeout],
        }
    )


def assert_all_came(out: str, links: tuple[str, ...]) -> None:
    came = dict.fromkeys(links, PAGES)
    assert f"asked {came} all came back\n" in out
    assert f"answered {came} as requested\n" in out


@pytest.mark.parametrize("link", ["memory", *WIRES])
def test_sim_runner_carries_pages_of_every_link_both_ways(
    link: str, files: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    keys = ["there_memory", "back_memory", "over"]
    memory = [MemoryLink(keys, "left", "right", both_ways=True)] if link == "memory" else []
    SimRunner(both_roles((link,), files), links=memory, until_s=10.0).run()
    assert_all_came(capsys.readouterr().out, (link,))


def send_go(console: CommandReceiverFactory) -> None:
    """Send what a user would type at `snr console`, as soon as the port is known."""
    deadline_s = time.monotonic() + LIMIT_S
    while console.port == 0 and time.monotonic() < deadline_s:
        time.sleep(0.01)
    RemoteConsole(("127.0.0.1", console.port), ["store go true"], wait_s=LIMIT_S).run()


@pytest.mark.slow
def test_multi_proc_runner_carries_pages_of_every_link_both_ways(
    files: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    console = CommandReceiverFactory(0)
    config = both_roles(WIRES, files, console, zenoh_port=free_port())
    person = threading.Thread(target=send_go, args=[console])
    person.start()
    MultiProcRunner(config).run()
    person.join(LIMIT_S)
    assert_all_came(capsys.readouterr().out, WIRES)


@pytest.mark.slow
def test_runners_on_threads_carry_pages_of_every_link_both_ways(
    files: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    console = CommandReceiverFactory(0)
    config = both_roles(WIRES, files, console, zenoh_port=free_port())
    threads = [threading.Thread(target=SynchronousRunner(role, config).run) for role in config.factories]
    for thread in [*threads, person := threading.Thread(target=send_go, args=[console])]:
        thread.start()
    for thread in [*threads, person]:
        thread.join(LIMIT_S)
    assert_all_came(capsys.readouterr().out, WIRES)


@pytest.mark.slow
def test_rov_py_of_the_readme_runs_under_multi_proc_runner(tmp_path: Path) -> None:
    program = re.findall(r"```python\n(.*?)```", README.read_text(), flags=re.DOTALL)[3]
    program = program.replace("CliRunner", "MultiProcRunner").replace("9120", "0")
    (tmp_path / "rov.py").write_text(program)
    with subprocess.Popen([sys.executable, "rov.py"], cwd=tmp_path, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "[topside] 1.5 m\n"
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=LIMIT_S)
    assert process.returncode == 0


def test_local_console_in_a_process_raises_config_error_with_fix() -> None:
    with pytest.raises(ConfigError) as caught:
        MultiProcRunner(Config(factories={"a": [LocalConsoleFactory()]})).run()
    assert str(caught.value) == (
        "Role 'a' runs in a process of its own. LocalConsoleFactory reads from the terminal, which only the program "
        "that starts the processes has.\n"
        "  Try: CommandReceiverFactory(54321) in this role, and `snr console 54321` in another terminal."
    )


RUNNERS: dict[str, Callable[[Config], Any]] = {
    "synchronous": lambda config: SynchronousRunner("a", config).run(),
    "simulated": lambda config: SimRunner(config).run(),
    "processes": lambda config: MultiProcRunner(config).run(),
}


@pytest.mark.parametrize("runner", ["synchronous", "simulated", pytest.param("processes", marks=pytest.mark.slow)])
def test_memory_link_among_factories_raises_config_error_with_fix(runner: str) -> None:
    config: Any = Config(factories={"a": [MemoryLink(["x"], "a", "b")]})
    with pytest.raises(
        (ConfigError, ComponentFailedError), match=r"SimRunner\(config, links=\[link\]\); between processes"
    ):
        RUNNERS[runner](config)


@pytest.mark.slow
def test_port_in_use_raises_error_before_any_process_starts(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        pair = SocketsPair(("127.0.0.1", taken.getsockname()[1]))
        first = CommandReceiverFactory(0)
        runner = MultiProcRunner(Config(factories={"a": [first, AnswersFactory(())], "b": [pair.server()]}))
        with pytest.raises(LinkError, match="take another port"):
            runner.run()
    assert capsys.readouterr().out == ""
    socket.create_server(("127.0.0.1", first.port)).close()  # the port that was opened before is closed again


def goes_when_up(ticker: Any) -> None:
    if (ticker.get_data("link_pipe") or {}).get("up"):
        os._exit(0)  # without a goodbye


def ends_when_down(ticker: Any) -> None:
    state = ticker.get_data("link_pipe") or {"up": True}
    if not state["up"] and state["received"]:
        print(state["reason"])
        ticker.schedule(tasks.terminate("down"))


@pytest.mark.slow
def test_ended_process_takes_its_pipe_link_down_at_once(capsys: pytest.CaptureFixture[str]) -> None:
    pair = PipesPair(LinkOptions("pipe", timeout_s=LIMIT_S))
    config = Config(
        factories={
            "left": [pair.client(), TimeoutLoopFactory(seconds=LIMIT_S), FunctionLoopFactory(ends_when_down)],
            "right": [pair.server(["link_pipe"]), FunctionLoopFactory(goes_when_up)],
        }
    )
    MultiProcRunner(config).run()
    assert "[left] the connection" in capsys.readouterr().out


def test_pipe_sent_to_a_process_keeps_descriptor_and_direction() -> None:
    ours, theirs = Pipe()
    packed = pickle_factory(PipeLoopFactory(theirs), "a pipe", "Role 'a'")
    assert packed["descriptors"] == [theirs.fileno()]
    there = unpickle_factory(packed).conn
    ours.send_bytes(b"hello")
    assert there.recv_bytes() == b"hello"
    there._handle = None  # in this one process both have the same descriptor, and only one may close it
    for end in (ours, theirs):
        end.close()
