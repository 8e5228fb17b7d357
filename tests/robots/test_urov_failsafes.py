"""Each cell of the table of failsafes: a cause, an action, and what the vehicle then does.

The same cells in simulation, and with the thrusters at the pins of an emulated microcontroller.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import groupby
from typing import Any

import msgspec
import pytest

from snr_sim import Config, SimRunner
from snr_sim.core.clocks import SimClock
from snr_sim.devices.emulated.board import EmulatedPort
from snr_sim.devices.emulated.lock_step import ProcessorInLoopPlant
from snr_sim.devices.mcu.mcu_board import McuBoard
from snr_sim.devices.pwm.pwm_backend import SimPwm
from snr_sim.devices.readings import SensorLoop, SensorLoopFactory
from snr_sim.plants.stepping import Stepper
from snr_sim.plants.urov.t200 import MAX_PULSE_US, MIN_PULSE_US
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.scenario import RobotContext, RobotInfo
from snr_sim.prelude.signals import RESET, LeakReading
from snr_sim.prelude.task import Page, Task, TaskType
from snr_sim.scenario import library
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.teleop.scripted_pilot import Cue
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory
from tests.lanes import slow

robot = library.load_robot(library.find("robots", "urov"))

from snr_sim_robot_urov.failsafes import ACTIONS, CAUSES, LASTING, OUTPUTS  # noqa: E402

ARM_S, FROM_S, TO_S, GAP_S = 1.8, 2.6, 4.8, 0.22
END_S = 6.0
DISARM_S, ARM_AGAIN_S, PERSON_END_S = 6.0, 6.2, 7.0  # if a person arms it again
GREETS_S = 2.0  # a link that was cut needs so long to greet again
REARM, WITHIN_S = "rearm", 5.0
LIMITS = {"lost_s": 0.5, "hold_s": 0.8, "low_s": 0.4}
EMPTY = 0.03  # charge of a battery that is low
NEUTRAL_N, PUSH_N = 0.5, 2.0
SETTLED_S = 0.4  # the lease of the last command, and what propellers need to stand still
CELLS = [
    (cause, action)
    for cause in CAUSES
    for action in (*ACTIONS, REARM)
    if not (action == "warn" and cause in (*OUTPUTS, "no_rearm"))
    and not (action == REARM and cause in (*LASTING, "no_rearm"))
]

# Each cause once, with another action than the cause before it.
FAST_CELLS = [
    row[i % len(row)] for i, row in enumerate([cell for cell in CELLS if cell[0] == cause] for cause in CAUSES)
]


class Gap:
    """A line that loses all data for GAP_S. Implements `BytePort`."""

    def __init__(self, port: EmulatedPort, now_s: Callable[[], float]) -> None:
        self.port, self.now_s, self.name = port, now_s, port.name

    def _is_torn(self) -> bool:
        return FROM_S <= self.now_s() < FROM_S + GAP_S

    def write(self, data: bytes) -> None:
        if not self._is_torn():
            self.port.write(data)

    def read(self) -> bytes:
        data = self.port.read()
        return b"" if self._is_torn() else data

    def wait(self, seconds: float) -> bool:
        return self.port.wait(seconds)

    def close(self) -> None:
        self.port.close()


class TornPwm(SimPwm):
    """Simulated outputs whose line, or whose microcontroller, fails at FROM_S for GAP_S."""

    def __init__(self, context: RobotContext, is_reset: bool) -> None:
        super().__init__(context.plant, context.now_s, 8, limits_us=(MIN_PULSE_US, MAX_PULSE_US))
        self.is_reset, self.failed = is_reset, False

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, reasons: list[str]) -> list[float]:
        if not self.failed and self.now_s() >= FROM_S:
            self.failed, self.disarm_reasons = True, [RESET] if self.is_reset else []
            raise DeviceError("nothing answers")
        return super().put(pulses_us, stamp_s, lease_s, reasons)

    def on_configure(self) -> None:
        if self.failed and self.now_s() < FROM_S + GAP_S:
            raise DeviceError("nothing answers")
        super().on_configure()

    def on_activate(self) -> None:
        self.disarm_reasons = []
        super().on_activate()


class Meddled:
    """A sensor of which some readings are replaced. Implements `Sensor`."""

    def __init__(self, sensor: Any, change: Callable[[Any], Any], now_s: Callable[[], float]) -> None:
        self._sensor, self._change, self._now_s = sensor, change, now_s

    def __getattr__(self, name: str) -> Any:
        return getattr(self._sensor, name)

    def read(self) -> Any:
        reading = self._sensor.read()
        return self._change(reading) if FROM_S <= self._now_s() < TO_S else reading


class LateLoop(SensorLoop):
    """A sensor's loop of a node that has too much to do: its pages wait for 0.2 s before they are handled."""

    def loop(self) -> None:
        now_s, reading = self.get_time_s(), self.device.read()
        made_s = now_s - 0.2 if FROM_S <= now_s < TO_S else now_s
        page = Page("imu", self.factory.data_of(reading), self.parent.name, made_s, True)
        self.schedule(Task(TaskType.store_page, "imu", [page]))


