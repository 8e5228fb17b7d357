"""Differences of two runs, compared with the known latency, noise, step and dead band of their signals."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from snr_sim.prelude.errors import TraceError, UnknownNameError
from snr_sim.prelude.task import Page
from snr_sim.recording.compare_runs import SignalComparison, compare_runs, labels_of, shift_by_commands_s
from snr_sim.recording.compare_signals import dead_band_of, noise_of, step_of
from snr_sim.recording.reader import Trace
from snr_sim.recording.records import HandlerCall, Header, PageRecord, Record, TraceInfo, TruthRecord
from snr_sim.view.compare_picture import draw_comparison, select_signals

Data = Callable[[float], dict[str, Any]]
RNG = np.random.default_rng


def header(**changes: Any) -> Header:
    fields: dict[str, Any] = {
        "version": "0.1.0", "python": "3.11", "platform": "here", "packages": {}, "scenario": "urov_depth_hold",
        "robot": "urov", "controller": "holds", "roles": ["urov"], "engine": "none", "io": "sim", "seed": 0,
        "options": {}, "nodes": ["urov_node"], "clock": "sim", "commands": {"urov_node": ["pwm"]}, "sources": {},
        "scene": {},
    }  # fmt: skip
    return Header(**(fields | changes))


def run(pages: dict[str, tuple[float, Data]], end_s: float = 20.0, node: str = "urov_node", **changes: Any) -> Trace:
    """A run in which each key's page comes at its rate, with what its function says of the time."""
    due = sorted((k / rate, key) for key, (rate, _) in pages.items() for k in range(round(end_s * rate)))
    records: list[Record] = []
    for seq, (t, key) in enumerate(due, start=1):
        values = msgspec.Raw(b"[" + Page(key, pages[key][1](t), node, t).serialize() + b"]")
        records.append(PageRecord(seq, t, node, "store_page", key, values, 1, 0, list[HandlerCall]()))
    digest = str(hash(tuple((record.t, bytes(getattr(record, "values", b""))) for record in records)))
    trace_info = TraceInfo.now("urov_depth_hold", "holds")
    return Trace(Path("runs/a/trace.jsonl"), trace_info, header(**changes), records, digest, is_truncated=False)


def dive_m(t: float) -> float:
    return 2.0 + math.sin(0.8 * t) + 0.3 * math.sin(2.3 * t)


def depth(late_s: float = 0.0, noise_m: float = 0.0, old_s: float = 0.0) -> Data:
    rng = RNG(7)
    return lambda t: {"depth_m": dive_m(t - late_s) + noise_m * rng.standard_normal(), "stamp_s": t - old_s}


def compared(
    one: Data, other: Data, rates_hz: tuple[float, float] = (20.0, 20.0), end_s: float = 20.0
) -> SignalComparison:
    first, second = (run({"depth": (rate, data)}, end_s) for rate, data in zip(rates_hz, (one, other), strict=True))
    comparison = compare_runs(first, second)
    (signal,) = comparison.signals
    return signal


@pytest.mark.parametrize("late_s", [0.012, 0.1, -0.25])
def test_delay_is_estimated_to_a_millisecond(late_s: float) -> None:
    signal = compared(depth(), depth(late_s=late_s), rates_hz=(50.0, 50.0))
    assert signal.delay_s == pytest.approx(late_s, abs=1e-3)


def test_delay_is_estimated_with_noise_and_other_rate() -> None:
    signal = compared(depth(noise_m=0.01), depth(late_s=0.15, noise_m=0.02), rates_hz=(20.0, 50.0))
    assert signal.delay_s == pytest.approx(0.15, abs=0.01)
    assert (signal.of_first.rate_hz, signal.of_second.rate_hz) == pytest.approx((20.0, 50.0))


def test_delay_of_pure_noise_returns_none() -> None:
    assert compared(depth(), depth(noise_m=0.05)).delay_s is None


@pytest.mark.parametrize("noise_m", [0.003, 0.05])
def test_noise_of_moving_vehicle_is_estimated(noise_m: float) -> None:
    signal = compared(depth(), depth(noise_m=noise_m), rates_hz=(50.0, 50.0), end_s=60.0)
    assert signal.of_second.noise == pytest.approx(noise_m, rel=0.08)
    assert signal.of_first.noise == pytest.approx(0.0, abs=1e-4)
    assert signal.rms == pytest.approx(noise_m, rel=0.08)


def test_noise_ignores_a_single_jump() -> None:
    values = 0.01 * RNG(3).standard_normal((1000, 1))
    values[500:] += 5.0
    assert noise_of(values) == pytest.approx(0.01, rel=0.1)


