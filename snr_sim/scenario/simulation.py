"""A scenario, ready to run: robot, plant and controller.

`prepare` finds and loads everything and writes nothing: errors in a request are reported before the run.
`snr run`, `snr replay`, learning and grading all start here; `simulation_run.py` runs it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import ModuleType
from typing import Any

from snr_sim.core.config import AnyFactory, Config, Mode
from snr_sim.core.source_location import short_path
from snr_sim.devices.commands import ActuatorLoopFactory
from snr_sim.devices.wire.serial_port import check_port
from snr_sim.prelude.errors import ConfigError, MissingExtraError, TraceError, UnknownNameError, suggest
from snr_sim.prelude.interfaces import implements
from snr_sim.prelude.io import BENCH, ON_SERIAL_PORTS, parse_io
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.rng import rng_for
from snr_sim.prelude.scenario import RobotContext, RobotInfo
from snr_sim.recording.folder import new_header, trace_path
from snr_sim.recording.reader import read_trace
from snr_sim.recording.recorded_run import RecordedRun
from snr_sim.recording.records import Header, TraceInfo, name_of
from snr_sim.recording.sources import sha256_of
from snr_sim.scenario import library
from snr_sim.scenario.options import check_options
from snr_sim.scenario.student_calls import call_student, factories_of


@dataclass(frozen=True)
class Request:
    """Request for a run; None means the scenario's default, and so does no text for `io`."""

    scenario: str
    seed: int = 0
    engine: str | None = None
    controller: str | None = None
    role: str | None = None
    io: str = ""
    options: dict[str, str] = field(default_factory=dict)


