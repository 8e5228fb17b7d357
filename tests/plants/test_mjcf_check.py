import math
import re
from pathlib import Path

import pytest

from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.pool import Pool
from snr_sim.plants.urov.urov import Urov
from snr_sim.prelude.errors import ParameterError
from tests.plants.vehicles import HEAVY

START = Dive((0.0, 0.0, -2.0))
BODY = (
    '<body name="vehicle" simple="false"><freejoint/>'
    '<inertial pos="0 0 0" mass="13.2" diaginertia="0.26 0.23 0.37"/><geom type="box" size="0.2 0.2 0.1"/></body>'
)


def world(option: str = "", body: str = BODY, more: str = "") -> str:
    return f"<mujoco>{option}<worldbody>{body}</worldbody>{more}</mujoco>"


def make_urov(mjcf: str, pool: Pool | None = None, step_s: float = 0.005) -> Urov:
    return Urov(HEAVY, pool or Pool(), lambda seed: START, mjcf=mjcf, step_s=step_s)


@pytest.mark.parametrize(
    ("option", "found", "reason"),
    [
        ('<option density="1000"/>', 'density="1000"', "takes the place of MuJoCo's fluid"),
        ('<option viscosity="0.001"/>', 'viscosity="0.001"', "takes the place of MuJoCo's fluid"),
        ('<option wind="0.3 0 0"/>', 'wind="0.3 0 0"', r"Dive\(currents=\(Current\(0\.0, \(0\.3, 0, 0\)\)"),
        ('<option gravity="0 0 -1.62"/>', 'gravity="0 0 -1.62"', r"Pool\(gravity_mps2=9\.81\)"),
        ('<option gravity="0 1 -9.81"/>', 'gravity="0 1 -9.81"', "straight down"),
        ('<option gravity="0 0 9.81"/>', 'gravity="0 0 9.81"', "straight down"),
        ('<option integrator="RK4"/>', 'integrator="RK4"', "the one step that Euler makes"),
        ('<option integrator="implicitfast"/>', 'integrator="IMPLICITFAST"', "the one step that Euler makes"),
        ('<option timestep="0.001"/>', 'timestep="0.001"', r"step_s=0\.001"),
        ('<option timestep="0.002"/>', 'timestep="0.002"', r"step_s=0\.002"),
        ('<option><flag gravity="disable"/></option>', 'gravity="disable"', "without a weight"),
        ('<option><flag sleep="enable"/></option>', 'sleep="enable"', "asleep"),
    ],
)
def test_option_of_the_plant_raises_with_reason(option: str, found: str, reason: str) -> None:
    with pytest.raises(ParameterError, match=f"The MJCF has .*{found}") as caught:
        make_urov(world(option))
    assert re.search(reason, caught.value.fix)


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        ("<freejoint/>", '<joint type="free" damping="5"/>', "a joint of 'vehicle' with damping"),
        ("<freejoint/>", '<joint type="free" armature="5"/>', "a joint of 'vehicle' with armature"),
        ("<freejoint/>", '<joint type="free" frictionloss="5"/>', "a joint of 'vehicle' with frictionloss"),
        ("<freejoint/>", '<joint type="free" stiffness="5"/>', "a joint of 'vehicle' with stiffness"),
        ("<body ", '<body gravcomp="1" ', "gravcomp at 'vehicle'"),
        ("<geom ", '<geom fluidshape="ellipsoid" ', "a geom with fluidshape"),
    ],
)
def test_force_on_vehicle_inside_mujoco_raises(old: str, new: str, found: str) -> None:
    with pytest.raises(ParameterError, match=f"The MJCF has {found}") as caught:
        make_urov(world(body=BODY.replace(old, new, 1)))
    assert caught.value.fix.startswith("take it out")


def test_spring_or_actuator_raises() -> None:
    site, joint = '<site name="hook"/>', '<freejoint name="free"/>'
    body = '<site name="pole"/>' + BODY.replace("<freejoint/>", joint + site)
    spring = '<tendon><spatial stiffness="9"><site site="pole"/><site site="hook"/></spatial></tendon>'
    with pytest.raises(ParameterError, match="a tendon that is a spring"):
        make_urov(world(body=body, more=spring))
    with pytest.raises(ParameterError, match="1 actuators"):
        make_urov(world(body=body, more='<actuator><motor site="hook"/></actuator>'))


def test_mass_too_large_for_volume_raises() -> None:
    with pytest.raises(ParameterError, match=r"The MJCF's mass of the vehicle is 13200\.0: grams\?"):
        make_urov(world(body=BODY.replace("13.2", "13200")))
    with pytest.raises(ParameterError, match="The MJCF's mass of 132 kg by the vehicle's volume is 9850"):
        make_urov(world(body=BODY.replace("13.2", "132")))


def test_contact_settings_and_same_step_and_gravity_are_kept() -> None:
    option = '<option timestep="0.01" gravity="0 0 -1.62" cone="elliptic" impratio="7" integrator="Euler"/>'
    light = Pool(gravity_mps2=1.62)
    plant = make_urov("<!-- <option timestep='1'/> -->" + world(option), light, 0.01)
    for _ in range(200):
        plant.step(0.01)
    assert plant._body._model.opt.impratio == 7.0
    # The mass of the MJCF is not trimmed: 13.4 l carry 13.2 kg and 0.2 kg more.
    net, mass = 1.62 * (13.4 - 13.2), 13.2 + 18.6863
    slow = (math.sqrt(33.0**2 + 4.0 * 190.0 * net) - 33.0) / 380.0
    fast = slow + 33.0 / 190.0
    left = math.exp(-190.0 * (slow + fast) / mass * 2.0)
    assert plant.velocity_mps[2] == pytest.approx(slow * (1.0 - left) / (1.0 + slow / fast * left), rel=1e-3)
    assert plant.mass_matrix[2, 2] == pytest.approx(mass)


def test_path_instead_of_text_raises(tmp_path: Path) -> None:
    path = tmp_path / "pool.xml"
    path.write_text(world(), encoding="utf-8")
    for given in (path, str(path), 3):
        with pytest.raises(ParameterError, match=r"MuJoCo cannot read the MJCF: .* is not XML") as caught:
            make_urov(given)  # type: ignore[arg-type]
        assert "read_text()" in caught.value.fix
    make_urov(path.read_text(encoding="utf-8"))


def test_start_inside_unnamed_geom_names_its_body() -> None:
    rock = '<body name="rock" pos="0 0 -2.3"><geom size="0.3"/></body>'
    with pytest.raises(ParameterError, match="deep in 'rock'"):
        make_urov(world(body=BODY + rock))
    with pytest.raises(ParameterError, match="deep in 'world'"):
        make_urov(world(body=BODY + '<geom pos="0 0 -2.3" size="0.3"/>'))
