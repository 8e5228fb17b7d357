"""The runners of a config, and their errors when it cannot be started."""

import sys
from typing import Any

import pytest

from snr_sim import (
    CliRunner,
    Config,
    Endpoint,
    EndpointFactory,
    MemoryLink,
    Mode,
    Node,
    SimClock,
    SimRunner,
    SynchronousRunner,
    TaskType,
    TestRunner,
    TimeoutLoopFactory,
    tasks,
)
from snr_sim.prelude.errors import ComponentFailedError, ConfigError, UnknownNameError
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory


def quits(name: str = "quitter") -> FunctionEndpointFactory:
    return FunctionEndpointFactory(name=name, begin=lambda part: part.schedule(tasks.terminate("done")))


ROLES = {"topside": [quits()], "robot": [quits()]}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "Which role? None was given."),
        (["robt"], "There is no role 'robt'.\n  Try: did you mean 'robot'?"),
        (["robot", "topside"], "One role at a time, not 2: robot topside."),
        (["-d"], "Which role? None was given."),
        (["--wach", "robot"], "There is no option --wach.\n  Try: did you mean '--watch'?"),
    ],
)
def test_without_a_known_role_the_command_line_lists_the_roles_and_exits_with_2(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        CliRunner(ROLES, ["robot.py", *words]).run()
    assert caught.value.code == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err
    assert "usage: robot.py [-d] [--watch] ROLE" in err
    assert "roles: topside, robot" in err


@pytest.mark.parametrize("words", [["--help"], ["-h"], ["robot", "--help"]])
def test_help_of_a_program_shows_options_and_roles_and_runs_nothing(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        CliRunner(ROLES, ["robot.py", *words]).run()
    assert caught.value.code == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert out.startswith("usage: robot.py [-d] [--watch] ROLE\n  -d       DEBUG mode")
    assert "  --watch  reloads a component when its file is saved" in out
    assert out.endswith("roles: topside, robot\n")


@pytest.mark.parametrize("components", [ROLES, Config(factories=ROLES)])
def test_the_command_line_runs_the_role_it_names(components: Any, capsys: pytest.CaptureFixture[str]) -> None:
    CliRunner(components, ["robot.py", "robot"]).run()
    assert capsys.readouterr().err == ""


def test_the_command_line_is_that_of_the_program_if_none_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["robot.py"])
    with pytest.raises(SystemExit):
        CliRunner(ROLES).run()


def talks(part: Any) -> None:
    part.log.warning("battery low")
    part.log.debug("cell 3 at 3.1 V")


def test_with_d_the_command_line_shows_all_that_is_logged_and_the_profile(capsys: pytest.CaptureFixture[str]) -> None:
    go = tasks.event("x")
    handler = FunctionEndpointFactory(
        {go.id(): lambda task, task_id: None}, "worker", begin=lambda part: part.schedule(go)
    )
    CliRunner(
        {"robot": [FunctionEndpointFactory(name="power", begin=talks), handler, quits()]}, ["robot.py", "-d", "robot"]
    ).run()
    err = capsys.readouterr().err
    assert "WARNING snr.robot_node.power: battery low" in err
    assert "DEBUG snr.robot_node.power: cell 3 at 3.1 V" in err
    assert "worker.<lambda>" in err


def test_wrong_log_call_is_reported_and_does_not_end_run(
    capsys: pytest.CaptureFixture[str],
) -> None:
    worker = FunctionEndpointFactory(name="worker", begin=lambda part: part.log.warning("%d percent", "no number"))
    CliRunner({"robot": [worker, quits()]}, ["robot.py", "-d", "robot"]).run()
    err = capsys.readouterr().err
    assert "TypeError: %d format: a real number is required, not str" in err
    assert 'name="worker", begin=lambda part' in err


def test_debug_on_the_command_line_leaves_the_config_as_it_was() -> None:
    config = Config(factories=ROLES)
    CliRunner(config, ["robot.py", "-d", "robot"]).run()
    assert config.mode is Mode.DEPLOYED


def test_run_diagnostics_are_printed_after_run(capsys: pytest.CaptureFixture[str]) -> None:
    sender = FunctionEndpointFactory(begin=lambda part: part.schedule(tasks.event("landed")))
    SynchronousRunner("r", Config(factories={"r": [sender, quits()]})).run()
    assert capsys.readouterr().err == "note: No component handled event 'landed'; handlers wait for: none.\n"


def test_a_test_runner_runs_the_role_test_in_virtual_time() -> None:
    runner = TestRunner(Config(factories={"test": [TimeoutLoopFactory(seconds=1000)]}))
    runner.run()
    assert runner.node.exit_reason == "timeout"
    assert runner.clock.now_s() == 1000.0
    with pytest.raises(UnknownNameError, match="no role 'test'"):
        TestRunner(Config(factories={"robot": []}))


def sensor(loop: Any) -> None:
    loop.store_data("depth", loop.get_time_s())


def echo_of(key: str, into: list[tuple[float, Any]]) -> FunctionEndpointFactory:
    class Listening(FunctionEndpointFactory):
        def get(self, parent: Node) -> Any:
            part = super().get(parent)
            part.task_handlers = {
                (TaskType.process_data, key): lambda task, task_id: into.append((part.get_time_s(), part.get_data(key)))
            }
            return part

    return Listening(name="listener")


def test_two_roles_exchange_pages_over_a_link_and_both_end() -> None:
    received: list[tuple[float, Any]] = []
    config = Config(
        factories={
            "robot": [FunctionLoopFactory(sensor, rate_hz=10), TimeoutLoopFactory(seconds=0.45)],
            "topside": [echo_of("depth", received), TimeoutLoopFactory(seconds=1.0)],
        }
    )
    runner = SimRunner(config, links=[MemoryLink(["depth"], "robot", "topside", latency_s=0.25)])
    runner.run()
    assert [sent_s for _, sent_s in received] == [0.0, 0.1, 0.2, 0.3, 0.4]
    assert all(abs(came_s - sent_s - 0.25) < 1e-12 for came_s, sent_s in received)
    assert {role: node.exit_reason for role, node in runner.nodes.items()} == {"robot": "timeout", "topside": "timeout"}


def test_a_run_of_several_roles_is_the_same_each_time() -> None:
    def run() -> list[tuple[float, Any]]:
        received: list[tuple[float, Any]] = []
        noisy = FunctionLoopFactory(lambda loop: loop.store_data("depth", loop.rng.random()), rate_hz=50)
        config = Config(factories={"robot": [noisy], "topside": [echo_of("depth", received)]})
        link = MemoryLink(["depth"], "robot", "topside", 0.01, jitter_s=0.02, loss=0.3)
        SimRunner(config, links=[link], seed=5, until_s=2.0).run()
        return received

    first = run()
    assert first == run()
    assert 40 < len(first) < 90


def test_a_role_named_twice_or_unknown_is_refused() -> None:
    config = Config(factories=ROLES)
    with pytest.raises(ConfigError, match="named twice: robot, robot"):
        SimRunner(config, ["robot", "robot"])
    with pytest.raises(UnknownNameError, match="did you mean 'robot'"):
        SimRunner(config, ["robt"])


def test_a_failure_in_one_role_leaves_the_runner_with_the_students_line() -> None:
    def fail(loop: Any) -> None:
        raise ValueError("no echo")

    with pytest.raises(ComponentFailedError, match=r'raise ValueError\("no echo"\)'):
        SimRunner(Config(factories={"a": [], "b": [FunctionLoopFactory(fail)]}), clock=SimClock()).run()


class _Unwilling(EndpointFactory):
    def get(self, parent: Node) -> Endpoint:
        raise ConfigError("The port is taken.", fix="another port.")


def test_command_line_prints_error_without_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        CliRunner({"robot": [_Unwilling()]}, ["robot.py", "robot"]).run()
    message = capsys.readouterr().err
    assert ended.value.code == 1
    assert "The port is taken.\n  Try: another port." in message
    assert "Traceback" not in message


def test_a_command_line_in_debug_mode_raises_the_error() -> None:
    with pytest.raises(ConfigError, match="The port is taken"):
        CliRunner({"robot": [_Unwilling()]}, ["robot.py", "-d", "robot"]).run()


def test_notes_of_simulation_are_printed_with_node_name(
    capsys: pytest.CaptureFixture[str],
) -> None:
    config = Config(
        factories={
            role: [FunctionEndpointFactory(begin=lambda part: part.parent.add_note("low tide"))] for role in "ab"
        }
    )
    SimRunner(config).run()
    assert capsys.readouterr().err == "note: a_node: low tide\nnote: b_node: low tide\n"
    SimRunner(config, log_notes=False).run()
    assert capsys.readouterr().err == ""