class LateFactory(SensorLoopFactory):
    def get(self, parent: Any) -> LateLoop:
        return LateLoop(self, parent, "imu_sensor", self.rate_hz)


class Dive:
    """A dive at 2 m, the pilot going ahead, in which something fails at FROM_S.

    Attributes:
        control_state: control states, in order, from just before.
        vehicle_pages: every page 'vehicle' from then on.
        samples: (time_s, control_state, thrust of all thrusters [N], widths at the pins of an emulated board [us]).
    """

    def __init__(self, io: str, cause: str, person: bool, actions: dict[str, Any]) -> None:
        scenario = library.load_scenario(library.find("scenarios", "urov_heading_hold"))
        # Of the robot as it is now: other tests load it again.
        from snr_sim_robot_urov.autopilot import AutopilotFactory, Watch
        from snr_sim_robot_urov.failsafe_monitor import FailsafeLimits
        from snr_sim_robot_urov.failsafes import Failsafes, Rearm

        failsafes = Failsafes(**{name: Rearm(WITHIN_S) if one == REARM else one for name, one in actions.items()})
        later_s = GREETS_S if cause == "link_lost" else 0.0
        end_s = PERSON_END_S if person else END_S
        script = [Cue(ARM_S, is_armed=True, mode="heading_hold", surge=0.3)]
        if person:
            script += [Cue(DISARM_S + later_s, is_armed=False), Cue(ARM_AGAIN_S + later_s, is_armed=True)]
        parameters = replace(
            scenario.parameters(1), script=tuple(script), failsafe_limits=FailsafeLimits(**LIMITS), failsafes=failsafes
        )
        if cause == "link_lost":
            parameters = replace(parameters, tether=replace(parameters.tether, cut=((FROM_S, TO_S),)))
        bare = scenario.plant(1, "mujoco")
        context = RobotContext(RobotInfo("urov", "urov", "test", "mujoco", parameters, {}), io, 1, bare)
        plant = robot.wrap_plant(context)
        context = replace(context, plant=plant)
        clock = SimClock()
        self.plant, self.now_s = plant, clock.now_s
        self.vehicle_pages: list[dict[str, Any]] = []
        self.samples: list[tuple[float, str, float, list[float]]] = []
        with pytest.MonkeyPatch.context() as patch:
            self._break_devices(patch, io, cause)
            parts = robot.roles(context, [Watch.factory(), AutopilotFactory(parameters)])
            self._meddle(parts["urov"], cause, bare)
            parts["urov"].append(FunctionLoopFactory(lambda loop: self._sample(bare), "sampler", 50.0))
            parts["urov"].append(FunctionEndpointFactory({(TaskType.store_page, "vehicle"): self._keep}))
            clock.follow(Stepper(plant).advance_to)
            runner = SimRunner(Config(factories=parts), clock=clock, until_s=end_s + later_s, log_notes=False)
            runner.run()
        self.notes = runner.nodes["urov"].notes
        if isinstance(plant, ProcessorInLoopPlant):
            plant.board.close()

    def _break_devices(self, patch: pytest.MonkeyPatch, io: str, cause: str) -> None:
        row, plant = robot.DEVICES[io], self.plant

        def meddled(name: str, change: Callable[[Any], Any]) -> None:
            open_device = row[name]
            patch.setitem(row, name, lambda context: Meddled(open_device(context), change, self.now_s))

        if cause == "stale_sensor":
            meddled("depth", lambda reading: Stale("the plug is out"))
        if cause == "nonsense":
            meddled("depth", lambda reading: msgspec.structs.replace(reading, depth_m=math.nan))
        if cause == "leak":
            meddled("leak", lambda reading: LeakReading(True, reading.stamp_s))
        if cause in (*OUTPUTS, "no_rearm") and not isinstance(plant, ProcessorInLoopPlant):
            patch.setitem(row, "pwm", lambda context: TornPwm(context, cause == "controller_reset"))
        elif cause in ("line_lost", "no_rearm"):
            board = plant.board
            plant.mcu = McuBoard(
                lambda: Gap(EmulatedPort(board), self.now_s),
                lambda: plant.plant.time_s,
                lambda: board.now_us * 1e-6,
                session=1,
            )

    def _meddle(self, urov: list[Any], cause: str, bare: Any) -> None:
        if cause == "overloaded":
            (at,) = [i for i, one in enumerate(urov) if getattr(one, "key", "") == "imu"]
            urov[at] = LateFactory("imu", urov[at].open_device, urov[at].rate_hz)
        if cause == "disk_full":
            lost = {"since_s": FROM_S, "lost": 3, "reason": "no space left on device"}
            for at_s, data in ((FROM_S, lost), (TO_S, {})):
                urov.append(once(at_s, f"disk_{at_s}", lambda loop, data=data: loop.store_data("recording", data)))
        if cause == "low_battery":
            supply = bare.thrusters.supply
            urov.append(once(FROM_S, "drain", lambda loop: supply.restore((EMPTY, supply.energy_j, 0.0, False))))
        if cause == "controller_reset" and isinstance(self.plant, ProcessorInLoopPlant):
            urov.append(once(FROM_S, "reset", lambda loop: self.plant.board.reset()))

    def _keep(self, task: Task, task_id: Any) -> None:
        page = task.val_list[0]
        if page.created_at_s >= FROM_S - 0.3:
            self.vehicle_pages.append({**page.data, "t": page.created_at_s})

    def _sample(self, bare: Any) -> None:
        thrust_n = sum(map(abs, bare.thrusters.forces_n))
        pins = [pin.width_us for pin in self.plant.board.pins()] if isinstance(self.plant, ProcessorInLoopPlant) else []
        if self.vehicle_pages:
            self.samples.append((self.now_s(), self.vehicle_pages[-1]["control_state"], thrust_n, pins))

    @property
    def control_state(self) -> list[str]:
        return [control_state for control_state, _ in groupby(one["control_state"] for one in self.vehicle_pages)]

    def check_outputs(self) -> None:
        """Nothing pushes in the states idle and neutral, and something does in the others; also at the pins."""
        for control_state, group in groupby(self.samples, lambda one: one[1]):
            samples = list(group)
            settled = [one for one in samples if one[0] > samples[0][0] + SETTLED_S]
            if control_state in ("idle", "neutral"):
                assert max((thrust_n for _, _, thrust_n, _ in settled), default=0.0) < NEUTRAL_N, control_state
                assert all(abs(width - 1500.0) < 1.0 for _, _, _, pins in settled for width in pins), control_state
            elif settled:
                assert max(thrust_n for _, _, thrust_n, _ in settled) > PUSH_N, control_state


