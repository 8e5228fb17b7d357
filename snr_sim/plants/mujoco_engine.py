"""Interface to MuJoCo: loads a world from MJCF text, reports its mistakes as errors, and turns NaN into errors.

When a state is no longer finite, MuJoCo alone writes a line to a log file and resets to the start without an error.
That is disabled here, and `check_finite` reports the cause; called before MuJoCo's own step, it also prevents the log
file.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

from snr_sim.prelude.errors import MissingExtraError, ParameterError, PlantError, suggest


class MujocoWorld:
    """A model and its state.

    Args:
        mjcf: the world as MJCF text.
        step_s: of integration; replaces that of the text.
        bodies: names of the bodies that must be in it.
        source: name of the text in messages.

    Raises:
        MissingExtraError: MuJoCo is not installed.
        ParameterError: the text is not MJCF, or a body is missing.
    """

    def __init__(self, mjcf: str, step_s: float, bodies: tuple[str, ...] = (), source: str = "the MJCF") -> None:
        mujoco = mujoco_module()
        if not isinstance(mjcf, str) or (mjcf.strip() and not mjcf.lstrip().startswith("<")):
            raise ParameterError(
                f"MuJoCo cannot read {source}: {mjcf!r:.80} is not XML.",
                fix="pass the MJCF text itself; for a file, Path(...).read_text().",
            )
        try:
            self.model: Any = mujoco.MjModel.from_xml_string(mjcf)
        except ValueError as error:
            raise ParameterError(
                f"MuJoCo cannot read {source}: {' '.join(str(error).split())}",
                fix="correct the line it names; the elements and attributes are in MuJoCo's XML reference.",
            ) from error
        self.mujoco: Any = mujoco  # the package, for its functions
        self.engine: str = f"mujoco {mujoco.__version__}"
        self._source = source
        self.own_step_s: float = float(self.model.opt.timestep)  # of the text, or MuJoCo's default
        self.model.opt.timestep = step_s
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        for name in bodies:
            self.body_id(name)
        self.data: Any = mujoco.MjData(self.model)

    def body_id(self, name: str) -> int:
        """Return the number of a body; a ParameterError names the nearest one."""
        names = [self.model.body(i).name for i in range(self.model.nbody)]
        if name not in names:
            raise ParameterError(
                f"There is no body '{name}' in {self._source}.",
                fix=suggest(name, [known for known in names if known not in ("", "world")]),
            )
        return names.index(name)

    def check_finite(self) -> None:
        """Raise a PlantError that names the joint if a position or a velocity is not finite."""
        data = self.data
        for what, values, is_velocity in (("position", data.qpos, False), ("velocity", data.qvel, True)):
            total = float(values.sum())
            if total - total == 0.0:
                continue
            for i, value in enumerate(values.tolist()):
                if value - value != 0.0:
                    raise PlantError(
                        f"At {data.time:g} s the {what} of {self._joint_of(i, is_velocity)} is {value}.",
                        fix="look at the last commands and at masses and inertias; try a shorter step.",
                    )

    def _joint_of(self, address: int, is_velocity: bool) -> str:
        """Return joint and number of a coordinate, as in 'vehicle[2]'."""
        starts = self.model.jnt_dofadr if is_velocity else self.model.jnt_qposadr
        joint = max(j for j in range(self.model.njnt) if starts[j] <= address)
        name = self.model.joint(joint).name or self.model.body(int(self.model.jnt_bodyid[joint])).name
        return f"{name}[{address - int(starts[joint])}]"


def mujoco_module() -> ModuleType:
    """Return mujoco, imported at the first call; raise a MissingExtraError if it is not installed."""
    try:
        import mujoco
    except ImportError as error:
        raise MissingExtraError("mujoco-core", "sim") from error
    module: ModuleType = mujoco
    return module
