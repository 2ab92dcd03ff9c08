"""Filters of echoes by what made them: a scan without that truck, or without its ghosts.

A filter acts on traced echoes, before the receiver, so that one trace serves many filters. An object whose
echoes are filtered still casts its shadow; `scenes.core.scene.remove_instances` removes it from the scene.
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
"""Artefacts that make a component which is not an echo of an object; filtered rain still attenuates."""


@dataclass(frozen=True, kw_only=True)
class EchoFilter:
    """Selects the echoes that meet every given condition, each by any of its values.

    NOISE, LEAKAGE, SPOKE, RAIN and INTERFERENCE are not echoes of objects: a filter of components may name
    them, without other conditions.

    Attributes:
        bounces: Bounce orders; 1 is direct.
        components: Components by number or name, kept as numbers.
        instances: Instance ids of objects, of any surface on the path.
        classes: Names of classes of objects, of any surface on the path.
        displaced: Whether echoes that show none of the surfaces on their path are selected (True) or all
            others (False); None selects both.
        last_only: Whether instances and classes refer to the last surface alone.
    """

    bounces: tuple[int, ...] | None = None
    components: tuple[Component | str, ...] | None = None
    instances: tuple[int, ...] | None = None
    classes: tuple[str, ...] | None = None
    displaced: bool | None = None
    last_only: bool = False

    def __post_init__(self) -> None:
        """Check every condition; the error names it."""
        given = {name: getattr(self, name) for name in ("bounces", "components", "instances", "classes")}
        if all(values is None for values in (*given.values(), self.displaced)):
            raise ValueError("a filter needs bounces, components, instances, classes or displaced")
        for name, values in given.items():
            if values is not None:
                object.__setattr__(self, name, _checked(name, values))
        if not isinstance(self.displaced, bool | None):
            raise ValueError(f"displaced must be True, False or None, got {self.displaced!r}")
        if not isinstance(self.last_only, bool):
            raise ValueError(f"last_only must be True or False, got {self.last_only!r}")
        others = (self.bounces, self.instances, self.classes, self.displaced)
        if self.receiver_components and any(each is not None for each in others):
            raise ValueError(
                "noise, leakage, spoke, rain and interference are no echoes: they have no bounces or class"
            )

    @property
    def component_set(self) -> frozenset[Component]:
        """The components that are named."""
        return frozenset(Component(each) for each in self.components or ())

    @property
    def receiver_components(self) -> frozenset[Component]:
        """The named components that are not echoes of objects."""
        return self.component_set & _SWITCHES.keys()

    def matches(self, echoes: Echoes, instance_class: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Return which echoes meet the conditions.

        Args:
            echoes: Echoes of a scan (E).
            instance_class: Class id of every instance id (I,) uint8.

        Returns:
            Whether each echo does (E,) bool.
        """
        returns = echoes.returns
        named = np.full(len(returns.bounces), True)
        if self.bounces is not None:
            named &= np.isin(returns.bounces, self.bounces)
        if self.displaced is not None:
            named &= returns.displaced == self.displaced
        surfaces = returns.instance[:, None] if self.last_only else returns.surfaces
        if self.instances is not None:
            named &= np.isin(surfaces, self.instances).any(axis=1)
        if self.classes is not None:
            wanted = [CLASSES.index(name) for name in self.classes]
            known = surfaces > 0  # shorter paths are filled up with 0
            named &= (np.isin(instance_class[surfaces], wanted) & known).any(axis=1)
        found = named[echoes.source]
        if self.components is not None:
            found &= np.isin(echo_components(echoes), [int(each) for each in self.component_set])
        return found


def _checked(name: str, values: object) -> tuple[Any, ...]:
    """Return the values of a condition as a tuple.

    Raises:
        ValueError: They are no tuple, or one of them is unknown.
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
    """Return the component of each echo, as in the truth of cells.

    Args:
        echoes: Echoes of a scan (E).

    Returns:
        DIRECT, GHOST or SIDELOBE (E,) uint8.
    """
    kind = np.where(echoes.bounces > 1, np.uint8(Component.GHOST), np.uint8(Component.DIRECT))
    return np.where(echoes.sidelobe, np.uint8(Component.SIDELOBE), kind)


@dataclass(frozen=True, kw_only=True)
class Selection:
    """The echoes that a scan is made of.

    Attributes:
        only: Filter of the echoes to keep; None keeps all.
        without: Filters of the echoes to leave out.
    """

    only: EchoFilter | None = None
    without: tuple[EchoFilter, ...] = ()

    def echoes(self, echoes: Echoes, instance_class: NDArray[np.uint8]) -> Echoes:
        """Return the selected echoes.

        Args:
            echoes: Echoes of a scan.
            instance_class: Class id of every instance id (I,) uint8.

        Returns:
            The echoes that are left.
        """
        if self.only is None and not self.without:
            return echoes
        keep = np.full(len(echoes), True)
        if self.only is not None:
            keep &= self.only.matches(echoes, instance_class)
        for each in self.without:
            keep &= ~each.matches(echoes, instance_class)
        return echoes.select(keep)

    def artefacts(self, artefacts: Artefacts) -> Artefacts:
        """Return the artefacts without those that make the components left out.

        Args:
            artefacts: Strengths of the artefacts.

        Returns:
            The same with these switched off.
        """
        off = frozenset[Component]().union(*(each.receiver_components for each in self.without))
        if self.only is not None and self.only.components is not None:
            off |= _SWITCHES.keys() - self.only.component_set
        return artefacts.without(*(switch for component in off for switch in _SWITCHES[component]))


def selection(only: EchoFilter | None = None, without: EchoFilter | Sequence[EchoFilter] = ()) -> Selection:
    """Return the selection by a filter to keep and filters to leave out.

    Args:
        only: Filter of the echoes to keep; None keeps all.
        without: One or several filters of the echoes to leave out.

    Returns:
        The selection.

    Raises:
        ValueError: One of them is not a filter; the message names the argument.
    """
    if not isinstance(only, EchoFilter | None):
        raise ValueError(f"only must be an EchoFilter, got {only!r}")
    if not isinstance(without, (EchoFilter, list, tuple)):
        raise ValueError(f"without must be an EchoFilter or several, got {without!r}")
    dropped = (without,) if isinstance(without, EchoFilter) else tuple(without)
    if not all(isinstance(each, EchoFilter) for each in dropped):
        raise ValueError(f"without must be an EchoFilter or several, got {without!r}")
    return Selection(only=only, without=dropped)
