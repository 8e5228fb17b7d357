"""A config is checked when it is created."""

from typing import Any

import pytest

from snr_sim import Config, Mode, Node
from snr_sim.core.reload.watch import with_watch
from snr_sim.prelude.errors import ConfigError, UnknownNameError
from snr_sim.testing.function_components import FunctionEndpointFactory

FACTORY = FunctionEndpointFactory()
NO_ROLES = r"no roles(.|\n)*Config\(factories="
NO_MODE = r"with the mode(.|\n)*debug, deployed, test"
NO_LIST = r"role 'robot'(.|\n)*a list"


@pytest.mark.parametrize(
    ("mode", "factories", "message"),
    [
        (Mode.DEPLOYED, None, NO_ROLES),
        (Mode.DEPLOYED, {}, NO_ROLES),
        ({"robot": [FACTORY]}, None, "factories="),
        *((mode, {"robot": []}, NO_MODE) for mode in ("nonsense", None, 3, ["debug"])),
        (Mode.TEST, [FACTORY], r"factories are a list(.|\n)*a dict"),
        *((Mode.TEST, {"robot": components}, NO_LIST) for components in (FACTORY, "abc", None)),
    ],
)
def test_wrong_config_raises_config_error(mode: Any, factories: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Config(mode, factories)


def test_a_mode_may_be_given_as_its_word() -> None:
    assert Config("debug", {"robot": []}).mode is Mode.DEBUG  # type: ignore[arg-type]


def test_non_text_role_raises_unknown_name() -> None:
    with pytest.raises(UnknownNameError, match=r"None is not the name of a role(.|\n)*robot"):
        Node(None, Config(factories={"robot": []}))  # type: ignore[arg-type]


def test_a_node_without_its_config_says_where_it_belongs() -> None:
    with pytest.raises(ConfigError, match=r"Node\('robot', ...\) got a dict(.|\n)*Config\(factories="):
        Node("robot", {"robot": []})  # type: ignore[arg-type]


def test_a_config_keeps_its_own_lists() -> None:
    mine = [FunctionEndpointFactory()]
    config = Config(factories={"robot": mine})
    mine.clear()
    assert len(config.get("robot")) == 1
    assert Config(factories={"other": []}).get("other") == []


def test_an_unknown_role_names_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'robot'"):
        Config(factories={"robot": []}).get("robto")


def test_only_debug_mode_profiles() -> None:
    assert Config(Mode.DEBUG, {"r": []}).get_profiler() is not None
    assert Config(Mode.DEPLOYED, {"r": []}).get_profiler() is None


def test_a_factory_keeps_its_own_reload_targets() -> None:
    FunctionEndpointFactory().reload_targets.append(pytest)
    assert FunctionEndpointFactory().reload_targets == []


def test_the_bounds_of_a_run_outlast_what_is_put_beside_its_components() -> None:
    config = Config(factories={"robot": []}, max_tasks_per_moment=7, stall_limit_s=3.0)
    assert with_watch(config).bounds == config.bounds == {"max_tasks_per_moment": 7, "stall_limit_s": 3.0}
