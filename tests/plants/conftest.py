import importlib.util
import sys
from pathlib import Path

import pytest

from snr_sim.plants.lander.module import LunarModule

PARAMETERS = Path(__file__).parents[2] / "robots" / "lander" / "parameters.py"


@pytest.fixture(scope="session")
def apollo() -> LunarModule:
    """The lunar module as the robot describes it."""
    spec = importlib.util.spec_from_file_location("lander_parameters_for_plants", PARAMETERS)
    assert spec is not None
    assert spec.loader is not None
    parameters = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = parameters  # dataclasses look up their module there
    spec.loader.exec_module(parameters)
    return parameters.APOLLO
