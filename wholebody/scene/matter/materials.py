"""Materials: restitution and friction of each pair of them (table 1 of Schmidl and Lin, 2004)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

from wholebody.base import checks
from wholebody.base.errors import InputError


class Surface(NamedTuple):
    """What happens where two materials touch.

    The restitution is the speed of separation as a share of the speed of approach, the friction the greatest tangential
    force as a share of the normal one (Coulomb).
    """

    restitution: float
    friction: float


@dataclass(frozen=True)
class Material:
    """A material by its name, and what happens where it touches others.

    Attributes:
        name: such as "wood".
        against: name of the other material, or its own, to (restitution, friction).
        others: the same against materials that are not named, if they do not name this one either.

    Raises:
        InputError: a name that is no text, a restitution out of 0 to 1, or a friction out of 0 to 10.

    Examples:
        >>> rubber = wb.dynamics.Material("rubber", others=(0.6, 0.9))  # restitution, friction
    """

    name: str
    against: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    others: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        checks.text(self.name, "the name of a material")
        if not isinstance(self.against, Mapping):
            raise InputError(
                f"material {self.name!r}: against is {checks.shown(self.against)}; give a dictionary such as "
                "{'wood': (0.3, 0.3)}"
            )
        found = {}
        for other, pair in self.against.items():
            checks.text(other, f"material {self.name!r}: the name of another material")
            found[other] = _surface(pair, f"material {self.name!r} against {other!r}")
        object.__setattr__(self, "against", MappingProxyType(found))
        if self.others is not None:
            object.__setattr__(self, "others", _surface(self.others, f"material {self.name!r} against others"))

    def __reduce__(self) -> tuple[object, ...]:
        return Material, (self.name, {other: tuple(pair) for other, pair in self.against.items()}, self.others)


def _surface(pair: object, what: str) -> Surface:
    values = checks.numbers(pair, (2,), f"{what}: (restitution, friction)")
    # Greatest coefficient of friction; rubber on dry concrete has about 1.
    return Surface(
        checks.number(float(values[0]), f"{what}: restitution", 0.0, 1.0),
        checks.number(float(values[1]), f"{what}: friction", 0.0, 10.0),
    )


MATERIALS: Mapping[str, Material] = MappingProxyType(
    {
        material.name: material
        for material in (
            Material("wood", {"wood": (0.3, 0.3), "human": (0.2, 0.2), "metal": (0.2, 0.1)}),
            Material("human", {"human": (0.1, 0.1), "metal": (0.2, 0.1)}),
            Material("metal", {"metal": (0.3, 0.1)}),
        )
    }
)
"""The materials of table 1."""

DEFAULT = MATERIALS["wood"]
"""Of things that say nothing of theirs."""


def material(value: object, what: str) -> Material:
    """A material, or one of table 1 by its name."""
    if isinstance(value, Material):
        return value
    if not isinstance(value, str):
        raise InputError(f"{what} is {checks.shown(value)}; give 'wood', 'human', 'metal' or a wb.dynamics.Material")
    return MATERIALS[checks.known(value, MATERIALS, "material", what)]


def surface(first: Material, second: Material) -> Surface:
    """Restitution and friction of two materials; InputError if neither of them knows the other."""
    found = first.against.get(second.name, second.against.get(first.name))
    found = found or first.others or second.others
    if found is None:
        raise InputError(
            f"neither material {first.name!r} nor {second.name!r} says how they touch each other; give for example "
            f"wb.dynamics.Material({first.name!r}, {{{second.name!r}: (0.3, 0.3)}})"
        )
    return Surface(*found)