def once(at_s: float, name: str, do: Callable[[Any], Any]) -> FunctionLoopFactory:
    """A component that does something once."""
    done = []

    def poll(loop: Any) -> None:
        if not done and loop.get_time_s() >= at_s:
            done.append(True)
            do(loop)

    return FunctionLoopFactory(poll, name, 50.0)


def expected(cause: str, action: str) -> list[str]:
    """Whose word counts, in order, in a dive with a cause and an action; after `neutral` a person disarms and arms."""
    follows = {"hold": ["hold", "surface"], "surface": ["surface"]}
    if cause in (*OUTPUTS, "no_rearm"):
        after = ["pilot"] if action == "neutral" else ["neutral", *follows.get(action, ["pilot"])]
        return ["pilot", "idle", *after]
    begin = ["pilot", "neutral"] if cause == "link_lost" else ["pilot"]
    if action == "warn":
        return [*begin, "pilot"] if cause == "link_lost" else begin
    if action == "neutral":
        return ["pilot", "neutral", "idle", "neutral" if cause in LASTING else "pilot"]
    if action == REARM:
        return ["pilot", "neutral", "pilot"]
    return [*begin, *follows[action], *([] if cause in LASTING else ["pilot"])]


def dive_of(io: str, cause: str, action: str) -> Dive:
    actions = {cause: action, "no_rearm_s": 0.8 if cause == "no_rearm" else 600.0}
    return Dive(io, cause, action == "neutral", actions)


def check_cell(io: str, cause: str, action: str) -> None:
    dive = dive_of(io, cause, action)
    assert dive.control_state == expected(cause, action)
    dive.check_outputs()
    vehicle_pages = [one["failsafes"][cause] for one in dive.vehicle_pages if cause in one.get("failsafes", {})]
    assert vehicle_pages, "page 'vehicle' reports the failsafe"
    assert any(f"Failsafe {cause}, t = " in note for note in dive.notes)
    ends = dive.vehicle_pages[-1].get("failsafes", {})
    lasts = cause in LASTING or (cause in (*OUTPUTS, "no_rearm") and action in ("hold", "surface"))
    assert (cause in ends) == lasts
    if dive.control_state[-1] == "surface":
        depths_m = [sample.depth_m for sample in dive.plant.course]
        assert depths_m[-1] < depths_m[-6] - 0.02, "and it rises"