def test_age_equals_time_since_stamp() -> None:
    signal = compared(depth(old_s=0.004), depth(old_s=0.031))
    assert signal.of_first.age_s == pytest.approx(0.004)
    assert (signal.of_second.age_s, signal.of_second.age_p95_s) == pytest.approx((0.031, 0.031))


@pytest.mark.parametrize("step", [0.5, 4.8828125, 0.002])
def test_step_is_estimated_without_adjacent_values(step: float) -> None:
    levels = RNG(5).choice(np.arange(0, 4000, 7), 400) + RNG(6).integers(0, 3, 400)
    assert step_of((1100.0 + step * levels).reshape(-1, 1)) == pytest.approx(step, rel=1e-5)


def test_step_of_continuous_or_few_values_returns_none() -> None:
    assert step_of(RNG(5).standard_normal((500, 2))) is None
    assert step_of(np.array([[1.0], [2.0], [1.0]])) is None


def test_dead_band_is_estimated_only_if_skipped() -> None:
    asked = 60.0 * RNG(8).standard_normal((2000, 4))
    over = np.where(asked > 0.0, asked + 25.0, asked - 30.0)
    over[:50] = 0.0
    below, above = dead_band_of(over) or (0.0, 0.0)
    assert (below, above) == pytest.approx((-30.0, 25.0), abs=0.5)
    assert dead_band_of(asked) is None
    assert dead_band_of(np.abs(over)) is None  # of one side nothing is known


def pulses(differs_from_s: float = math.inf) -> Data:
    return lambda t: {"pulses_us": [1500.0 + 40.0 * math.sin(t), 1500.0 + (3.0 if t >= differs_from_s else 0.0)]}


def test_first_command_difference_reports_time_and_channel() -> None:
    comparison = compare_runs(run({"pwm": (50.0, pulses())}), run({"pwm": (50.0, pulses(differs_from_s=4.21))}))
    first = comparison.commands_differ
    assert first is not None
    assert first.first_differs_s == pytest.approx(4.22)
    assert (first.largest, first.largest_channel) == (pytest.approx(3.0), 1)
    assert first.rms == pytest.approx(3.0 * math.sqrt(0.789 / 2), rel=1e-3)  # of two channels one, for 15.78 of 20 s
    assert not comparison.is_identical


def test_compare_runs_of_same_run_returns_no_differences() -> None:
    trace = run({"pwm": (50.0, pulses()), "depth": (20.0, depth(noise_m=0.01))})
    comparison = compare_runs(trace, trace)
    assert comparison.is_identical
    assert comparison.commands_differ is None
    assert [(one.rms, one.delay_s) for one in comparison.signals] == [(0.0, None)] * 2


def test_angle_differences_are_wrapped() -> None:
    def yaw(off: float) -> Data:
        return lambda t: {"yaw_rad": math.remainder(0.5 * t + off, 2.0 * math.pi)}

    comparison = compare_runs(run({"imu": (50.0, yaw(0.0))}), run({"imu": (50.0, yaw(0.1))}))
    assert comparison.signals[0].rms == pytest.approx(0.1)


def test_shift_by_commands_aligns_runs_started_at_other_times() -> None:
    def armed(at_s: float) -> Data:
        return lambda t: {"pulses_us": [1500.0 if t < at_s else 1500.0 + 50.0 * math.sin(t - at_s + 0.1)]}

    early, late = run({"pwm": (50.0, armed(2.0))}), run({"pwm": (50.0, armed(5.5))})
    shift_s = shift_by_commands_s(early, late)
    assert shift_s == pytest.approx(3.5)
    assert compare_runs(early, late, shift_s=shift_s).signals[0].rms == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(TraceError, match="no command page ever changes"):
        shift_by_commands_s(early, run({"pwm": (50.0, armed(99.0))}))


def outputs(late_s: float, step_us: float, shown_hz: float) -> Trace:
    """Chattering pulses, and the outputs' reports of them: late and in steps."""
    rng = RNG(2)
    asked = 1500.0 + 30.0 * rng.choice([-1.0, 1.0], (1000, 4)) + rng.normal(0.0, 3.0, (1000, 4))
    asked[:100] = 1500.0

    def at(t: float) -> Any:
        return asked[max(0, math.floor(t * 50.0 + 1e-6))]

    def made(t: float) -> dict[str, Any]:
        pulses = at(t - late_s)
        return {"pulses_us": (np.round(pulses / step_us) * step_us if step_us else pulses).tolist(), "stamp_s": t}

    return run({"pwm": (50.0, lambda t: {"pulses_us": at(t).tolist()}), "pwm_applied": (shown_hz, made)})