class Simulation:
    """One scenario with one controller, loaded and checked.

    Args:
        request: the request, with all defaults filled in.
        scenario, robot, controller: the loaded files.
        used: their files, for the header.
        standard: the scenario's own controller, for the first role, if `controller` has no components for it.
    """

    def __init__(
        self,
        request: Request,
        scenario: ModuleType,
        robot: ModuleType,
        controller: ModuleType,
        used: Sequence[library.UsedSources],
        standard: ModuleType | None = None,
    ) -> None:
        self.request: Request = request
        self.scenario: ModuleType = scenario
        self.robot_file: ModuleType = robot
        self._controller = controller
        self._standard = standard
        self.notes: list[str] = []  # from its construction, for the run's result
        self._used = used
        self._recorded: RecordedRun | None = None
        self._read_elsewhere: Callable[[], Mapping[str, Path]] = dict
        self.robot: RobotInfo = RobotInfo(
            name=scenario.ROBOT,
            role=robot.ROLES[0],
            scenario=request.scenario,
            engine=request.engine or "",
            parameters=call_student(scenario.parameters, "parameters(seed)", request.seed),
            options=request.options,
        )

    @property
    def scenario_name(self) -> str:
        """The scenario's name, also if it was given as a path."""
        return Path(self.request.scenario).stem

    @property
    def controller_path(self) -> Path:
        """The controller's file."""
        return Path(str(self._controller.__file__))

    @property
    def all_roles(self) -> tuple[str, ...]:
        """The robot's roles, or those of them that the scenario lists as ROLES."""
        roles: tuple[str, ...] = getattr(self.scenario, "ROLES", self.robot_file.ROLES)
        return roles

    @property
    def roles(self) -> list[str]:
        """The roles that run: the requested one, or all."""
        return [self.request.role] if self.request.role else list(self.all_roles)

    @property
    def is_standalone(self) -> bool:
        """Whether one role runs by itself, on the wall clock: one of several, or the only one with real devices."""
        return not self.has_plant or (self.request.role is not None and len(self.all_roles) > 1)

    @property
    def has_plant(self) -> bool:
        """Whether any of the devices is simulated."""
        return parse_io(self.request.io).kind != "pi"

    @property
    def is_real_time(self) -> bool:
        """Whether any of the devices has a clock of its own, so that the run is in real time."""
        return parse_io(self.request.io).is_real_time

    def check_hardware(self) -> None:
        """Check that the port in `--io` exists, so that a wrong one is reported before the run.

        Raises:
            DeviceError: it does not exist, or cannot be opened.
        """
        io = parse_io(self.request.io)
        if io.kind in ON_SERIAL_PORTS:
            check_port(io.address.partition(",")[0])  # the settings follow

    def config(
        self, plant: Plant | None, clock_s: Callable[[], float] | None = None, standalone_role: str = ""
    ) -> Config:
        """Return the robot's wiring.

        Args:
            plant: for the simulated devices; None for a replay, where no device is opened.
            clock_s: the clock of the run, if it is not the plant's.
            standalone_role: the role that runs by itself, with links to other processes.

        Raises:
            ConfigError: the controller or the robot does not return factories.
        """
        controller, extra_components = self._factories()
        context = replace(self.context(plant, clock_s, standalone_role), extra_components=extra_components)
        roles = call_student(self.robot_file.roles, "roles(context, controller)", context, controller)
        given = roles if isinstance(roles, dict) else {}
        missing = [role for role in self.roles if not isinstance(given.get(role), (list, tuple))]
        if missing:
            raise ConfigError(
                f"{short_path(str(self.robot_file.__file__))}: roles(context, controller) returned {roles!r}, "
                f"which has no components for the role '{missing[0]}'.",
                fix=f'return {{"{missing[0]}": [...]}} with a list of factories for each of ROLES.',
            )
        for role, factories in extra_components.items():
            if not all(factory in given.get(role, ()) for factory in factories):
                raise ConfigError(
                    f"The robot '{self.robot.name}' has no place for a controller in its role '{role}'.",
                    fix=f'ROLES = ("{self.robot.role}",) in the controller; or in robot.py, put '
                    "context.extra_components there.",
                )
        return Config(Mode.TEST, roles)

    @property
    def judge(self) -> Any:
        """The source of the verdict: the scenario; if sensors read a recorded run, the end of that run."""
        return self._recorded or self.scenario

    def context(
        self, plant: Plant | None, clock_s: Callable[[], float] | None = None, standalone_role: str = ""
    ) -> RobotContext:
        """Return the context in which the robot's file opens its devices; arguments as for `config`."""
        io = parse_io(self.request.io)
        recorded = None if self._recorded is None else self._recorded.pages
        return RobotContext(
            self.robot,
            io.kind,
            self.request.seed,
            plant,
            io.address,
            clock_s,
            recorded=recorded,
            standalone_role=standalone_role,
        )

    def with_seed(self, seed: int) -> Simulation:
        """Return a copy with another seed, without loading files again."""
        request = replace(self.request, seed=seed)
        return Simulation(request, self.scenario, self.robot_file, self._controller, self._used, self._standard)

    def with_controller(
        self,
        controller: ModuleType,
        standard: ModuleType | None,
        request: Request,
        read: Callable[[], Mapping[str, Path]],
    ) -> Simulation:
        """Return a copy with a controller that was loaded elsewhere.

        Args:
            controller: its proxy; has its `factories`, and its OPTIONS and ROLES if it has any.
            standard: the scenario's own controller, if this one has no components for the robot's first role.
            request: with its file, and with a seed and options of its own.
            read: returns the files it was loaded from, for the trace's header, by their names there.
        """
        whole = replace(self.request, seed=request.seed, controller=request.controller, options=request.options)
        other = Simulation(whole, self.scenario, self.robot_file, controller, self._used[:-1], standard)
        other._read_elsewhere = read
        return other

    def _factories(self) -> tuple[list[AnyFactory], dict[str, list[AnyFactory]]]:
        """Return the components of the first role, and those that the controller has for others."""
        self.notes = []
        first, *others = self.robot_file.ROLES
        roles = controlled_roles(self._controller, self.robot_file)
        extra_components = {role: self._create_components(self._controller, role) for role in others if role in roles}
        controller = self._controller if self._standard is None else self._standard
        return self._create_components(controller, first), extra_components

    def _create_components(self, controller: Any, role: str) -> list[AnyFactory]:
        made = factories_of(controller, replace(self.robot, role=role))
        place = short_path(str(controller.__file__))
        if not made:
            whom = "the robot" if role == self.robot.role else f"its role '{role}'"
            self.notes.append(f"{place}: factories(robot) returned [], so no component controls {whom}.")
        return made

    def start_lines(self) -> list[str]:
        """Return the lines that the controller of the first role prints before a run.

        Raises:
            ConfigError: its `start_lines` did not return lines of text, or raised.
        """
        controller = self._controller if self._standard is None else self._standard
        function = getattr(controller, "start_lines", None)
        lines = [] if function is None else call_student(function, "start_lines(robot)", self.robot)
        if not (isinstance(lines, (list, tuple)) and all(isinstance(line, str) for line in lines)):
            place = short_path(str(controller.__file__))
            raise ConfigError(f"{place}: start_lines(robot) returned {lines!r}.", fix='a list of texts: ["..."].')
        return list(lines)

    def plant(self) -> Plant:
        """Return the plant in the initial state for the seed; with `--io replay:RUN`, the recorded run as a plant.

        Raises:
            ConfigError: the scenario or the robot does not return a plant.
            TraceError: the recorded run cannot be read, or is of another robot.
        """
        io = parse_io(self.request.io)
        if io.kind == "replay":
            trace = read_trace(trace_path(Path(io.address)))
            if trace.header.robot != self.robot.name:
                raise TraceError(
                    f"{Path(io.address)} is a run of the robot '{trace.header.robot}', not of '{self.robot.name}'.",
                    fix=f"name one of '{self.robot.name}'.",
                )
            self._recorded = RecordedRun(trace)
            return self._recorded
        fix = "end it with: return Lander1D(...), or another class that implements `Plant`."
        seed, engine = self.request.seed, self.request.engine
        plant = _plant_of(self.scenario, "plant(seed, engine)", fix, seed, engine)
        if getattr(self.robot_file, "wrap_plant", None) is None:
            return plant
        # This row of the robot's device table puts a part between devices and plant.
        fix = "return context.plant where nothing stands between devices and plant."
        return _plant_of(self.robot_file, "wrap_plant(context)", fix, self.context(plant))

    def header(self, plant: Plant | None, config: Config, clock: str = "sim") -> Header:
        """Return the second line of this run's trace: what runs. `plant` is None for a role without a body."""
        return new_header(
            self.roles,
            commands_of(self.roles, config),
            scenario=name_of(self.request.scenario),
            robot=self.robot.name,
            controller=name_of(self.request.controller or ""),
            engine="" if plant is None else f"{self.request.engine}: {plant.engine}",
            io=self.request.io,
            seed=self.request.seed,
            options=self.request.options,
            clock=clock,
            sources=self.sources(),
            scene={} if plant is None else plant.scene(),
        )

    def trace_info(self) -> TraceInfo:
        """Return the first line of this run's trace: where and when."""
        return TraceInfo.now(self.request.scenario, self.request.controller or "")

    def files(self) -> dict[str, Path]:
        """Return every file of scenario, robot and controller that is in use, and each that an option names, such as a
        learned policy, by `option/<key>`."""
        elsewhere = dict(self._read_elsewhere())
        for key, value in self.request.options.items():
            if Path(value).is_absolute() and os.path.isfile(value):  # not a pipe, whose open would block
                elsewhere[library.OPTION_FILE + key] = Path(value)
        return {**library.files_in_use(self._used), **elsewhere}

    def sources(self) -> dict[str, str]:
        """Return the sha256 of these files."""
        return {name: sha256_of(path) for name, path in sorted(self.files().items())}