@pytest.mark.parametrize(("cause", "action"), [cell if cell in FAST_CELLS else slow(*cell) for cell in CELLS], ids=str)
def test_cell_in_simulation(cause: str, action: str) -> None:
    check_cell("sim", cause, action)


@pytest.mark.usefixtures("emulators")
@pytest.mark.parametrize(("cause", "action"), CELLS, ids=str)
def test_cell_at_pins_of_emulated_board(cause: str, action: str) -> None:
    check_cell("emulated", cause, action)


def test_table_is_shown_at_start_of_run() -> None:
    lines = prepare(Request("urov_heading_hold")).start_lines()
    assert all(line.startswith("failsafe  ") for line in lines)
    assert [sum(cause in line for line in lines) for cause in CAUSES] == [1] * len(CAUSES)


def test_rearm_resumes_once_and_only_within_limit() -> None:
    late = Dive("sim", "line_lost", False, {"line_lost": REARM})
    assert late.control_state[-1] == "pilot"
    from snr_sim_robot_urov.controls import Controls
    from snr_sim_robot_urov.failsafe_monitor import FailsafeLimits, FailsafeMonitor
    from snr_sim_robot_urov.failsafes import Failsafes, Rearm

    failsafe = FailsafeMonitor(FailsafeLimits(), Failsafes(line_lost=Rearm(5.0), overloaded=Rearm(1.0)))
    now_s = 0.0

    def control_state_after(seconds: float, state: str, overloaded: str = "") -> str:
        nonlocal now_s
        for _ in range(round(20 * seconds)):
            now_s += 0.05
            failsafe.on_controls(Controls(round(20 * now_s), is_armed=True), now_s)
            failsafe.update_cause("overloaded", overloaded, now_s)
            failsafe.update_outputs(state, now_s)
            control_state = failsafe.control_state(now_s)
        return control_state

    assert control_state_after(1.0, "active") == "pilot"
    for after in ("pilot", "idle"):
        failsafe.mark_outputs_lost(False, "nothing answers", False, now_s)
        assert control_state_after(1.0, "error") == "idle"
        control_state_after(1.0, "inactive")
        assert control_state_after(1.0, "active") == after
    failsafe.on_controls(Controls(10**6), now_s + 0.05)
    failsafe.on_controls(Controls(10**6 + 1, is_armed=True), now_s + 0.1)
    now_s += 1.0
    assert control_state_after(0.5, "active") == "pilot", "a person has disarmed and armed"
    failsafe.mark_outputs_lost(False, "emergency stop", True, now_s)
    assert control_state_after(3.0, "inactive") == "idle", "who stopped it is a person, and so is who starts it again"
    failsafe.on_controls(Controls(10**6 + 2), now_s + 1.0)
    now_s += 2.0
    assert control_state_after(0.5, "active", "late") == "neutral"
    assert control_state_after(1.0, "active", "late") == "neutral"
    assert control_state_after(1.0, "active") == "neutral", "it took longer than a second"


def test_second_loss_of_outputs_waits_for_a_person_from_its_own_start() -> None:
    from snr_sim_robot_urov.controls import Controls
    from snr_sim_robot_urov.failsafe_monitor import FailsafeLimits, FailsafeMonitor
    from snr_sim_robot_urov.failsafes import Failsafes

    failsafe = FailsafeMonitor(FailsafeLimits(hold_s=60.0), Failsafes(line_lost="hold", no_rearm_s=10.0))
    states = []
    for lost_s in (1.0, 31.0):
        failsafe.mark_outputs_lost(False, "nothing answers", False, lost_s)
        for now_s, state in ((lost_s + 0.5, "error"), (lost_s + 1.0, "inactive"), (lost_s + 2.0, "active")):
            failsafe.on_controls(Controls(round(10 * now_s), is_armed=True), now_s)
            failsafe.update_outputs(state, now_s)
            states.append(failsafe.control_state(now_s))
    assert states == ["idle", "neutral", "hold"] * 2


def test_repeated_number_of_controls_does_not_count_as_newer() -> None:
    from snr_sim_robot_urov.controls import Controls
    from snr_sim_robot_urov.failsafe_monitor import FailsafeLimits, FailsafeMonitor

    failsafe = FailsafeMonitor(FailsafeLimits())
    failsafe.on_controls(Controls(5, is_armed=True), 1.0)
    failsafe.on_controls(Controls(5, is_armed=True, surge=1.0), 1.2)
    assert (failsafe.controls.surge, failsafe.controls_s) == (0.0, 1.0)
