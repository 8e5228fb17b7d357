"""Thrust allocation on the BlueROV2's two frames, as they are published (FRD turned to x forward, y left, z up)."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest

from snr_sim.prelude.errors import ParameterError, UnknownNameError
from snr_sim.prelude.wrench import AXES
from snr_sim.std_mods.allocation import Allocation

C = math.sqrt(0.5)
# von Benzon et al. 2022: position, direction. Classic: CentraleNantesROV and FletcherFT, actuators.xacro.
HEAVY = [
    ((0.156, -0.111, -0.085), (C, C, 0)),
    ((0.156, 0.111, -0.085), (C, -C, 0)),
    ((-0.156, -0.111, -0.085), (-C, C, 0)),
    ((-0.156, 0.111, -0.085), (-C, -C, 0)),
    ((0.12, -0.218, 0), (0, 0, 1)),
    ((0.12, 0.218, 0), (0, 0, -1)),
    ((-0.12, -0.218, 0), (0, 0, -1)),
    ((-0.12, 0.218, 0), (0, 0, 1)),
]
CLASSIC = [
    ((0.1355, -0.1, -0.0725), (C, C, 0)),
    ((0.1355, 0.1, -0.0725), (C, -C, 0)),
    ((-0.1475, -0.1, -0.0725), (-C, C, 0)),
    ((-0.1475, 0.1, -0.0725), (-C, -C, 0)),
    ((0.0025, -0.1105, -0.005), (0, 0, 1)),
    ((0.0025, 0.1105, -0.005), (0, 0, 1)),
]
LIMITS = (-39.9, 51.5)


def matrix(frame: list[tuple[tuple[float, ...], tuple[float, ...]]]) -> np.ndarray:
    return np.array([[*direction, *np.cross(place, direction)] for place, direction in frame]).T


def heavy(**kwargs: object) -> Allocation:
    return Allocation(matrix(HEAVY), LIMITS, **kwargs)  # type: ignore[arg-type]


def test_wrench_within_limits_is_produced_exactly() -> None:
    allocation = heavy()
    for wrench in np.random.default_rng(1).uniform(-2.0, 2.0, (50, 6)):
        allotment = allocation.allocate(wrench.tolist())
        assert matrix(HEAVY) @ allotment.thrusts_n == pytest.approx(wrench, abs=1e-9)
        assert allocation.wrench_of(allotment.thrusts_n) == pytest.approx(wrench, abs=1e-9)
        assert (allotment.scale, allotment.unactuated) == (1.0, ())


def test_thrusts_have_minimum_norm() -> None:
    """Least squares: the answer is at right angles to all thrusts that give no wrench."""
    thrusts = heavy().allocate([10.0, -5.0, 8.0, 0.3, -0.4, 1.0]).thrusts_n
    _, _, right = np.linalg.svd(matrix(HEAVY))
    assert right[6:] @ thrusts == pytest.approx([0.0, 0.0], abs=1e-12)


def test_wrench_beyond_limits_keeps_direction_and_saturates_one_thruster() -> None:
    allocation = heavy()
    for wrench in np.random.default_rng(2).uniform(-300.0, 300.0, (50, 6)):
        thrusts, scale, _ = allocation.allocate(wrench.tolist())
        assert 0.0 < scale < 1.0
        assert matrix(HEAVY) @ thrusts == pytest.approx(scale * wrench, rel=1e-9, abs=1e-9)
        assert min(thrusts) >= LIMITS[0] - 1e-9
        assert max(thrusts) <= LIMITS[1] + 1e-9
        reserve = min(min(LIMITS[1] - thrust, thrust - LIMITS[0]) for thrust in thrusts)
        assert reserve == pytest.approx(0.0, abs=1e-9)


def test_full_surge_equals_four_thrusters_at_45_degrees() -> None:
    """The front pair runs astern when the vehicle goes ahead, and gives less; keeping the direction, so do all."""
    thrusts, _, _ = heavy().allocate([1000.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert heavy().wrench_of(thrusts)[0] == pytest.approx(4 * 39.9 * C, rel=0.01)


def test_priority_axes_are_met_in_full_before_others() -> None:
    wrench = [400.0, 100.0, 60.0, 0.0, 0.0, 12.0]
    fair = np.array(heavy().wrench_of(heavy().allocate(wrench).thrusts_n))
    thrusts, scale, _ = heavy(priority_axes=("heave", "yaw")).allocate(wrench)
    given = matrix(HEAVY) @ thrusts
    assert given[[2, 5]] == pytest.approx([60.0, 12.0])
    assert given[[0, 1]] == pytest.approx([scale * 400.0, scale * 100.0])
    assert 0.0 < scale < 1.0
    assert fair[5] < 5.0
    assert min(thrusts) >= LIMITS[0] - 1e-9
    assert max(thrusts) <= LIMITS[1] + 1e-9


def test_saturated_priority_axes_leave_no_thrust_for_others() -> None:
    thrusts, scale, _ = heavy(priority_axes=("yaw",)).allocate([50.0, 0.0, 0.0, 0.0, 0.0, 1000.0])
    assert scale == pytest.approx(0.0, abs=1e-12)
    assert matrix(HEAVY)[0] @ thrusts == pytest.approx(0.0, abs=1e-9)


def test_classic_frame_reports_pitch_as_unactuated_when_requested() -> None:
    classic = Allocation(matrix(CLASSIC), LIMITS)
    assert classic.unactuated == ("pitch",)
    assert classic.allocate([5.0, 0.0, 0.0, 0.0, 0.0, 0.0]).unactuated == ()
    assert classic.allocate([5.0, 0.0, 0.0, 0.0, 0.2, 0.0]).unactuated == ("pitch",)
    with pytest.raises(ParameterError, match=r"6 thrusters pushes pitch by itself[\s\S]*surge, sway, heave, roll, yaw"):
        classic.require("roll", "pitch")
    classic.require("surge", "heave", "yaw")


def test_classic_frame_produces_actuated_axes_exactly() -> None:
    classic = Allocation(matrix(CLASSIC), LIMITS)
    wrench = [6.0, -3.0, 5.0, 0.4, 0.0, 0.5]
    given = matrix(CLASSIC) @ classic.allocate(wrench).thrusts_n
    assert np.delete(given, 4) == pytest.approx(np.delete(wrench, 4))
    pitch_alone = classic.allocate([0.0, 0.0, 0.0, 0.0, 3.0, 0.0])
    assert pitch_alone.thrusts_n == pytest.approx([0.0] * 6)


def test_failed_thruster_is_compensated_by_others() -> None:
    for broken in range(8):
        allocation = heavy(failed_thrusters=[broken])
        assert allocation.unactuated == (), "eight thrusters for six axes"
        wrench = [4.0, -3.0, 2.0, 0.1, -0.1, 0.3]
        thrusts = allocation.allocate(wrench).thrusts_n
        assert thrusts[broken] == 0.0
        assert matrix(HEAVY) @ thrusts == pytest.approx(wrench)
    one_vertical_left = heavy(failed_thrusters=[4, 5, 6]).unactuated
    assert len(one_vertical_left) == 2
    assert set(one_vertical_left) < {"heave", "roll", "pitch"}


def test_thrusters_may_have_separate_limits() -> None:
    limits = [LIMITS] * 7 + [(-1.0, 2.0)]
    thrusts, scale, _ = Allocation(matrix(HEAVY), limits).allocate([0.0, 0.0, 40.0, 0.0, 0.0, 0.0])
    assert thrusts[7] == pytest.approx(2.0)
    assert scale == pytest.approx(0.2)


def test_constructor_rejects_unknown_axes_and_invalid_numbers() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'heave'"):
        heavy(priority_axes=("heav",))
    with pytest.raises(UnknownNameError, match="no axis 'up'"):
        heavy().require("up")
    with pytest.raises(ParameterError, match="no thruster 8"):
        heavy(failed_thrusters=[8])
    with pytest.raises(ParameterError, match="No thruster pushes anywhere"):
        heavy(failed_thrusters=range(8))
    for limits in ((1.0, 5.0), (-math.inf, 5.0), (math.nan, 1.0), [LIMITS] * 7):
        with pytest.raises(ParameterError, match=r"limits|Limits"):
            Allocation(matrix(HEAVY), limits)  # type: ignore[arg-type]


@pytest.mark.parametrize("wrench", [[0.0] * 5, [0.0] * 7, [math.nan] + [0.0] * 5, [math.inf] + [0.0] * 5])
def test_invalid_wrench_is_rejected(wrench: list[float]) -> None:
    with pytest.raises(ParameterError, match="six finite numbers: " + ", ".join(AXES)):
        heavy().allocate(wrench)


@pytest.mark.parametrize("off", [(), (5,)])
def test_thrusts_equal_numpy_pseudo_inverse(off: tuple[int, ...]) -> None:
    given = matrix(HEAVY)
    given[:, list(off)] = 0.0
    rng = np.random.default_rng(5)
    for _ in range(20):
        wrench = rng.normal(size=6)
        by_numpy = np.linalg.pinv(given) @ wrench
        assert heavy(failed_thrusters=off).allocate(wrench.tolist()).thrusts_n == pytest.approx(
            by_numpy.tolist(), abs=1e-12
        )


DIGEST = """
import hashlib, sys
from snr_sim.scenario import library
library.load_robot(library.find("robots", "urov"))
from snr_sim.std_mods.allocation import Allocation
scenario = library.load_scenario(library.find("scenarios", "urov_depth_hold"))
made = Allocation(scenario.parameters(0).vehicle.thruster_matrix(), (-40.0, 50.0), priority_axes=("heave", "yaw"))
thrusts = [made.allocate([k / 7, 1 / (k + 3), k / 3 - 1, 0.1, 0.2, 0.3]).thrusts_n for k in range(50)]
print(hashlib.sha256(repr(thrusts).encode()).hexdigest())
"""


@pytest.mark.slow
def test_thrusts_are_bit_identical_for_every_blas_kernel() -> None:
    """OpenBLAS, which numpy includes, uses other kernels on other processors; a variable selects them."""
    digests = set()
    for kind in ("Nehalem", "Prescott", ""):
        environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE"}
        if kind:
            environment["OPENBLAS_CORETYPE"] = kind
        done = subprocess.run([sys.executable, "-c", DIGEST], capture_output=True, text=True, env=environment)
        assert done.returncode == 0, done.stderr
        digests.add(done.stdout)
    assert len(digests) == 1
