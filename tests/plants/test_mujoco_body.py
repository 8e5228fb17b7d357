import numpy as np
import pytest

from snr_sim.plants.mujoco_body import MujocoBody
from snr_sim.plants.mujoco_engine import MujocoWorld
from snr_sim.prelude.errors import ParameterError

INERTIAL = '<inertial pos="0.02 -0.01 -0.03" mass="13" fullinertia="0.26 0.23 0.37 0.02 -0.01 0.015"/>'
BODY = f'<body name="vehicle" simple="false"><freejoint/>{INERTIAL}</body>'


def body(inside: str = BODY, gravity: str = "0 0 0") -> MujocoBody:
    text = f'<mujoco><option gravity="{gravity}"/><worldbody>{inside}</worldbody></mujoco>'
    return MujocoBody(MujocoWorld(text, 0.001, ("vehicle",)), "vehicle")


def test_rigid_mass_matrix_equals_textbook() -> None:
    x, y, z = 0.02, -0.01, -0.03
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    inertia = np.array([[0.26, 0.02, -0.01], [0.02, 0.23, 0.015], [-0.01, 0.015, 0.37]])
    expected = np.block([[13 * np.eye(3), -13 * cross], [13 * cross, inertia - 13 * cross @ cross]])
    assert body().rigid == pytest.approx(expected, abs=1e-12)


def test_added_mass_acts_in_body_axes_at_any_attitude() -> None:
    """MuJoCo's own step responds to a force by the full matrix; off-diagonal terms come from turning it."""
    one = body(BODY.replace(INERTIAL, '<inertial pos="0 0 0" mass="13" diaginertia="0.26 0.23 0.37"/>'))
    more = np.diag([6.0, 7.0, 19.0, 0.2, 0.1, 0.2])
    turn = np.array([np.cos(0.4), 0.6 * np.sin(0.4), 0.0, 0.8 * np.sin(0.4)])
    one.put([0.0, 0.0, 0.0, *turn], [0.0] * 6)
    one.detect_contacts()
    expected = [0.3, -0.2, 0.1, 0.05, 0.04, -0.03]
    one.move(more, expected, 0.001)
    assert one.velocity() == pytest.approx([0.001 * value for value in expected], abs=1e-15)
    rotation = one._rotation.reshape(3, 3).copy()
    push = one._applied.copy()
    linear = rotation @ (np.eye(3) * 13.0 + more[:3, :3]) @ rotation.T @ expected[:3]
    assert push[:3] == pytest.approx(linear, abs=1e-12)
    assert push[3:] == pytest.approx((np.diag([0.26, 0.23, 0.37]) + more[3:, 3:]) @ expected[3:], abs=1e-12)


@pytest.mark.parametrize(
    ("inside", "message"),
    [
        (BODY.replace("<freejoint/>", "<joint/>"), "does not move freely"),
        (BODY.replace("<freejoint/>", ""), "does not move freely"),
        (f'<body name="boat"><body name="vehicle"><joint/>{INERTIAL}</body></body>', "does not move freely"),
        (BODY.replace("</body>", '<body><joint/><geom size=".1"/></body></body>'), "has parts that move"),
        ('<body name="vehicle"><freejoint/><geom size=".1"/></body>', "keeps only the diagonal"),
    ],
)
def test_unsuitable_body_raises(inside: str, message: str) -> None:
    with pytest.raises(ParameterError, match=f"'vehicle'.*{message}|{message}.*'vehicle'"):
        body(inside)
