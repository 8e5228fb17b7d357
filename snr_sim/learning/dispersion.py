"""Physical parameters of a plant in an episode: nominal, scaled by given factors, or drawn around the nominal values.

The parameters that a robot knows of itself stay nominal (`run.robot.parameters`). So a policy that is trained here
learns to control a body that differs from its data sheet.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from snr_sim.prelude.errors import ParameterError, UnknownNameError, suggest

MIN_FACTOR, MAX_FACTOR = 0.5, 2.0
MAX_DISPERSION = 0.5  # so that no factor is less than the least


def factors_of(options: Mapping[str, Any], names: Sequence[str], rng: np.random.Generator) -> dict[str, float]:
    """Return what a plant's numbers are multiplied by in an episode, by name; empty if it is nominal.

    Args:
        options: of `reset`. {"factors": {"thrust_n": 0.95}} is that; {"dispersion": {"thrust_n": 0.05}} draws the
            factor evenly from 0.95 to 1.05.
        names: of the numbers of the plant that can be scaled.
        rng: what draws; in the order of `names`, whatever order they are given in.

    Raises:
        UnknownNameError: the plant has no such number.
        ParameterError: a factor is not a number from 0.5 to 2, a dispersion not one from 0 to 0.5, or a name has both.

    >>> factors_of({"factors": {"thrust_n": 0.9}}, ("thrust_n", "gravity_mps2"), np.random.default_rng(1))
    {'thrust_n': 0.9}
    """
    given = _checked(options, "factors", names, MIN_FACTOR, MAX_FACTOR)
    spread = _checked(options, "dispersion", names, 0.0, MAX_DISPERSION)
    both = sorted(given.keys() & spread.keys())
    if both:
        raise ParameterError(f"'{both[0]}' is in factors and in dispersion.", fix="in one of them.")
    drawn = {name: 1.0 + spread[name] * float(rng.uniform(-1.0, 1.0)) for name in names if name in spread}
    return {name: {**given, **drawn}[name] for name in names if name in given or name in drawn}


def _checked(
    options: Mapping[str, Any], option: str, names: Sequence[str], min_value: float, max_value: float
) -> dict[str, float]:
    """Return an option's numbers by name."""
    numbers = options.get(option, {})
    example = f'options={{"{option}": {{"{names[0]}": {0.95 if option == "factors" else 0.05}}}}}' if names else "none"
    if not isinstance(numbers, Mapping):
        raise ParameterError(f"reset() was given {option}={numbers!r}, which is not a dict.", fix=f"{example}.")
    for name, value in numbers.items():
        if name not in names:
            raise UnknownNameError(f"This plant has no '{name}' to scale by {option}.", fix=suggest(str(name), names))
        is_number = isinstance(value, (int, float, np.number)) and not isinstance(value, bool) and math.isfinite(value)
        if not (is_number and min_value <= value <= max_value):
            raise ParameterError(
                f"reset() was given {option} with '{name}': {value!r}.",
                fix=f"a number from {min_value:g} to {max_value:g}.",
            )
    return {name: float(value) for name, value in numbers.items()}
