"""What would a scan be without that truck, without its ghosts? Filters of echoes by what made them.

A filter works on a traced scan, before the receiver, so that one trace serves many questions. What it takes
out still casts its shadow; `scenes.core.scene.without` takes a thing out of the world itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.scene import CLASSES
from echoscape.sim.datasets.polar_scan import Component
from echoscape.sim.echoes import Echoes
from echoscape.sim.settings.artefacts import Artefacts

_SWITCHES = {
    Component.NOISE: ("thermal_noise",),
    Component.LEAKAGE: ("leakage",),
    Component.SPOKE: ("saturation", "phase_noise", "quantisation"),
    Component.RAIN: ("rain",),
    Component.INTERFERENCE: ("interference",),
}
"""What makes a component that is no echo of a thing; rain that is silent still takes from the others."""


@dataclass(frozen=True, kw_only=True)
class EchoFilter:
    """Names echoes: those that meet every condition given, each by any of its values.

    bounces: orders, 1 direct; components: of `Component`, by number or name, kept as numbers; instances,
    classes: ids of things and names of classes, of any surface on an echo's path, or of the last alone if
    `last_only`.
    NOISE, LEAKAGE, SPOKE, RAIN and INTERFERENCE are no echoes of things: a filter of components may name
    them, without other conditions.
    """

    bounces: tuple[int, ...] | None = None
    components: tuple[Component | str, ...] | None = None
    instances: tuple[int, ...] | None = None
    classes: tuple[str, ...] | None = None
    last_only: bool = False

    def __post_init__(self) -> None:
        """Refuse what names nothing, naming the argument."""
        given = {name: getattr(self, name) for name in ("bounces", "components", "instances", "classes")}
        if all(values is None for values in given.values()):
            raise ValueError("a filter needs bounces, components, instances or classes")
        for name, values in given.items():
            if values is not None:
                object.__setattr__(self, name, _checked(name, values))
        if not isinstance(self.last_only, bool):
            raise ValueError(f"last_only must be True or False, got {self.last_only!r}")
        others = (self.bounces, self.instances, self.classes)
        if self.receiver_components and any(each is not None for each in others):
            raise ValueError(
                "noise, leakage, spoke, rain and interference are no echoes: they have no bounces or class"
            )

    @property
    def component_set(self) -> frozenset[Component]:
        """The components named."""
        return frozenset(Component(each) for each in self.components or ())

    @property
    def receiver_components(self) -> frozenset[Component]:
        """Those of the components that the receiver makes."""
        return self.component_set & _SWITCHES.keys()

    def matches(self, echoes: Echoes, instance_class: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Return which echoes (E,) are named; `instance_class` (I,) gives the class of each instance."""
        returns = echoes.returns
        named = np.full(len(returns.bounces), True)
        if self.bounces is not None:
            named &= np.isin(returns.bounces, self.bounces)
        surfaces = returns.instance[:, None] if self.last_only else returns.surfaces
        if self.instances is not None:
            named &= np.isin(surfaces, self.instances).any(axis=1)
        if self.classes is not None:
            wanted = [CLASSES.index(name) for name in self.classes]
            known = surfaces > 0  # 0 fills up the rows of shorter paths
            named &= (np.isin(instance_class[surfaces], wanted) & known).any(axis=1)
        found = named[echoes.source]
        if self.components is not None:
            found &= np.isin(echo_components(echoes), [int(each) for each in self.component_set])
        return found


def _checked(name: str, values: object) -> tuple[Any, ...]:
    """Return the values of a condition as a tuple.

    Raises:
        ValueError: they are none, or one of them names nothing.
    """
    if not isinstance(values, (tuple, list)):
        raise ValueError(f"{name} must be a tuple, got {values!r}")
    check = {"components": _component, "classes": _class_name}.get(name)
    return tuple(check(value) if check else _whole(name, value) for value in values)


def _component(value: object) -> Component:
    if isinstance(value, str) and value.upper() in Component.__members__:
        return Component[value.upper()]
    if _is_whole(value) and value in list(Component):
        return Component(value)
    raise ValueError(
        f"components must be among {', '.join(map(str.lower, Component.__members__))}, got {value!r}"
    )


def _class_name(value: object) -> str:
    if not isinstance(value, str) or value not in CLASSES:
        raise ValueError(f"classes must be among {', '.join(CLASSES)}, got {value!r}")
    return value


def _whole(name: str, value: object) -> int:
    if not _is_whole(value) or value < 1:
        raise ValueError(f"{name} must be whole numbers of 1 or more, got {value!r}")
    return int(value)


def _is_whole(value: object) -> TypeGuard[int]:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def echo_components(echoes: Echoes) -> NDArray[np.uint8]:
    """Return DIRECT, GHOST or SIDELOBE for each echo (E,), as the truth of cells calls them."""
    kind = np.where(echoes.bounces > 1, np.uint8(Component.GHOST), np.uint8(Component.DIRECT))
    return np.where(echoes.sidelobe, np.uint8(Component.SIDELOBE), kind)


@dataclass(frozen=True, kw_only=True)
class Selection:
    """Which echoes a scan is made of: all that `only` names (None: all) but those that `without` names."""

    only: EchoFilter | None = None
    without: tuple[EchoFilter, ...] = ()

    def echoes(self, echoes: Echoes, instance_class: NDArray[np.uint8]) -> Echoes:
        """Return the echoes that are left."""
        if self.only is None and not self.without:
            return echoes
        keep = np.full(len(echoes), True)
        if self.only is not None:
            keep &= self.only.matches(echoes, instance_class)
        for each in self.without:
            keep &= ~each.matches(echoes, instance_class)
        return echoes.select(keep)

    def artefacts(self, artefacts: Artefacts) -> Artefacts:
        """Return the artefacts that are left: the receiver's own components are its switches."""
        off = frozenset[Component]().union(*(each.receiver_components for each in self.without))
        if self.only is not None and self.only.components is not None:
            off |= _SWITCHES.keys() - self.only.component_set
        return artefacts.without(*(switch for component in off for switch in _SWITCHES[component]))


def selection(only: EchoFilter | None = None, without: EchoFilter | Sequence[EchoFilter] = ()) -> Selection:
    """Return the selection of one filter to keep and one or several to take out.

    Raises:
        ValueError: one of them is no filter; the message names the argument.
    """
    if not isinstance(only, EchoFilter | None):
        raise ValueError(f"only must be an EchoFilter, got {only!r}")
    if not isinstance(without, (EchoFilter, list, tuple)):
        raise ValueError(f"without must be an EchoFilter or several, got {without!r}")
    dropped = (without,) if isinstance(without, EchoFilter) else tuple(without)
    if not all(isinstance(each, EchoFilter) for each in dropped):
        raise ValueError(f"without must be an EchoFilter or several, got {without!r}")
    return Selection(only=only, without=dropped)
