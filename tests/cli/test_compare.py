"""`snr compare`: two real runs side by side, and the messages for runs that cannot be compared."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

RADAR_DELAY_S = 0.2  # as robots/lander/parameters.py says
Snr = Callable[..., Any]


def run_once(snr: Snr, *words: str) -> str:
    return str(snr("run", "lander_vertical", "--no-rrd", "--json", *words).json["run_dir"])


def test_commands_differ_from_first_burn(snr: Snr, here: Path) -> None:
    optimal, coast = run_once(snr), run_once(snr, "--controller", "coast")
    answer = snr("compare", optimal, coast, "--png", "both.png", "--rrd", "both.rrd", "--json")
    assert answer.status == 0
    fields = answer.json
    assert fields["labels"] == ["optimal", "coast"]
    assert not fields["identical"]
    engine = fields["signals"]["engine.throttle"]
    burns_s = next(
        record["t"]
        for record in map(
            json.loads, snr("trace", optimal, "--kind", "page", "--name", "engine", "--json").out.splitlines()
        )
        if record["values"][0]["data"]["throttle"] > 0.0
    )
    assert fields["commands_first_differ_s"] == engine["first_differs_s"] == pytest.approx(burns_s)
    assert engine["second"]["highest"] == 0.0  # coast burns nothing
    assert -1.0 <= engine["largest_difference"] < -0.9
    assert fields["signals"]["radar.altitude_m"]["first"]["age_s"] == pytest.approx(RADAR_DELAY_S)
    assert all((here / name).stat().st_size > 1000 for name in ("both.png", "both.rrd"))


def test_table_is_printed_without_json(snr: Snr) -> None:
    optimal, coast = run_once(snr), run_once(snr, "--controller", "coast")
    answer = snr("compare", optimal, coast)
    assert "optimal | coast" in answer.out
    assert "later [ms]" in answer.out
    assert "altitude_m" in answer.out
    assert "The commands first differ at t = " in answer.out
    assert "byte for byte" in snr("compare", optimal, optimal).out


def test_truncated_trace_is_compared_up_to_its_end_with_a_note(snr: Snr) -> None:
    run = Path(run_once(snr))
    cut = run.parent / "cut"
    cut.mkdir()
    raw = (run / "trace.jsonl").read_bytes()
    (cut / "trace.jsonl").write_bytes(raw[: len(raw) // 2])
    answer = snr("compare", run, cut, "--json")
    assert answer.status == 0
    assert "cut short" in answer.err
    assert answer.json["signals"]["radar.altitude_m"]["rms_difference"] == 0.0


def test_invalid_comparison_reports_cause(snr: Snr, here: Path) -> None:
    run = run_once(snr)
    (here / "empty").mkdir()
    (here / "early").mkdir()
    (here / "early" / "trace.jsonl").write_bytes(b'{"kind":"trace"')
    for words, expected in (
        (("nowhere", run), "There is no run at nowhere"),
        ((run, "empty"), "There is no run at empty"),
        ((run, "early"), "has no whole line"),
        ((run, run, "--node", "urov"), "no node 'urov'"),
        ((run, run, "--shift", "soon"), "--shift must be a number of seconds or 'auto', not 'soon'"),
        ((run, run, "--shift", "1e9"), "no time in common"),
        ((run, run, "--signal", "radar.altitud_m", "--png", "x.png"), "did you mean 'radar.altitude_m'"),
        ((run, run, "--png", "nowhere/x.png"), "cannot be written"),
    ):
        answer = snr("compare", *words)
        assert answer.status == 2, words
        assert expected in answer.err
    assert not (here / "x.png").exists()
