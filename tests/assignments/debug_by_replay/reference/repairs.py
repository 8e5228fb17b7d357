"""Makes the repairs of findings.toml in the code that failed. Do not change this file."""

import tomllib
from pathlib import Path
from types import ModuleType

from snr_sim.prelude.errors import ConfigError

HERE = Path(__file__).parent


def findings():
    """Return the findings in findings.toml: a list of dicts."""
    try:
        document = tomllib.loads((HERE / "findings.toml").read_text())
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"findings.toml cannot be read: {error}.", fix="keep its form; edit only the text in quotes."
        ) from error
    found = document.get("finding")
    if not isinstance(found, list) or len(found) != 3:
        raise ConfigError("findings.toml does not have three findings.", fix="three times [[finding]].")
    return found


def repaired(numbers):
    """Return the code with the repairs of these findings, 1 to 3; one that is still empty repairs nothing."""
    source = (HERE / "failed.py").read_text()
    lines = source
    found = findings()
    for number in numbers:
        was, instead = (str(found[number - 1].get(name, "")).strip("\n") for name in ("was", "instead"))
        if not was.strip():
            continue
        if source.count(was) != 1:
            raise ConfigError(
                f"findings.toml, finding {number}: the text in `was` occurs {source.count(was)} times in failed.py.",
                fix="copy the whole line from failed.py, with the spaces before it.",
            )
        lines = lines.replace(was, instead)
    return lines


def factories_with(robot, numbers):
    """Return what makes the components of the code with these repairs."""
    module = ModuleType("failed_and_repaired")
    exec(compile(repaired(numbers), str(HERE / "failed.py"), "exec"), module.__dict__)
    return module.factories(robot)
