"""Contract checks of sensors, actuators and plants. Run them over all of yours.

Each check raises an AssertionError whose message names the broken rule.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import msgspec

from snr_sim.prelude.device import Actuator, Device, Sensor, Stale
from snr_sim.prelude.errors import CommandError, SensorLostError, SnrError
from snr_sim.prelude.interfaces import implements
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.values import decode_value, encode_value

_STEPS = 25
_DEFAULT_STEP_S = 0.01
_SHAPES = {
    "polyline": {"points_m", "rgb", "radius_m"},
    "mesh": {"vertices_m", "triangles", "rgb"},
    "box": {"half_size_m", "center_m", "rgb"},
    "heightfield": {"corner_m", "spacing_m", "shape", "heights_m", "rgb"},
}
_TETHER = {"anchor_m", "body", "place_m", "length_m"}


def check_sensor(open_sensor: Callable[[], Sensor[Any]]) -> None:
    """Check a sensor: its life cycle, readings that are frozen, stamped and finite, and that it can be opened again.

    Args:
        open_sensor: opens one that has readings to give.
    """
    for _ in range(2):
        sensor = open_sensor()
        require(implements(sensor, Sensor), f"{sensor!r} lacks read() or a step of the life cycle: see LifeCycle")
        _start(sensor)
        before_s = -math.inf
        for _ in range(3):
            reading = sensor.read()
            require(reading is not None, "read() returned None; it returns Stale when there is no reading")
            require(not isinstance(reading, Stale), f"one that has readings returned {reading}")
            before_s = _check_reading(reading, before_s)
        _end(sensor)
        try:
            reading = sensor.read()
        except SensorLostError:
            continue
        raise AssertionError(
            f"Contract violated: read() after close() raises SensorLostError, but returned {reading!r}."
        )


def check_actuator(open_actuator: Callable[[], Actuator[Any]], a_command: Any) -> None:
    """Check an actuator: clamps to its limits, rejects NaN and infinity, neutral at any time.

    Args:
        open_actuator: opens one.
        a_command: a valid command, inside the limits.
    """
    actuator = open_actuator()
    require(
        implements(actuator, Actuator),
        f"{actuator!r} lacks one of command_type, limits, write, neutral, or a step of the life cycle: see LifeCycle",
    )
    _check_struct(a_command, "a command")
    expected, given = actuator.command_type.__name__, type(a_command).__name__
    require(type(a_command) is actuator.command_type, f"the actuator takes {expected}, the command is a {given}")
    limits = actuator.limits
    numbers = _numbers(a_command)
    require(set(limits) >= set(numbers), f"limits {sorted(limits)} leave out a field of {sorted(numbers)}")
    _start(actuator)
    actuator.neutral()
    _check_inside(actuator.write(a_command), limits)
    for name in numbers:
        lowest, highest = limits[name]
        require(math.isfinite(lowest) and math.isfinite(highest) and lowest <= highest, f"limits of {name}: {limits}")
        for value in (lowest - 1.0, highest + 1.0, -1e300, 1e300):
            _check_inside(actuator.write(_with(a_command, name, value)), limits)
        for value in (math.nan, math.inf, -math.inf):
            _check_refused(actuator, _with(a_command, name, value), name)
    actuator.neutral()
    actuator.neutral()
    _end(actuator)
    actuator.neutral()


def check_plant(make_plant: Callable[[], Plant], commands: Mapping[str, Any] | None = None) -> None:
    """Check a plant: reproducibility by seed, snapshots, time, names, outputs, and rejection of NaN.

    Args:
        make_plant: creates a new one.
        commands: a valid command for each of its inputs, so that it is also checked with commands applied.
    """
    plant = make_plant()
    require(implements(plant, Plant), f"{type(plant).__name__} lacks a member of Plant")
    require(bool(plant.engine), "engine names the physics")
    require(plant.step_s is None or plant.step_s > 0, f"step_s is {plant.step_s}")
    for name, names in (("inputs", plant.inputs), ("outputs", plant.outputs)):
        require(isinstance(names, tuple) and len(set(names)) == len(names), f"{name} is {names!r}")
    require(set(commands or {}) <= set(plant.inputs), f"commands for {list(commands or {})}, inputs {plant.inputs}")
    _check_time(plant)
    _check_shown(plant)
    _check_same_bits(plant, make_plant(), commands or {})
    _check_unobserved(plant, make_plant(), commands or {})
    _check_snapshot(plant, commands or {})
    for name, command in (commands or {}).items():
        _check_nan(plant, name, command)


def _start(device: Device) -> None:
    """Configure and activate a device, each twice."""
    for step, state in ((device.configure, "inactive"), (device.activate, "active")):
        step()
        step()
        require(device.health().state == state, f"after {step.__name__}() the state is {device.health()}")


def _end(device: Device) -> None:
    """Deactivate and close a device, each twice, and once more."""
    for _ in range(2):
        device.deactivate("checked")
        require(device.health().state == "inactive", f"after deactivate() the state is {device.health()}")
    for _ in range(2):
        device.close()
        require(device.health().state == "closed", f"after close() the state is {device.health()}")
    device.deactivate("checked")


def require(condition: bool, message: str) -> None:
    """Raise an AssertionError if a rule is broken."""
    if not condition:  # not an assert statement: those go with -O
        raise AssertionError(f"Contract violated: {message}.")


def _check_struct(value: Any, what: str) -> None:
    is_struct = isinstance(value, msgspec.Struct)
    require(is_struct, f"{what} is a msgspec Struct, not {value!r}")
    require(bool(type(value).__struct_config__.frozen), f"{type(value).__name__} is frozen")


def _check_reading(reading: Any, before_s: float) -> float:
    """Return when a reading was measured: not before the previous one; all its fields must be numbers."""
    _check_struct(reading, "a reading")
    stamp_s = getattr(reading, "stamp_s", None)
    name = type(reading).__name__
    if not (isinstance(stamp_s, float) and math.isfinite(stamp_s)):
        raise AssertionError(f"Contract violated: {name}.stamp_s must be a finite time in seconds, not {stamp_s!r}.")
    require(stamp_s >= before_s, f"a {name} of {stamp_s} s came after one of {before_s} s")
    for field in reading.__struct_fields__:
        value = getattr(reading, field)
        require(all(map(math.isfinite, _flat(value))), f"{name}.{field} is {value!r}, which is not finite: Stale is")
    return stamp_s


def _numbers(command: Any) -> dict[str, list[float]]:
    """Return the fields that are limited: numbers, and lists of numbers, which are limited one by one."""
    values = msgspec.structs.asdict(command)
    values.pop("until_s", None)  # the end of its lease
    return {
        name: list(value) if isinstance(value, (list, tuple)) else [value]
        for name, value in values.items()
        if isinstance(value, (float, list, tuple))
    }


def _with(command: Any, name: str, value: float) -> Any:
    """Return the command with this value in one field; in a list, as its first number."""
    before = getattr(command, name)
    after = type(before)([value, *before[1:]]) if isinstance(before, (list, tuple)) else value
    return msgspec.structs.replace(command, **{name: after})


def _check_inside(applied: Any, limits: Mapping[str, tuple[float, float]]) -> None:
    for name, values in _numbers(applied).items():
        lowest, highest = limits[name]
        for value in values:
            require(lowest <= value <= highest, f"'{name}' = {value} was applied, limits are {lowest} .. {highest}")


def _check_refused(actuator: Actuator[Any], command: Any, name: str) -> None:
    try:
        applied = actuator.write(command)
    except CommandError:
        return
    raise AssertionError(f"Contract violated: '{name}' = {getattr(command, name)} was applied as {applied!r}.")


def _check_time(plant: Plant) -> None:
    plant.reset(0)
    require(plant.time_s == 0.0, f"time_s is {plant.time_s} after reset")
    dt_s = plant.step_s or _DEFAULT_STEP_S
    for i in range(_STEPS):
        before_s = plant.time_s
        plant.step(dt_s)
        moved_s = plant.time_s - before_s
        require(abs(moved_s - dt_s) < 1e-9, f"step {i} of {dt_s} s moved time by {moved_s} s")


def _check_same_bits(one: Plant, other: Plant, commands: Mapping[str, Any]) -> None:
    for plant in (one, other):
        plant.reset(3)
    at_start = _state(one)
    _same(at_start, _state(other), "two plants with one seed start alike")
    for plant in (one, other):
        _go(plant, commands)
    _same(_state(one), _state(other), "same seed, same commands, same steps: same bits")
    one.reset(4)
    _go(one, commands)
    one.reset(3)
    _same(at_start, _state(one), "reset(3) after use puts everything back")
    _go(one, commands)
    _same(_state(one), _state(other), "nothing of the run before survives reset(3)")


def _check_unobserved(one: Plant, other: Plant, commands: Mapping[str, Any]) -> None:
    """Check that a plant whose truth is recorded and whose outputs are read goes where one goes that is left alone."""
    for plant in (one, other):
        plant.reset(3)
        for name, command in commands.items():
            plant.write(name, command)
    for _ in range(_STEPS):
        for plant in (one, other):
            plant.step(plant.step_s or _DEFAULT_STEP_S)
        one.truth()
        seen = _readings(one)
    _same(seen, _readings(other), "truth() and read() change no output")
    _same(_state(one), _state(other), "truth() and read() change no motion")


def _check_snapshot(plant: Plant, commands: Mapping[str, Any]) -> None:
    plant.reset(5)
    _go(plant, commands)
    at_snapshot = _state(plant)
    snapshot = plant.snapshot()
    _same(at_snapshot, _state(plant), "snapshot() changes nothing")
    _go(plant, commands)
    after = _state(plant)
    for turn in ("once", "twice"):
        plant.restore(snapshot)
        _same(at_snapshot, _state(plant), f"restored {turn}, a plant is as it was")
        _go(plant, commands)
        _same(after, _state(plant), f"restored {turn}, the same steps give the same bits")


def _check_shown(plant: Plant) -> None:
    scene, truth = plant.scene(), plant.truth()
    for what, value in (("scene()", scene), ("truth()", truth)):
        require(decode_value(encode_value(value)) == value and b'"$":' not in encode_value(value), f"{what} is JSON")
    require(set(scene) - {"tethers", "is_planar"} == {"statics", "bodies"}, f"scene() has the keys {sorted(scene)}")
    for shape in [*scene["statics"].values(), *(shape for body in scene["bodies"].values() for shape in body)]:
        expected = _SHAPES.get(shape.get("kind"), set())
        require(expected != set() and expected <= set(shape), f"a shape has {sorted(expected)}, not {shape!r:.200}")
    for name, tether in scene.get("tethers", {}).items():
        require(set(tether) == _TETHER, f"tether '{name}' has {sorted(_TETHER)}, not {sorted(tether)}")
        require(tether["body"] in scene["bodies"], f"tether '{name}' ends at no body of scene()")
    require(set(truth) == {"poses", "vectors", "values"}, f"truth() has the keys {sorted(truth)}")
    for name, pose in truth["poses"].items():
        require(name in scene["bodies"], f"truth() has a pose of '{name}', which scene() does not show")
        require(len(pose) == 7 and abs(math.hypot(*pose[3:]) - 1.0) < 1e-6, f"pose of '{name}' is {pose}")
    for name, arrow in truth["vectors"].items():
        require(len(arrow) == 6, f"arrow '{name}' is {arrow}")
    require(all(isinstance(value, (int, float)) for value in truth["values"].values()), "values are numbers")
    for name in plant.outputs:
        _check_struct(plant.read(name), f"output '{name}'")


def _check_nan(plant: Plant, name: str, command: Any) -> None:
    for field in _numbers(command):
        plant.reset(0)
        try:
            plant.write(name, _with(command, field, math.nan))
            _go(plant, {})
        except (SnrError, ValueError):
            continue  # refused, which is as good
        for value in _flat(plant.truth()):
            require(math.isfinite(value), f"after '{name}.{field}' = NaN the state is no longer finite")


def _go(plant: Plant, commands: Mapping[str, Any]) -> None:
    for name, command in commands.items():
        plant.write(name, command)
    for _ in range(_STEPS):
        plant.step(plant.step_s or _DEFAULT_STEP_S)


def _state(plant: Plant) -> bytes:
    """All that can be seen of a plant, with every bit of every float."""
    return encode_value([plant.time_s, plant.truth()]) + _readings(plant)


def _readings(plant: Plant) -> bytes:
    """All outputs of a plant, with every bit of every float."""
    return encode_value({name: msgspec.to_builtins(plant.read(name)) for name in plant.outputs})


def _same(one: bytes, other: bytes, rule: str) -> None:
    require(one == other, f"{rule}\n  {one.decode()}\n  {other.decode()}")


def _flat(value: Any) -> Iterable[float]:
    if isinstance(value, Mapping):
        value = list(value.values())
    if hasattr(value, "tolist"):  # arrays and numbers of numpy
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        for item in value:
            yield from _flat(item)
    elif isinstance(value, (int, float)):
        yield value
