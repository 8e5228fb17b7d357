"""RoverProcesses in one lock step: their life, what they publish and receive, and what their mistakes say."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

import snr_sim.links.link
from snr_sim.core.clocks import SimClock
from snr_sim.links.faults import LinkFaults
from snr_sim.links.link import Link
from snr_sim.links.messages import decode_page, encode_page
from snr_sim.prelude.errors import ComponentFailedError, ConfigError
from snr_sim.prelude.task import Page
from snr_sim.processes.message import LINK_PAGE
from snr_sim.processes.process_components import ProcessEndpoint
from snr_sim.processes.rover_process import RoverProcess
from snr_sim.processes.runner import ProcessRunner
from snr_sim.processes.state_manager import StateManager
from snr_sim.recording.reader import read_trace
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME
from snr_sim.supervision.health import Health
from snr_sim.supervision.plan import Child, Supervisor

HERE = Path(__file__).parent


class Script(RoverProcess):
    """Calls a function at each time: `with_args(at={1.0: function})`. Keeps what it has received."""

    got: list[tuple[str, Any]]
    called: list[str]

    def setup(self, args: Any) -> None:
        self.got, self.called, self.at = [], ["setup"], args.get("at", {})
        for key in args.get("keys", ()):
            self.subscribe(key)

    def loop(self) -> Iterator[float]:
        now_s = 0.0
        for time_s, act in self.at.items():
            if time_s > now_s:
                yield time_s - now_s
            now_s = time_s
            act(self)
        yield 1e6

    def message_trigger(self, message: Any) -> None:
        self.got.append(tuple(message))

    def on_quit(self, data: Any) -> None:
        self.called.append("on_quit")

    def cleanup(self) -> None:
        self.called.append("cleanup")


def script(name: str, at: dict[float, Callable[[Any], object]] | None = None, *keys: str) -> Any:
    return Script.with_args(name=name, at=at or {}, keys=keys)


def publish(*pairs: tuple[str, Any]) -> Callable[[Any], None]:
    def act(process: Any) -> None:
        for key, value in pairs:
            process.publish(key, value)

    return act


def process(runner: ProcessRunner, name: str) -> Any:
    endpoint = runner.nodes[name].components[name]
    assert isinstance(endpoint, ProcessEndpoint)
    return endpoint.process


def broker(runner: ProcessRunner) -> StateManager:
    found = runner.nodes["state_manager"].components["state_manager"]
    assert isinstance(found, StateManager)
    return found


def link_of(runner: ProcessRunner) -> Link:
    found = runner.nodes["state_manager"].components[LINK_PAGE]
    assert isinstance(found, Link)
    return found


def simulate(*processes: Any, until_s: float = 10.0, **options: Any) -> ProcessRunner:
    runner = ProcessRunner(processes, **options)
    runner.simulate(until_s)
    return runner


def notes(runner: ProcessRunner, name: str) -> str:
    return "\n".join(runner.nodes[name].notes)


# Life


class Life(RoverProcess):
    """Notes what is called, and when."""

    def setup(self, args: Any) -> None:
        self.called: list[tuple[float, str]] = []
        self.subscribe("tick")
        self.note("setup")
        if args.get("fails") == "setup":
            raise ValueError("no port")

    def note(self, what: str) -> None:
        self.called.append((round(self.get_time_s(), 3), what))

    def on_tick(self, data: Any) -> None:
        self.note(f"tick {data}")
        if data == "fail":
            raise ValueError("no wheel")

    def loop(self) -> float:
        self.note("loop")
        return 2.0

    def cleanup(self) -> None:
        self.note("cleanup")


def test_life_is_setup_then_messages_and_loop_then_cleanup() -> None:
    runner = simulate(Life, script("Other", {1.0: publish(("tick", 1)), 3.0: publish(("tick", 2))}), until_s=3.5)
    assert process(runner, "Life").called == [
        (0.0, "setup"),
        (0.0, "loop"),
        (1.0, "tick 1"),
        (2.0, "loop"),
        (3.0, "tick 2"),
        (3.5, "cleanup"),
    ]


def test_exception_in_handler_cleans_up_once_and_names_the_line() -> None:
    runner = ProcessRunner([Life, script("Other", {1.0: publish(("tick", "fail"))})])
    with pytest.raises(ComponentFailedError, match=r"(?s)test_rover_process.py, line \d+: raise.*ValueError: no wheel"):
        runner.simulate(10.0)
    assert [what for _, what in process(runner, "Life").called].count("cleanup") == 1
    assert process(runner, "Other").called == ["setup", "cleanup"]


def test_exception_in_setup_cleans_up() -> None:
    runner = ProcessRunner([Life.with_args(fails="setup")])
    with pytest.raises(ComponentFailedError, match="no port"):
        runner.simulate(10.0)
    assert process(runner, "Life").called == [(0.0, "setup"), (0.0, "cleanup")]


class EndsItself(Script):
    """Ends as a process of the seed does: cleans up itself, then leaves."""

    def on_quit(self, data: Any) -> None:
        super().on_quit(data)
        self.cleanup()
        raise SystemExit


def test_terminate_state_ends_all_and_cleanup_is_called_once() -> None:
    runner = simulate(
        EndsItself.with_args(name="A"), script("B", {2.0: lambda it: it.terminate_state()}), until_s=1000.0
    )
    for name in ("A", "B"):
        assert process(runner, name).called == ["setup", "on_quit", "cleanup"]
    assert runner.nodes["A"].clock.now_s() < 3.0
    assert runner.nodes["state_manager"].exit_reason == "quit"


class Generator(RoverProcess):
    """A loop with a `finally`."""

    def loop(self) -> Iterator[float]:
        try:
            while True:
                self.publish("alive", round(self.get_time_s(), 6))
                yield 4.0
        finally:
            self.left = self.get_time_s()


def test_generator_waits_in_virtual_time_and_ends_early() -> None:
    runner = simulate(Generator, script("A", {5.0: lambda it: it.terminate_state()}, "alive"), until_s=1000.0)
    assert process(runner, "A").got == [("alive", 4.0)]  # the first was published before A was connected
    assert process(runner, "Generator").left == pytest.approx(5.0, abs=0.001)


class Eager(RoverProcess):
    """A loop that never waits: a function, or a generator without a yield that is reached."""

    def setup(self, args: Any) -> None:
        self.calls, self.args = 0, args

    def loop(self) -> Any:
        self.calls += 1
        return iter(()) if self.args.get("is_generator") else None


@pytest.mark.parametrize("is_generator", [False, True])
def test_loop_that_never_waits_is_called_a_thousand_times_a_second(is_generator: bool) -> None:
    runner = simulate(Eager.with_args(is_generator=is_generator), until_s=0.0995)
    assert process(runner, "Eager").calls == 100


@pytest.mark.parametrize(("waited", "verb"), [("soon", "yielded"), (-1.0, "yielded"), (float("nan"), "yielded")])
def test_wait_that_is_not_a_time_raises(waited: Any, verb: str) -> None:
    class Waits(RoverProcess):
        def loop(self) -> Any:
            yield waited

    with pytest.raises(ComponentFailedError, match=rf"loop\(\) of Waits {verb} .*not a time to wait"):
        simulate(Waits)


# Messages


def test_publisher_and_all_subscribers_receive_a_message() -> None:
    runner = simulate(script("A", {1.0: publish(("k", {"x": 1}))}, "k"), script("B", {}, "k"), script("C", {}, "k"))
    for name in ("A", "B", "C"):
        assert process(runner, name).got == [("k", {"x": 1})]


def test_messages_of_a_publisher_keep_their_order_and_equal_ones_are_not_merged() -> None:
    numbers = [("k", i // 2) for i in range(200)]
    runner = simulate(script("A", {1.0: publish(*numbers)}), script("B", {}, "k"))
    assert process(runner, "B").got == numbers


def test_unsubscribe_ends_all_messages_before_it_returns() -> None:
    every = {0.5 + 0.0001 * i: publish(("k", i)) for i in range(40)}
    ends: dict[str, int] = {}

    def leave(it: Any) -> None:
        it.unsubscribe("k")
        ends["got"] = len(it.got)

    runner = simulate(script("A", every), script("B", {0.502: leave}, "k"))
    assert 0 < ends["got"] == len(process(runner, "B").got) < 40


def test_on_key_is_called_instead_of_message_trigger() -> None:
    class Picks(Script):
        def on_stick(self, data: Any) -> None:
            self.got.append(("on_stick", data))

    runner = simulate(
        Picks.with_args(keys=["stick", "other"]), script("A", {1.0: publish(("stick", [0, 1]), ("other", 2))})
    )
    assert process(runner, "Picks").got == [("on_stick", [0, 1]), ("other", 2)]


def test_subscribing_with_last_brings_the_last_value_to_each_reader() -> None:
    def ask(it: Any) -> None:
        it.subscribe("k", with_last=True)

    runner = simulate(
        script("A", {1.0: publish(("k", 1), ("k", 2)), 3.0: ask}), script("B", {2.0: ask}), script("C", {2.5: ask})
    )
    for name in ("A", "B", "C"):
        assert process(runner, name).got == [("k", 2)]


def test_subscriptions_survive_a_cut_of_the_link() -> None:
    runner = simulate(
        script("A", {1.0: publish(("k", 1)), 12.0: publish(("k", 2))}),
        script("B", {}, "k"),
        until_s=15.0,
        faults=LinkFaults(cut=((2.0, 8.0),)),
    )
    assert process(runner, "B").got == [("k", 1), ("k", 2)]


def test_broker_without_its_table_gets_all_lists_at_the_next_connection() -> None:
    def forget(runner: ProcessRunner) -> None:
        broker(runner).table.set_keys("B", [])

    runner = ProcessRunner(
        [script("A", {1.9: lambda it: forget(runner), 12.0: publish(("k", 2))}), script("B", {}, "k")],
        faults=LinkFaults(cut=((2.0, 8.0),)),
    )
    runner.simulate(15.0)
    assert process(runner, "B").got == [("k", 2)]


def test_a_full_queue_drops_the_oldest_and_counts_them() -> None:
    numbers = [("k", i) for i in range(100)]
    runner = simulate(
        script("A", {1.0: publish(*numbers)}, "k"),
        script("B", {}, "k"),
        queue_messages=10,
        faults=LinkFaults(bandwidth_bps=200_000),
    )
    got = [value for _, value in process(runner, "B").got]
    sent, passed = runner.nodes["A"].get_data(LINK_PAGE), runner.nodes["state_manager"].get_data(LINK_PAGE)
    dropped = sent["dropped"] + passed["peers"]["B_node"]["dropped"]
    assert got == sorted(got)
    assert got[-1] == 99
    assert len(got) + dropped == 100
    assert dropped > 50


def test_structs_are_sent_as_dicts() -> None:
    class Stick(msgspec.Struct):
        x: float
        trim: dict[str, float]

    runner = simulate(script("A", {1.0: publish(("k", [Stick(0.5, {"y": 1.0})]))}), script("B", {}, "k"))
    assert process(runner, "B").got == [("k", [{"x": 0.5, "trim": {"y": 1.0}}])]


# Broker


def test_broker_lists_subscribers_and_takes_changes() -> None:
    lists: list[str] = []

    def change(it: Any) -> None:
        lists.append(broker(runner).dump_subscribers())
        broker(runner).add_subscriber("k", "A")
        broker(runner).remove_subscriber("k", "B")
        lists.append(broker(runner).dump_subscribers())

    runner = ProcessRunner([script("A", {1.0: change}), script("B", {}, "k", "j")])
    runner.simulate(2.0)
    assert lists == ["k: B\nj: B", "k: A\nj: B"]


def test_messages_are_forwarded_in_the_bytes_that_they_came_in(monkeypatch: pytest.MonkeyPatch) -> None:
    encoded: list[Page] = []

    def encode(page: Page) -> bytes:
        encoded.append(page)
        return encode_page(page)

    monkeypatch.setattr(snr_sim.links.link, "encode_page", encode)
    numbers = [("k", i) for i in range(20)]
    runner = simulate(
        script("A", {1.0: publish(*numbers, ("unheard", 1))}), script("B", {2.0: publish(("k", 20))}, "k")
    )
    assert process(runner, "B").got == [*numbers, ("k", 20)]
    assert [page.data for page in encoded if page.key == "k"] == list(range(21))  # by their publishers
    assert link_of(runner)._arrived == {}


def test_message_in_another_order_of_fields_is_encoded_again() -> None:
    page = Page("k", {"process": False}, "A_node", 1.0, process=False)
    raw = b'{"$":"page","process":false,"key":"k","origin":"A_node","created_at_s":1.0,"data":{"process":false}}'

    def forward(it: Any) -> None:
        assert decode_page(raw) == page
        link_of(runner)._arrived[id(page)] = page, raw
        link_of(runner).forward(page, ["B_node"])

    runner = ProcessRunner([script("A", {1.0: forward}), script("B", {}, "k")])
    runner.simulate(2.0)
    assert process(runner, "B").got == [("k", {"process": False})]


def test_silent_process_is_reported_once_and_can_extend_its_time() -> None:
    runner = simulate(
        script("Silent", {1.0: lambda it: None}),
        script("Patient", {1.0: lambda it: it.watchdog_extend(60.0)}),
        script("Restored", {1.0: lambda it: it.watchdog_extend(60.0), 2.0: lambda it: it.watchdog_extend("PREVIOUS")}),
        script("Active", {float(i): lambda it: it.watchdog_pet() for i in range(1, 30)}),
        until_s=25.0,
    )
    found = re.findall(r"t = ([\d.]+) s: (\w+) has not reported for 5 s", notes(runner, "state_manager"))
    assert [name for _, name in found] == ["Silent", "Restored"]
    assert [6.0 <= float(time_s) <= 8.1 for time_s, _ in found] == [True, True]


def test_extended_time_survives_a_new_connection_with_the_one_before() -> None:
    acts = {0.5: 20.0, 1.0: 30.0, 12.0: "PREVIOUS"}
    extends = {time_s: lambda it, to=to: it.watchdog_extend(to) for time_s, to in acts.items()}
    runner = simulate(script("A", extends), faults=LinkFaults(cut=((2.0, 8.0),)), until_s=14.0)
    assert broker(runner).watch.deadlines["A"].timeout_s == 20.0


def test_health_of_all_arrives_twice_a_second_in_lock_step() -> None:
    runner = simulate(script("A", {}, "health"), script("B", {3.0: lambda it: it.watchdog_pet()}))
    pages = [msgspec.convert(data, Health) for _, data in process(runner, "A").got]
    assert 19 <= len(pages) <= 22
    last = pages[-1]
    assert [(part.name, part.state) for part in last.tree] == [
        (name, "running") for name in ("root", "state_manager", "A", "B")
    ]
    ages_s = [part.pet_age_s for part in last.tree[1:]]
    assert ages_s == [0.0, pytest.approx(9.5, abs=0.5), pytest.approx(6.5, abs=0.5)]
    assert last.supervisor_pid is None


def test_plan_without_a_process_is_rejected_with_its_name() -> None:
    with pytest.raises(
        ConfigError, match=r"(?s)do not have the same names: B, state_manager\..*Child\('state_manager'"
    ):
        ProcessRunner([script("A"), script("B")], plan=Supervisor("root", [Child("A")]))


def test_watchdog_reset_begins_the_silence_of_all_again() -> None:
    runner = simulate(
        script("Silent", {}), script("Resets", {float(i): lambda it: it.watchdog_reset() for i in range(0, 20, 3)})
    )
    assert "has not reported" not in notes(runner, "state_manager")


# Recording


def test_same_seed_gives_the_same_digest_and_a_replay_is_identical(tmp_path: Path) -> None:
    def noise(it: Any) -> None:
        it.publish("k", float(it.rng.random()))
        it.log("drawn")

    runner = ProcessRunner([script("A", {0.5: noise, 1.0: noise}, "back"), Echo], seed=3)
    folders = [runner.simulate(3.0, tmp_path) for _ in range(2)]
    traces = [read_trace(folder / FILE_NAME) for folder in folders if folder is not None]
    assert traces[0].digest == traces[1].digest
    assert len(process(runner, "A").got) == 2
    for role in traces[0].header.roles:
        replayed = replay_node(traces[0], role, runner.config())
        assert (replayed.divergences, replayed.executed > 5) == ([], True), role


class Echo(RoverProcess):
    """Answers, at most once."""

    def setup(self, args: Any) -> None:
        self.subscribe("k")

    def on_k(self, data: Any) -> None:
        self.publish("back", data)


def test_log_writes_one_line_to_stderr_and_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def log(it: Any) -> None:
        it.log({"a": 1}, "DEBUG")
        it.log("two\nlines", "CRITICAL")

    folder = ProcessRunner([script("A", {1.0: log})]).simulate(2.0, tmp_path)
    assert folder is not None
    expected = ["A                   : DEBUG    {'a': 1}", "A                   : CRITICAL two lines"]
    assert (folder / "A" / "log.txt").read_text().splitlines() == expected
    assert [line for line in capsys.readouterr().err.splitlines() if line.startswith("A  ")] == expected


# Mistakes


def test_own_init_is_rejected() -> None:
    with pytest.raises(ConfigError, match=r"(?s)Drive has its own __init__\..*Try: put what it does into setup"):

        class Drive(RoverProcess):
            def __init__(self) -> None: ...


@pytest.mark.parametrize(
    ("key", "fix"),
    [
        ("subscribe", "self.subscribe('v')"),
        ("unsubscribe", "self.unsubscribe('v')"),
        ("quit", "self.terminate_state()"),
        ("wd_pet", "self.watchdog_pet()"),
        ("wd_extend", "self.watchdog_extend('v')"),
        ("wd_reset", "self.watchdog_reset()"),
        ("wd_other", "another name: 'my_wd_other'"),
        ("health", "another name: 'my_health'. The supervisor's page has this one"),
        ("$speed", "a key without the $: 'speed'"),
    ],
)
def test_key_of_the_broker_is_rejected_with_the_method_to_use(key: str, fix: str) -> None:
    with pytest.raises(ComponentFailedError) as raised:
        simulate(script("A", {1.0: publish((key, "v"))}))
    assert f"A publishes {key!r}, which the state manager keeps for itself." in str(raised.value)
    assert f"Try: {fix}." in str(raised.value)


def test_subscription_to_quit_is_rejected_as_needless() -> None:
    with pytest.raises(ComponentFailedError, match=r"(?s)A subscribes to 'quit', which.*Try: leave it out: on_quit"):
        simulate(script("A", {}, "quit"))


@pytest.mark.parametrize("key", ["", "k" * 65, "a\nb", 7])
def test_key_that_is_not_a_short_text_raises(key: Any) -> None:
    with pytest.raises(ComponentFailedError, match="which is not a key"):
        simulate(script("A", {1.0: publish((key, 1))}))


class Motor:
    """No data."""


@pytest.mark.parametrize(("value", "found"), [(Motor(), "<Motor object>"), (2**70, "64 bits")])
def test_value_that_cannot_be_sent_names_the_line(value: Any, found: str) -> None:
    with pytest.raises(ComponentFailedError) as raised:
        simulate(script("A", {1.0: lambda it: it.publish("wheelLF", value)}))
    text = str(raised.value)
    assert re.search(r"test_rover_process.py, line \d+: simulate\(script\(.*publish\(\"wheelLF\", value\)", text)
    assert "A published 'wheelLF' with a value that cannot be sent to another process" in text
    assert found in text


def test_unknown_log_level_names_the_six() -> None:
    with pytest.raises(ComponentFailedError, match=r"(?s)at the level 'INFOO'.*did you mean 'INFO'.*NOTSET"):
        simulate(script("A", {1.0: lambda it: it.log("x", "INFOO")}))


def test_unheard_key_is_noted_with_the_nearest_subscribed_one() -> None:
    runner = simulate(script("Drive", {1.0: publish(*[("whelLF", 1)] * 12)}), script("UsbServer", {}, "wheelLF"))
    text = notes(runner, "state_manager")
    assert "No process subscribed to 'whelLF', which Drive published 12 times; did you mean 'wheelLF'?" in text
    assert "(UsbServer subscribes to it.)" in text
    assert "UsbServer subscribed to 'wheelLF', never published; did you mean 'whelLF'?" in text


def test_handler_of_a_key_without_subscription_is_noted() -> None:
    class Typo(RoverProcess):
        def setup(self, args: Any) -> None:
            self.subscribe("joystick1")

        def on_joystik1(self, data: Any) -> None: ...

    text = notes(simulate(Typo, until_s=1.0), "Typo")
    assert "Typo has on_joystik1, but never subscribed to 'joystik1'; did you mean 'joystick1'?" in text
    assert "Typo subscribed to 'joystick1', but has no on_joystick1; did you mean 'joystik1'?" in text


def test_unsubscribing_from_another_key_is_rejected() -> None:
    with pytest.raises(ComponentFailedError, match="A is not subscribed to 'j'"):
        simulate(script("A", {1.0: lambda it: it.unsubscribe("j")}, "k"))


def test_two_processes_of_one_name_are_rejected() -> None:
    with pytest.raises(ConfigError, match=r"Two processes are named Script.*\n.*with_args\(name='Script2'\)"):
        ProcessRunner([Script, Script.with_args()])


@pytest.mark.parametrize("bad", ["state_manager", "a b", "", "../x"])
def test_name_that_is_not_a_word_raises_config_error(bad: str) -> None:
    with pytest.raises(ConfigError, match="cannot be named"):
        ProcessRunner([script(bad or "1")])


def test_non_process_raises_config_error() -> None:
    with pytest.raises(ConfigError, match="is not a RoverProcess"):
        ProcessRunner([SimClock])  # type: ignore[list-item]


# Enabled modules


def write_module(folder: Path, name: str, text: str) -> None:
    (folder / f"{name}.py").write_text(f"from snr_sim.processes.rover_process import RoverProcess\n{text}\n")


def test_modules_are_enabled_by_name_and_import_their_siblings(tmp_path: Path) -> None:
    (tmp_path / "gains_of_drive.py").write_text("GAIN = 2\n")
    drive = "def setup(self, args):\n        from gains_of_drive import GAIN\n        self.gain = GAIN"
    write_module(tmp_path, "DriveOne", f"class DriveOne(RoverProcess):\n    {drive}")
    runner = ProcessRunner(["DriveOne"], folder=tmp_path)
    runner.simulate(1.0)
    assert process(runner, "DriveOne").gain == 2


def test_enabled_module_that_is_wrong_is_named(tmp_path: Path) -> None:
    write_module(tmp_path, "DriveTwo", "class Drive2(RoverProcess): ...")
    write_module(tmp_path, "DriveThree", "1 / 0")
    with pytest.raises(ConfigError, match=r"(?s)There is no module DriveTow.*did you mean 'DriveTwo'"):
        ProcessRunner(["DriveTow"], folder=tmp_path)
    with pytest.raises(ConfigError, match=r"(?s)no class named DriveTwo.*did you mean 'Drive2'"):
        ProcessRunner(["DriveTwo"], folder=tmp_path)
    with pytest.raises(ConfigError, match=r"(?s)DriveThree.py, line 2: 1 / 0.*ZeroDivisionError"):
        ProcessRunner(["DriveThree"], folder=tmp_path)


# Names of the seed


class OldNames(Script):
    """Written for the seed."""

    def messageTrigger(self, message: Any) -> None:  # noqa: N802
        self.got.append(("old", message.key))


def test_names_of_the_seed_work_where_they_are_called_and_overridden() -> None:
    def old(it: Any) -> None:
        it.watchdogExtend(60.0)
        it.publish("k", 1)

    runner = simulate(OldNames.with_args(at={1.0: old}, keys=["k"]), until_s=20.0)
    assert process(runner, "OldNames").got == [("old", "k")]
    assert "has not reported" not in notes(runner, "state_manager")
    assert broker(runner).dumpSubscribers() == "k: OldNames"  # type: ignore[attr-defined]
    with pytest.raises(AttributeError, match="'OldNames' object has no attribute 'watchdogPat'"):
        process(runner, "OldNames").watchdogPat()


class OneThread(RoverProcess):
    """Notes which thread calls its handlers and its loop, both with the lock."""

    def setup(self, args: Any) -> None:
        self.threads: list[tuple[str, int]] = []
        self.subscribe("k")

    def note(self, what: str) -> None:
        with self.lock, self.lock:  # it may be taken again by a method that is called with it
            self.threads.append((what, threading.get_ident()))

    def on_k(self, data: Any) -> None:
        self.note("handler")

    def loop(self) -> float:
        self.note("loop")
        self.publish("k", 1)
        return 1.0


def test_handlers_and_loop_have_one_thread_in_lock_step() -> None:
    calls = process(simulate(OneThread, until_s=0.5), "OneThread").threads
    assert calls == [("loop", threading.get_ident()), ("handler", threading.get_ident())]