@pytest.mark.parametrize("late_s", [0.0, 0.02, 0.06])
def test_command_delay_is_estimated_from_sparse_reports(late_s: float) -> None:
    comparison = compare_runs(outputs(0.0, 0.0, 2.0), outputs(late_s, 0.5, 2.0))
    applied = next(one for one in comparison.signals if one.first.key == "pwm_applied")
    assert applied.of_first.command_delay_s == pytest.approx(0.0, abs=1e-6)
    assert applied.of_second.command_delay_s == pytest.approx(late_s, abs=1e-6)
    assert applied.of_second.step == 0.5


def test_compare_runs_uses_only_requested_time_range() -> None:
    one, other = run({"pwm": (50.0, pulses())}), run({"pwm": (50.0, pulses(differs_from_s=4.0))})
    assert compare_runs(one, other, within_s=(0.0, 3.0)).commands_differ is None
    (signal,) = compare_runs(one, other, within_s=(10.0, 12.0)).signals
    assert (signal.first_differs_s, signal.of_first.count) == (pytest.approx(10.0), 101)


def test_truth_is_compared_if_both_runs_have_it() -> None:
    def dived(late_s: float) -> Trace:
        trace = run({"pwm": (50.0, pulses())})
        for k in range(400):
            seq, t = len(trace.records) + 1, 0.05 * k
            arrow = [0.0, 0.0, 0.0, 3.0 * math.sin(t - late_s), 4.0 * math.sin(t - late_s), 0.0]
            trace.records.append(TruthRecord(seq, t, {}, {"T1": arrow}, {"depth_m": dive_m(t - late_s)}))
        return trace

    comparison = compare_runs(dived(0.0), dived(0.07))
    true = {one.name: one for one in comparison.signals if one.first.key == "truth"}
    assert true["truth.depth_m"].delay_s == pytest.approx(0.07, abs=2e-3)
    assert true["truth.T1_n"].of_first.highest == pytest.approx(5.0, rel=1e-3)
    assert [one.first.key for one in select_signals(comparison)] == ["pwm"]


def test_signal_of_one_run_only_is_listed() -> None:
    more = run({"depth": (20.0, depth()), "leak": (2.0, lambda t: {"is_wet": False})})
    assert compare_runs(run({"depth": (20.0, depth())}), more).only_second == ["leak.is_wet"]


def test_incomparable_runs_raise_with_reason() -> None:
    one = run({"depth": (20.0, depth())})
    with pytest.raises(TraceError, match="different robots: a is of 'urov', a of 'lander'"):
        compare_runs(one, run({"depth": (20.0, depth())}, robot="lander"))
    with pytest.raises(TraceError, match="no page with numbers in both"):
        compare_runs(one, run({"altitude": (20.0, depth())}))
    with pytest.raises(TraceError, match="no node in common"):
        compare_runs(one, run({"depth": (20.0, depth())}, nodes=["topside_node"]))
    with pytest.raises(UnknownNameError, match="no node 'topside'"):
        compare_runs(one, one, node="topside")
    with pytest.raises(TraceError, match="no time in common"):
        compare_runs(one, one, shift_s=100.0)


def test_labels_of_runs_are_the_first_differing_property() -> None:
    assert labels_of(header(), header(io="emulated", seed=3)) == ("sim", "emulated")
    assert labels_of(header(), header(seed=3)) == ("seed 0", "seed 3")
    assert labels_of(header(), header()) == ("first", "second")


def test_select_signals_returns_commands_first_then_largest_difference(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    one = run({"depth": (20.0, lambda t: {"depth_m": dive_m(t), "still_m": 1.0}), "pwm": (50.0, pulses())})
    other = run({"depth": (20.0, lambda t: {"depth_m": 1.0, "still_m": 1.0}), "pwm": (50.0, pulses(3.0))}, io="pi")
    comparison = compare_runs(one, other)
    assert [signal.name for signal in select_signals(comparison)] == ["pwm.pulses_us", "depth.depth_m"]
    path = tmp_path / "both.png"
    draw_comparison(comparison, one.header, path)
    assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    before = path.read_bytes()
    draw_comparison(comparison, one.header, path, ["depth.still_m"])
    assert path.read_bytes() != before
    draw_comparison(comparison, one.header, path, ["pwm.pulses_us[1]"])
    with pytest.raises(UnknownNameError, match=r"'pwm.pulses_us' has no \[2\][\s\S]*\[0\] to \[1\]"):
        draw_comparison(comparison, one.header, path, ["pwm.pulses_us[2]"])
    with pytest.raises(UnknownNameError, match=r"no signal 'depth.dept'[\s\S]*depth.depth_m"):
        draw_comparison(comparison, one.header, path, ["depth.dept"])