def prepare(
    request: Request, load: Callable[[library.FoundItem, str], ModuleType] = library.load_controller
) -> Simulation:
    """Find, load and check everything a request names.

    Args:
        request: the request.
        load: loads a controller of the robot that was found.

    Raises:
        UnknownNameError: scenario, robot, controller, engine, io or an option is not known.
        ParameterError: a setting of io is not valid.
        ConfigError: one of the files is not valid.
    """
    _check_numpy(request)
    scenario_found = library.find("scenarios", request.scenario)
    robot_found = library.find("robots", library.robot_of_scenario(scenario_found))
    robot = library.load_robot(robot_found)
    scenario = library.load_scenario(scenario_found)
    engine = request.engine or scenario.ENGINES[0]
    if engine not in scenario.ENGINES:
        raise UnknownNameError(
            f"Scenario '{scenario_found.name}' does not run on engine '{engine}'.",
            fix=suggest(engine, scenario.ENGINES),
        )
    # What a scenario is about may need devices that are more than simulated values.
    rows = getattr(scenario, "IO", robot.IO)
    request = replace(request, io=request.io or ("sim" if "sim" in rows else rows[0]))
    io = parse_io(request.io)
    if io.kind in BENCH:
        from snr_sim.devices.device_strings import check_io  # its import takes 60 ms and no simulation needs it

        check_io(io)
    if io.kind not in robot.IO:
        raise UnknownNameError(
            f"Robot '{robot_found.name}' has no devices for --io {request.io}.", fix=suggest(request.io, robot.IO)
        )
    if io.kind not in rows:
        raise UnknownNameError(
            f"Scenario '{scenario_found.name}' does not run with --io {request.io}.", fix=suggest(request.io, rows)
        )
    if request.io == "pi" and request.role is None and len(robot.ROLES) > 1:
        raise UnknownNameError(
            f"With --io pi each role of robot '{robot_found.name}' runs by itself, where its devices are.",
            fix=f"--role {robot.ROLES[0]} on the vehicle, and --role {robot.ROLES[-1]} where the pilot is.",
        )
    if io.kind in ("emulated", "pty") and request.role is not None and len(robot.ROLES) > 1:
        raise UnknownNameError(
            f"--io {io} emulates devices next to the whole simulated robot, not next to one role that runs by itself.",
            fix=f"leave out --role {request.role}.",
        )
    if request.role is not None and request.role not in robot.ROLES:
        raise UnknownNameError(
            f"Robot '{robot_found.name}' has no role '{request.role}'.", fix=suggest(request.role, robot.ROLES)
        )
    roles = getattr(scenario, "ROLES", robot.ROLES)
    if request.role is not None and request.role not in roles:
        raise UnknownNameError(
            f"Role '{request.role}' has nothing to do in scenario '{scenario_found.name}'.",
            fix=suggest(request.role, roles),
        )
    controller_name = request.controller or scenario.CONTROLLER
    controller = load(robot_found, controller_name)
    check_options(request.options, robot, controller)
    has_first = robot.ROLES[0] in controlled_roles(controller, robot)
    standard = None if has_first else library.load_controller(robot_found, scenario.CONTROLLER)
    is_own = controller_name in library.controllers(robot_found)
    whole = replace(
        request,
        # A file is stored with its path, so that a replay in another folder finds it.
        scenario=scenario_found.name if scenario_found.place != "the path given" else str(scenario_found.path),
        engine=engine,
        controller=controller_name if is_own else str(Path(controller_name).resolve()),
        io=_whole(request.io),
    )
    used = library.used_sources(scenario_found, robot_found, controller)
    if standard is not None:
        file = Path(str(standard.__file__))
        used.append(library.UsedSources("standard", file.parent, file))
    return Simulation(whole, scenario, robot, controller, used, standard)


