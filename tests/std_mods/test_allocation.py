"""Thrust allocation on the BlueROV2's two frames, as they are published (FRD turned to x forward, y left, z up)."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest

from snr_sim.prelude.errors import ParameterError, UnknownName
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


def test_within_the_limits_exactly_the_wanted_wrench_is_given() -> None:
    allocation = heavy()
    for wrench in np.random.default_rng(1).uniform(-2.0, 2.0, (50, 6)):
        allotment = allocation.allocate(wrench.tolist())
        assert matrix(HEAVY) @ allotment.thrusts_n == pytest.approx(wrench, abs=1e-9)
        assert allocation.wrench_of(allotment.thrusts_n) == pytest.approx(wrench, abs=1e-9)
        assert (allotment.share, allotment.lacking) == (1.0, ())


def test_no_other_thrusts_that_give_it_are_smaller() -> None:
    """Least squares: the answer is at right angles to all thrusts that give no wrench."""
    thrusts = heavy().allocate([10.0, -5.0, 8.0, 0.3, -0.4, 1.0]).thrusts_n
    _, _, right = np.linalg.svd(matrix(HEAVY))
    assert right[6:] @ thrusts == pytest.approx([0.0, 0.0], abs=1e-12)


def test_beyond_the_limits_the_direction_is_kept_and_one_thruster_gives_all_it_can() -> None:
    allocation = heavy()
    for wrench in np.random.default_rng(2).uniform(-300.0, 300.0, (50, 6)):
        thrusts, share, _ = allocation.allocate(wrench.tolist())
        assert 0.0 < share < 1.0
        assert matrix(HEAVY) @ thrusts == pytest.approx(share * wrench, rel=1e-9, abs=1e-9)
        assert min(thrusts) >= LIMITS[0] - 1e-9
        assert max(thrusts) <= LIMITS[1] + 1e-9
        reserve = min(min(LIMITS[1] - thrust, thrust - LIMITS[0]) for thrust in thrusts)
        assert reserve == pytest.approx(0.0, abs=1e-9)


def test_flat_out_ahead_is_what_four_thrusters_at_45_degrees_give() -> None:
    """The front pair runs astern when the vehicle goes ahead, and gives less; keeping the direction, so do all."""
    thrusts, _, _ = heavy().allocate([1000.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert heavy().wrench_of(thrusts)[0] == pytest.approx(4 * 39.9 * C, rel=0.01)


def test_what_comes_first_is_given_in_full_and_the_rest_shares_what_is_left() -> None:
    wrench = [400.0, 100.0, 60.0, 0.0, 0.0, 12.0]
    fair = np.array(heavy().wrench_of(heavy().allocate(wrench).thrusts_n))
    thrusts, share, _ = heavy(first=("heave", "yaw")).allocate(wrench)
    given = matrix(HEAVY) @ thrusts
    assert given[[2, 5]] == pytest.approx([60.0, 12.0])
    assert given[[0, 1]] == pytest.approx([share * 400.0, share * 100.0])
    assert 0.0 < share < 1.0
    assert fair[5] < 5.0
    assert min(thrusts) >= LIMITS[0] - 1e-9
    assert max(thrusts) <= LIMITS[1] + 1e-9


def test_more_of_what_comes_first_than_there_is_leaves_nothing_to_the_rest() -> None:
    thrusts, share, _ = heavy(first=("yaw",)).allocate([50.0, 0.0, 0.0, 0.0, 0.0, 1000.0])
    assert share == pytest.approx(0.0, abs=1e-12)
    assert matrix(HEAVY)[0] @ thrusts == pytest.approx(0.0, abs=1e-9)


def test_the_classic_frame_lacks_pitch_and_says_so_when_somebody_asks_for_it() -> None:
    classic = Allocation(matrix(CLASSIC), LIMITS)
    assert classic.lacking == ("pitch",)
    assert classic.allocate([5.0, 0.0, 0.0, 0.0, 0.0, 0.0]).lacking == ()
    assert classic.allocate([5.0, 0.0, 0.0, 0.0, 0.2, 0.0]).lacking == ("pitch",)
    with pytest.raises(ParameterError, match=r"6 thrusters pushes pitch by itself[\s\S]*surge, sway, heave, roll, yaw"):
        classic.require("roll", "pitch")
    classic.require("surge", "heave", "yaw")


def test_what_the_classic_frame_can_push_it_pushes_exactly() -> None:
    classic = Allocation(matrix(CLASSIC), LIMITS)
    wrench = [6.0, -3.0, 5.0, 0.4, 0.0, 0.5]
    given = matrix(CLASSIC) @ classic.allocate(wrench).thrusts_n
    assert np.delete(given, 4) == pytest.approx(np.delete(wrench, 4))
    pitch_alone = classic.allocate([0.0, 0.0, 0.0, 0.0, 3.0, 0.0])
    assert pitch_alone.thrusts_n == pytest.approx([0.0] * 6)


def test_without_a_broken_thruster_the_others_do_its_part() -> None:
    for broken in range(8):
        allocation = heavy(off=[broken])
        assert allocation.lacking == (), "eight thrusters for six axes"
        wrench = [4.0, -3.0, 2.0, 0.1, -0.1, 0.3]
        thrusts = allocation.allocate(wrench).thrusts_n
        assert thrusts[broken] == 0.0
        assert matrix(HEAVY) @ thrusts == pytest.approx(wrench)
    one_vertical_left = heavy(off=[4, 5, 6]).lacking
    assert len(one_vertical_left) == 2
    assert set(one_vertical_left) < {"heave", "roll", "pitch"}


def test_each_thruster_can_have_limits_of_its_own() -> None:
    limits = [LIMITS] * 7 + [(-1.0, 2.0)]
    thrusts, share, _ = Allocation(matrix(HEAVY), limits).allocate([0.0, 0.0, 40.0, 0.0, 0.0, 0.0])
    assert thrusts[7] == pytest.approx(2.0)
    assert share == pytest.approx(0.2)


def test_unknown_axes_and_impossible_numbers_are_refused_when_it_is_made() -> None:
    with pytest.raises(UnknownName, match="did you mean 'heave'"):
        heavy(first=("heav",))
    with pytest.raises(UnknownName, match="no axis 'up'"):
        heavy().require("up")
    with pytest.raises(ParameterError, match="no thruster 8"):
        heavy(off=[8])
    with pytest.raises(ParameterError, match="No thruster pushes anywhere"):
        heavy(off=range(8))
    for limits in ((1.0, 5.0), (-math.inf, 5.0), (math.nan, 1.0), [LIMITS] * 7):
        with pytest.raises(ParameterError, match=r"limits|Limits"):
            Allocation(matrix(HEAVY), limits)  # type: ignore[arg-type]


@pytest.mark.parametrize("wrench", [[0.0] * 5, [0.0] * 7, [math.nan] + [0.0] * 5, [math.inf] + [0.0] * 5])
def test_what_is_no_wrench_is_refused(wrench: list[float]) -> None:
    with pytest.raises(ParameterError, match="six finite numbers: " + ", ".join(AXES)):
        heavy().allocate(wrench)


@pytest.mark.parametrize("off", [(), (5,)])
def test_it_is_the_pseudo_inverse_and_the_thrusts_are_those_of_numpy(off: tuple[int, ...]) -> None:
    given = matrix(HEAVY)
    given[:, list(off)] = 0.0
    rng = np.random.default_rng(5)
    for _ in range(20):
        wrench = rng.normal(size=6)
        by_numpy = np.linalg.pinv(given) @ wrench
        assert heavy(off=off).allocate(wrench.tolist()).thrusts_n == pytest.approx(by_numpy.tolist(), abs=1e-12)


DIGEST = """
import hashlib, sys
from snr_sim.scenario import library
library.load_robot(library.find("robots", "urov"))
from snr_sim.std_mods.allocation import Allocation
scenario = library.load_scenario(library.find("scenarios", "urov_depth_hold"))
made = Allocation(scenario.parameters(0).vehicle.thruster_matrix(), (-40.0, 50.0), first=("heave", "yaw"))
thrusts = [made.allocate([k / 7, 1 / (k + 3), k / 3 - 1, 0.1, 0.2, 0.3]).thrusts_n for k in range(50)]
print(hashlib.sha256(repr(thrusts).encode()).hexdigest())
"""


@pytest.mark.slow
def test_thrusts_are_the_same_to_the_last_bit_whichever_way_numpys_library_takes() -> None:
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
