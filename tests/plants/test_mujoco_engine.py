import math
import sys
from pathlib import Path

import pytest

from snr_sim.plants.mujoco_engine import MujocoWorld
from snr_sim.prelude.errors import MissingExtraError, ParameterError, PlantError

BALL = '<mujoco><worldbody><body name="ball"><freejoint/><geom size=".1"/></body></worldbody></mujoco>'


def test_world_has_engine_version_and_given_step() -> None:
    world = MujocoWorld(BALL, 0.004, ("ball",))
    world.mujoco.mj_step(world.model, world.data)
    assert world.engine.startswith("mujoco 4")
    assert world.data.time == 0.004


def test_malformed_mjcf_raises_with_source_and_line() -> None:
    with pytest.raises(ParameterError, match=r"MuJoCo cannot read pool\.xml: XML Error.*'bowl', line 1"):
        MujocoWorld("<mujoco><bowl/></mujoco>", 0.005, source="pool.xml")
    with pytest.raises(ParameterError, match="MuJoCo cannot read the MJCF"):
        MujocoWorld("not xml at all", 0.005)


def test_missing_body_raises_with_nearest_name() -> None:
    with pytest.raises(ParameterError, match=r"no body 'bal' in the MJCF") as caught:
        MujocoWorld(BALL, 0.005, ("bal",))
    assert "ball" in caught.value.fix


def test_non_finite_state_raises_and_is_not_reset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log where it stands
    world = MujocoWorld(BALL, 0.005, ("ball",))
    world.mujoco.mj_step(world.model, world.data)
    world.check_finite()
    world.data.qvel[2] = math.nan
    with pytest.raises(PlantError, match=r"At 0\.005 s the velocity of ball\[2\] is nan"):
        world.check_finite()
    world.mujoco.mj_step(world.model, world.data)
    assert world.data.time == pytest.approx(0.01)
    with pytest.raises(PlantError, match=r"At 0\.01 s the position of ball\[0\] is nan"):
        world.check_finite()


def test_missing_mujoco_raises_with_install_hint(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingExtraError, match=r"snr_sim\[sim\]"):
        MujocoWorld(BALL, 0.005)