def _plant_of(file: ModuleType, call: str, fix: str, *args: Any) -> Plant:
    """Return what a function of a file returns, if that is a plant."""
    plant: Plant = call_student(getattr(file, call.partition("(")[0]), call, *args)
    if not implements(plant, Plant):
        place = short_path(str(file.__file__))
        raise ConfigError(f"{place}: {call} returned {plant!r}, which is not a plant.", fix=fix)
    return plant


def controlled_roles(controller: Any, robot: Any) -> tuple[str, ...]:
    """Return the roles that a controller has components for.

    Raises:
        UnknownNameError: one is not a role of the robot.
        ConfigError: its ROLES is not a tuple or list of names, or is empty.
    """
    roles = getattr(controller, "ROLES", robot.ROLES[:1])
    place = short_path(str(controller.__file__))
    if not (isinstance(roles, (tuple, list)) and roles and all(isinstance(role, str) for role in roles)):
        raise ConfigError(
            f"{place}: ROLES is {roles!r}, not a tuple of roles.",
            fix=f'ROLES = ("{robot.ROLES[-1]}",), with the comma.',
        )
    for role in roles:
        if role not in robot.ROLES:
            raise UnknownNameError(f"{place}: the robot has no role '{role}'.", fix=suggest(role, robot.ROLES))
    return tuple(roles)


def _check_numpy(request: Request) -> None:
    """Check that numpy is installed: random numbers of every simulation and thrust allocation of vehicles need it.

    Raises:
        MissingExtraError: it is not.
    """
    try:
        rng_for(request.seed, request.scenario)
    except MissingExtraError:
        if parse_io(request.io).kind == "pi":
            raise MissingExtraError("numpy", "hardware") from None
        raise


def _whole(io: str) -> str:
    """Return the io setting; a recorded run with its path, so that it is found from another folder too."""
    kind, _, where = io.partition(":")
    return f"{kind}:{Path(where).resolve()}" if kind == "replay" else str(parse_io(io))


def request_of(trace_info: TraceInfo, header: Header, controller: str = "") -> Request:
    """Return the request of a recorded run, with another controller if one is given."""
    return Request(
        scenario=trace_info.scenario,
        seed=header.seed,
        engine=header.engine.partition(":")[0],
        controller=controller or trace_info.controller,
        role=header.roles[0] if len(header.roles) == 1 else None,
        io=header.io,
        options=header.options,
    )


def wiring_of_file(name: str, roles: Sequence[str] = ()) -> Config:
    """Return the wiring of a program that was recorded without a scenario: of its Config or of its RoverProcesses.

    Args:
        name: path of its file, with a `config`, a ProcessRunner, or a class for each process.
        roles: of the run.

    Raises:
        ConfigError: the file has none of these.
    """
    module = library.load_program(name)
    config = getattr(module, "config", None)
    if isinstance(config, Config):
        return config
    from snr_sim.scenario.process_wiring import wiring_of_processes  # few programs have processes

    found = wiring_of_processes(module, roles)
    if found is None:
        raise ConfigError(
            f"{name} has no `config` that is a Config.", fix="config = Config(factories={...}) at top level."
        )
    return found


def commands_of(roles: Sequence[str], config: Config) -> dict[str, list[str]]:
    """Return the keys of pages that drive actuators, by role."""
    return {role: [one.key for one in config.get(role) if isinstance(one, ActuatorLoopFactory)] for role in roles}
