"""What physics knows of a thing: mass, inertia, friction, and a shape of a few simple parts."""

from dataclasses import dataclass
from typing import Literal

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A simple solid.

    Attributes:
        kind: "box"; "cylinder" about z; "sphere".
        centre_m: in the rest frame of the thing: origin at its foot, z up.
        size_m: full extents; a sphere's and a cylinder's first is the diameter.
    """

    kind: Literal["box", "cylinder", "sphere"]
    centre_m: Vector
    size_m: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class Top:
    """The upper half of an office chair: it turns about the z axis of the lower half.

    Its centre of mass is taken to lie on that axis.

    Attributes:
        mass_kg: of this half alone.
        centre_of_mass_m: height above the floor.
        inertia_kg_m2: about the axis.
        bearing_n_m: torque of dry friction in the bearing.
        parts: its shape.
        friction: coefficient of dry friction against a surface of coefficient 1.
    """

    mass_kg: float
    centre_of_mass_m: float
    inertia_kg_m2: float
    bearing_n_m: float
    parts: tuple[Part, ...]
    friction: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """A thing as physics sees it.

    Two coefficients of friction multiply; floor and furniture have 1.

    Attributes:
        mass_kg: without `top`.
        centre_of_mass_m: in the rest frame.
        inertia_kg_m2: about the centre of mass, along the axes of the rest frame; without `top`.
        parts: its shape.
        friction: coefficient of dry friction.
        rolling_m: arm of the rolling resistance: its torque is this times the normal force.
        restitution: share of the normal speed that is left after a hit on a surface of restitution 1.
        upright: it slides, rolls and turns about z, but does not tip: a chair.
        top: what turns on it.
    """

    mass_kg: float
    centre_of_mass_m: Vector
    inertia_kg_m2: Vector
    parts: tuple[Part, ...]
    friction: float
    rolling_m: float = 0.0
    restitution: float = 0.1
    upright: bool = False
    top: Top | None = None

    @property
    def total_mass_kg(self) -> float:
        """With the top."""
        return self.mass_kg + (self.top.mass_kg if self.top else 0.0)


def box_inertia(mass_kg: float, size_m: Vector) -> Vector:
    """Moments (x, y, z) of a solid box of full extents `size_m` about its middle."""
    x, y, z = size_m
    return (mass_kg * (y * y + z * z) / 12, mass_kg * (x * x + z * z) / 12, mass_kg * (x * x + y * y) / 12)


def cylinder_inertia(mass_kg: float, radius_m: float, height_m: float) -> Vector:
    """Moments (x, y, z) of a solid upright cylinder about its middle."""
    across = mass_kg * (3 * radius_m**2 + height_m**2) / 12
    return (across, across, mass_kg * radius_m**2 / 2)


def tube_inertia(mass_kg: float, radius_m: float, height_m: float) -> Vector:
    """Moments (x, y, z) of a thin upright tube about its middle."""
    across = mass_kg * (6 * radius_m**2 + height_m**2) / 12
    return (across, across, mass_kg * radius_m**2)
