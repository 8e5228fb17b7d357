"""A config is checked when it is created."""

from typing import Any

import pytest

from snr_sim import Config, Mode, Node
from snr_sim.core.reload.watch import with_watch
from snr_sim.prelude.errors import ConfigError, UnknownNameError
from snr_sim.testing.function_components import FunctionEndpointFactory


@pytest.mark.parametrize("factories", [None, {}])
def test_a_config_without_roles_is_refused(factories: Any) -> None:
    with pytest.raises(ConfigError, match=r"no roles(.|\n)*Config\(factories="):
        Config(factories=factories)


def test_factories_given_where_the_mode_belongs_are_noticed() -> None:
    with pytest.raises(ConfigError, match="factories="):
        Config({"robot": [FunctionEndpointFactory()]})  # type: ignore[arg-type]


@pytest.mark.parametrize("mode", ["nonsense", None, 3, ["debug"]])
def test_a_mode_that_does_not_exist_is_refused(mode: Any) -> None:
    with pytest.raises(ConfigError, match=r"with the mode(.|\n)*debug, deployed, test"):
        Config(mode, {"robot": []})


def test_a_mode_may_be_given_as_its_word() -> None:
    assert Config("debug", {"robot": []}).mode is Mode.DEBUG  # type: ignore[arg-type]


def test_non_dict_factories_raise_config_error() -> None:
    with pytest.raises(ConfigError, match=r"factories are a list(.|\n)*a dict"):
        Config(Mode.TEST, [FunctionEndpointFactory()])  # type: ignore[arg-type]


def test_non_text_role_raises_unknown_name() -> None:
    with pytest.raises(UnknownNameError, match=r"None is not the name of a role(.|\n)*robot"):
        Node(None, Config(factories={"robot": []}))  # type: ignore[arg-type]


def test_a_node_without_its_config_says_where_it_belongs() -> None:
    with pytest.raises(ConfigError, match=r"Node\('robot', ...\) got a dict(.|\n)*Config\(factories="):
        Node("robot", {"robot": []})  # type: ignore[arg-type]


@pytest.mark.parametrize("components", [FunctionEndpointFactory(), "abc", None])
def test_a_role_is_a_list_of_factories(components: Any) -> None:
    with pytest.raises(ConfigError, match=r"role 'robot'(.|\n)*a list"):
        Config(factories={"robot": components})


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
