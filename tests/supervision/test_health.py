"""The page `health`: what it has of a tree, its file, and its table."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from snr_sim.prelude.errors import RecordingError
from snr_sim.supervision.health import (
    FILE_NAME,
    HealthReports,
    Usage,
    health_of,
    health_table,
    read_health,
    write_health,
)
from tests.supervision.world import World, group


def rover() -> tuple[World, dict[str, Usage]]:
    """Drive works; gps has failed, and waits for its restart."""
    world = World(group("root", group("parts", "drive", "gps"), restarts=1))
    usages = {"drive": Usage(pid=120), "gps": Usage(pid=121, last_lines=["no fix", "/dev/ttyUSB0 is gone"])}
    world.pet("drive")
    usages["drive"].beat(0.0, 0.5, 31.4, 0)
    world.run(1)
    world.pet("drive")
    usages["drive"].beat(world.now_s, 0.75, 32.4, 2)
    world.end("gps", 1, "DeviceError: /dev/ttyUSB0\nis gone")
    world.now_s += 0.5
    return world, usages


def test_page_has_each_part_with_what_is_known_of_it() -> None:
    world, usages = rover()
    health = health_of(world.tree, usages, world.now_s)
    root, parts, drive, gps = health.tree
    assert [part.path for part in health.tree] == ["root", "root/parts", "root/parts/drive", "root/parts/gps"]
    assert [part.state for part in health.tree] == ["degraded", "degraded", "running", "restarting"]
    assert (drive.pid, drive.pet_age_s, drive.timeout_s, drive.waiting) == (120, 0.5, 3.0, 2)
    assert (drive.cpu_share, drive.rss_mb) == (0.25, 32.4)
    assert (gps.why, gps.restarts, gps.pet_age_s) == ("DeviceError: /dev/ttyUSB0\nis gone", 0, None)
    assert gps.last_lines == ["no fix", "/dev/ttyUSB0 is gone"]
    assert (root.pid, parts.cpu_share) == (None, None)
    assert (health.is_degraded, health.is_safe_stop, health.budget_left) == (True, False, 1)


def test_page_of_a_safe_stop_says_why() -> None:
    world = World(group("root", group("parts", "drive", "gps", restarts=0), restarts=0))
    world.end("gps", 1, "gone")
    world.answer()
    health = health_of(world.tree, {}, world.now_s)
    assert (health.is_safe_stop, health.is_degraded, health.budget_left) == (True, True, 0)
    assert health.why == world.tree.safe_stop
    assert health_table(health).startswith("safe stop: parts failed once (0 restarts are allowed in 10 s), last: gps")


def test_working_tree_is_not_degraded() -> None:
    world = World(group("root", "drive"))
    assert health_of(world.tree, {}, 0.0).is_degraded
    world.pet("drive")
    assert not health_of(world.tree, {}, 0.0).is_degraded


def test_report_is_due_at_each_change_and_every_half_second() -> None:
    world = World(group("root", "drive", "gps"))
    reports = HealthReports(world.tree)
    assert reports.take(0.0) is not None
    assert reports.changed == {"root", "root/drive", "root/gps"}
    assert reports.take(0.4) is None
    world.pet("drive")
    assert reports.take(0.4) is not None
    assert reports.changed == {"root/drive"}
    assert [reports.take(now_s) is not None for now_s in (0.8, 0.9, 1.3, 1.4)] == [False, True, False, True]
    assert reports.changed == set()


def test_file_is_the_page_and_valid(tmp_path: Path, validator: Callable[[str], Callable[[object], bool]]) -> None:
    world, usages = rover()
    health = health_of(world.tree, usages, world.now_s)
    write_health(tmp_path, health)
    assert validator("health")(json.loads((tmp_path / FILE_NAME).read_bytes()))
    assert read_health(tmp_path) == health
    with pytest.raises(OSError, match="No such file"):
        write_health(tmp_path / "gone", health)


def test_file_that_is_missing_or_no_page_raises_recording_error(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"There is no .*health\.json"):
        read_health(tmp_path)
    (tmp_path / FILE_NAME).write_text('{"tree": []}')
    with pytest.raises(RecordingError, match=r"health\.json cannot be read: .*supervisor_pid"):
        read_health(tmp_path)


def test_table_has_a_row_for_each_part_with_failures_on_one_line() -> None:
    world, usages = rover()
    assert health_table(health_of(world.tree, usages, world.now_s)).splitlines() == [
        "degraded; failures until a safe stop: 2",
        "part       state       restarts  pid  silent      CPU  memory  waiting  last failure",
        "root       degraded    0         -    -           -    -       -",
        "  parts    degraded    0         -    -           -    -       -",
        "    drive  running     0         120  0.5 of 3 s  25%  32 MB   2",
        "    gps    restarting  0         121  -           -    -       -        DeviceError: /dev/ttyUSB0 is gone",
    ]
