"""`snr health`: table and status of supervised processes."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from snr_sim.supervision.health import health_of, write_health
from tests.supervision.test_health_link import served
from tests.supervision.world import World, group

Snr = Callable[..., Any]
NO_PID = 2**22 + 1  # above the largest that Linux gives


@pytest.fixture
def world() -> World:
    """Two processes that run."""
    world = World(group("root", "drive", "gps"))
    world.pet("drive")
    world.pet("gps")
    return world


def test_health_prints_a_row_for_each_process_with_status_0_if_all_run(snr: Snr, here: Path, world: World) -> None:
    write_health(here, health_of(world.tree, {}, 0.0))
    answer = snr("health", here)
    assert (answer.status, answer.err) == (0, "")
    assert [line.split()[:2] for line in answer.out.splitlines()[2:]] == [
        ["root", "running"],
        ["drive", "running"],
        ["gps", "running"],
    ]


def test_health_has_status_1_if_a_process_does_not_run(snr: Snr, here: Path, world: World) -> None:
    world.end("gps", 1, "no port")
    write_health(here, health_of(world.tree, {}, 0.0))
    answer = snr("health", here, "--json")
    assert answer.status == 1
    assert answer.json["is_degraded"]
    assert answer.json["is_supervised"]
    assert answer.json["tree"][2]["why"] == "no port"


def test_health_of_a_supervisor_that_has_gone_says_so_with_status_1(snr: Snr, here: Path, world: World) -> None:
    write_health(here, msgspec.structs.replace(health_of(world.tree, {}, 0.0), supervisor_pid=NO_PID))
    answer = snr("health", here)
    assert answer.status == 1
    assert f"the supervisor, process {NO_PID}, does not run any more" in answer.err


@pytest.mark.slow
def test_health_of_a_robot_at_a_port_is_its_page_and_status_2_once_it_has_gone(snr: Snr, world: World) -> None:
    with served(msgspec.to_builtins(health_of(world.tree, {}, 0.0))) as (host, port):
        answer = snr("health", f"{host}:{port}", "--json", "--wait", 60)
        assert (answer.status, answer.err, answer.json["is_supervised"]) == (0, "", True)
        assert [part["name"] for part in answer.json["tree"]] == ["root", "drive", "gps"]
    answer = snr("health", port, "--wait", 0.3)
    assert (answer.status, f"No health has arrived from 127.0.0.1:{port} within 0.3 s" in answer.err) == (2, True)


@pytest.mark.parametrize("port", ["0", "70000"])
def test_health_of_a_port_out_of_range_is_status_2(snr: Snr, here: Path, port: str) -> None:
    answer = snr("health", port)
    assert (answer.status, f"'{port}' is not an address." in answer.err) == (2, True)


def test_health_of_a_folder_without_the_file_is_status_2(snr: Snr, here: Path) -> None:
    answer = snr("health", here)
    assert answer.status == 2
    assert "There is no" in answer.err
    assert "name a run folder of snr processes, or HOST:PORT." in answer.err


@pytest.mark.parametrize("changed", [{"supervisor_pid": 1 << 40}, {"supervisor_pid": 0}, {"tree": []}])
def test_health_that_no_supervisor_wrote_is_status_2(
    snr: Snr, here: Path, world: World, changed: dict[str, Any]
) -> None:
    page = msgspec.to_builtins(health_of(world.tree, {}, 0.0)) | changed
    (here / "health.json").write_bytes(msgspec.json.encode(page))
    answer = snr("health", here)
    assert (answer.status, "health.json cannot be read: " in answer.err) == (2, True), answer.err


def test_health_of_a_file_or_with_no_time_to_wait_is_status_2(snr: Snr, here: Path, world: World) -> None:
    write_health(here, health_of(world.tree, {}, 0.0))
    answer = snr("health", here / "health.json")
    assert (answer.status, "health.json is not a folder." in answer.err) == (2, True), answer.err
    answer = snr("health", "9131", "--wait", "-1")
    assert (answer.status, "--wait is -1." in answer.err) == (2, True), answer.err


def test_health_of_processes_that_have_ended_says_that_they_have(snr: Snr, here: Path, world: World) -> None:
    health = health_of(world.tree, {}, 0.0)
    tree = [msgspec.structs.replace(part, state="ended") for part in health.tree]
    write_health(here, msgspec.structs.replace(health, tree=tree))
    answer = snr("health", here)
    assert (answer.status, answer.out.splitlines()[0]) == (1, "all have ended")
