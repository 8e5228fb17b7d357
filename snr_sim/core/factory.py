"""Factories of components: classes of their author's own, or made by `Gentle.factory(name="gentle", hover=0.3)`."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import GenericAlias, ModuleType
from typing import TYPE_CHECKING, Any, overload

from snr_sim.prelude.component import Component
from snr_sim.prelude.errors import ConfigError, suggest
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.retired import Retired

_GIVEN = 4  # self, factory, parent, name: the parameters of every component's __init__


@dataclass(frozen=True)
class ShortForm:
    """What a factory that `MyComponent.factory` has made creates: with settings for `__init__`, and as attributes."""

    component_class: type[Any]
    name: str
    init_settings: Mapping[str, Any]
    settings: Mapping[str, Any]


class ComponentFactory:
    """Factory of one component of a node. The factory's own state survives a reload of the component.

    Args:
        reload_targets: modules whose code is read again when the component is reloaded, in this order: list helpers
            first, then the module of the component. Default: the student's own files that define the classes of
            component and factory.
    """

    def __init__(self, reload_targets: ModuleType | Sequence[ModuleType] | None = None) -> None:
        targets = [reload_targets] if isinstance(reload_targets, ModuleType) else reload_targets
        self.reload_targets: list[ModuleType] = list(targets or [])

    # One name with an underscore: a student's factory has any others.
    _short_form: ShortForm | None = None

    reload: Any = Retired(
        "factory.reload", "tasks.reload_component('name') from a handler, or `reload` on the console."
    )

    def __class_getitem__(cls, kind: object) -> GenericAlias:  # AbstractFactory[Endpoint], as the thesis annotates
        return GenericAlias(cls, kind)

    def get(self, parent: NodeApi) -> Component:
        """Return a new component that belongs to the node `parent`."""
        component: Component = self._create(parent, "component")
        return component

    def _create(self, parent: NodeApi, what: str) -> Any:
        """Return a component of `component_class`; a factory without one has a `get` of its own."""
        short = self._short_form
        if short is None:
            raise NotImplementedError(f"{type(self).__name__} needs a method get(self, parent) that returns its {what}")
        return short.component_class(self, parent, short.name, **short.init_settings)


class FactoryOfClass:
    """Descriptor: `MyEndpoint.factory(...)` makes a factory; `self.factory` is the one that made the component."""

    def __init__(self, kind: type[ComponentFactory], component_class: type[Any] = object) -> None:
        self._kind = kind
        self.component_class: type[Any] = component_class

    @overload
    def __get__(self, component: None, owner: type[Any]) -> FactoryOfClass: ...

    @overload
    def __get__(self, component: object, owner: type[Any]) -> Any: ...

    def __get__(self, component: object, owner: type[Any]) -> Any:
        if component is not None:  # its own attribute, which hides this one, is not there yet
            raise AttributeError(f"{owner.__name__} has not called its parent's __init__(factory, parent, name)")
        return FactoryOfClass(self._kind, owner)

    if TYPE_CHECKING:

        def __set__(self, component: object, factory: ComponentFactory) -> None: ...

    def __call__(
        self,
        name: str | None = None,
        *,
        reload_targets: ModuleType | Sequence[ModuleType] | None = None,
        **settings: Any,
    ) -> Any:
        """Return a factory of the class's components.

        Args:
            name: of the component; the class's name in lower case if not given.
            reload_targets: as of any factory.
            settings: attributes that the class declares, or parameters of its `__init__`; a reload keeps them.

        Raises:
            ConfigError: the name is not text, or the class has no such setting.
        """
        kind = self.component_class
        if name is not None and not isinstance(name, str):
            raise ConfigError(
                f"{kind.__name__}.factory() is given {name!r} as the component's name, which is not text.",
                fix=f'{kind.__name__}.factory(name="{_default_name(kind)}"); settings have names, as hover=0.3.',
            )
        factory = self._kind(reload_targets)
        factory._short_form = ShortForm(kind, name or _default_name(kind), *_split_settings(kind, settings))
        return factory


def _split_settings(kind: type[Any], settings: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the settings that are parameters of a class's `__init__`, and those that are its attributes.

    An attribute is declared in the class's body, with or without a value: `hover = 0.3` or `hover: float`.

    Raises:
        ConfigError: the class has no such setting, or a parameter without default is not given.
    """
    parameters = list(inspect.signature(kind.__init__).parameters.values())[_GIVEN:]
    named = {one.name: one for one in parameters if one.kind in (one.POSITIONAL_OR_KEYWORD, one.KEYWORD_ONLY)}
    takes_all = any(one.kind is one.VAR_KEYWORD for one in parameters)
    missing = [name for name, one in named.items() if one.default is one.empty and name not in settings]
    if missing:
        raise ConfigError(
            f"{kind.__name__}.factory() needs {', '.join(missing)}: a parameter of its __init__ without a default.",
            fix=f"{kind.__name__}.factory({missing[0]}=...).",
        )
    attributes = set(_attributes(kind))
    for_init, for_object = dict[str, Any](), dict[str, Any]()
    for key, value in settings.items():
        if key in named or (takes_all and key not in attributes):
            for_init[key] = value
        elif key in attributes:
            for_object[key] = value
        else:
            known = sorted(attributes | named.keys())
            raise ConfigError(
                f"{kind.__name__} has no setting '{key}'.",
                fix=f"{suggest(key, known) if known else ''} A setting is declared in the class: {key} = ...".strip(),
            )
    return for_init, for_object


def _attributes(kind: type[Any]) -> Iterator[str]:
    """Yield the public attributes that a class and its bases declare for its objects; methods are not settings."""
    for base in kind.__mro__:
        declared = vars(base).get("__annotations__", {})
        of_class = {name for name, what in declared.items() if "ClassVar" in str(what)}
        for name, value in {**dict.fromkeys(declared), **vars(base)}.items():
            is_method = callable(value) or hasattr(value, "__get__")
            is_of_class = name in of_class or isinstance(value, (FactoryOfClass, Retired))
            if not (name.startswith("_") or is_of_class or (is_method and name not in declared)):
                yield name


def _default_name(kind: type[Any]) -> str:
    """Return the name of a component whose factory names none: its class's, in lower case with underscores.

    >>> _default_name(type("DepthHold", (), {}))
    'depth_hold'
    """
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", kind.__name__).lower()
