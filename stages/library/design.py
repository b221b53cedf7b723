"""What a furniture generator returns: painted convex pieces per link, joints, and what the thing is good for."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.geometry.solids import MassProperties, Solid, bar, mass_properties

Color = tuple[int, int, int]


@dataclass(frozen=True)
class Material:
    """A substance: density [kg/m^3] and the colours it comes in."""

    density: float
    colors: tuple[Color, ...]

    def sample(self, random: np.random.Generator) -> Paint:
        """Return the material in one of its colours, with a slight variation in brightness."""
        color = self.colors[int(random.integers(len(self.colors)))]
        shade = float(random.uniform(0.94, 1.06))
        red, green, blue = (int(np.clip(round(c * shade), 0, 255)) for c in color)
        return Paint((red, green, blue), self.density)


@dataclass(frozen=True)
class Paint:
    """A material in one colour."""

    color: Color
    density: float

    def darker(self, factor: float = 0.8) -> Paint:
        """Return the same material with its colour times `factor`."""
        red, green, blue = (int(np.clip(round(c * factor), 0, 255)) for c in self.color)
        return replace(self, color=(red, green, blue))


WOOD = Material(620.0, ((196, 154, 108), (160, 114, 72), (120, 80, 50), (222, 190, 148), (92, 62, 44), (178, 132, 84)))
"""Wood: density [kg/m^3] and colours; by eye."""
LACQUER = Material(
    680.0, ((240, 240, 236), (228, 226, 218), (206, 208, 210), (70, 74, 80), (150, 166, 160), (64, 88, 110))
)
"""Lacquered board: density [kg/m^3] and colours; by eye."""
STEEL = Material(2600.0, ((178, 182, 186), (120, 124, 128), (58, 60, 64), (206, 208, 210)))
"""Bars and legs: tubes, so far lighter than solid steel."""
APPLIANCE = Material(220.0, ((238, 240, 242), (192, 196, 200), (58, 60, 64), (226, 220, 200), (158, 60, 52)))
"""Appliances, insulated walls between sheets: density [kg/m^3] and colours; by eye."""
FABRIC = Material(70.0, ((92, 110, 132), (150, 80, 70), (112, 126, 96), (176, 164, 146), (70, 72, 78), (196, 150, 90)))
"""Fabric: density [kg/m^3] and colours; by eye."""
LINEN = Material(70.0, ((236, 232, 224), (180, 196, 210), (214, 196, 178), (140, 156, 140)))
"""Linen: density [kg/m^3] and colours; by eye."""
PLASTIC = Material(
    1000.0, ((40, 42, 46), (222, 222, 220), (180, 60, 54), (60, 108, 160), (84, 140, 100), (232, 188, 70))
)
"""Coloured plastic: density [kg/m^3] and colours; by eye."""
DARK_PLASTIC = Material(900.0, ((34, 36, 40), (56, 58, 62)))
"""Dark plastic of devices: density [kg/m^3] and colours; by eye."""
SCREEN = Material(900.0, ((18, 20, 28), (26, 30, 40)))
"""Screen of a device: density [kg/m^3] and colours; by eye."""
CERAMIC = Material(
    2300.0, ((238, 236, 230), (196, 70, 60), (66, 110, 160), (92, 150, 110), (236, 192, 80), (60, 62, 70))
)
"""Glazed ceramic: density [kg/m^3] and colours; by eye."""
GLASS = Material(950.0, ((64, 120, 84), (150, 96, 50), (110, 150, 190), (196, 214, 216)))
"""Filled bottles of glass: density [kg/m^3], close to water, and colours."""
CARDBOARD = Material(
    180.0, ((190, 150, 106), (206, 60, 56), (60, 110, 180), (236, 190, 60), (96, 150, 90), (232, 226, 214))
)
"""Cardboard: density [kg/m^3] and colours; by eye."""
PAPER = Material(700.0, ((236, 232, 220), (246, 244, 238)))
"""Paper: density [kg/m^3] and colours; by eye."""


@dataclass(frozen=True)
class Piece:
    """A convex solid in a material."""

    solid: Solid
    paint: Paint


@dataclass(frozen=True)
class Moving:
    """A link that moves: its pieces at joint value 0 and its joint, both in the generator's frame."""

    joint: Joint
    pieces: tuple[Piece, ...]
    behind: str | None = None
    """Name of the joint that has to be open before this one can (the rack behind the door of an oven)."""


@dataclass(frozen=True)
class Design:
    """One piece of furniture in the frame it was drawn in (z up, front along -y)."""

    class_name: str
    body: tuple[Piece, ...]
    moving: tuple[Moving, ...] = ()
    contains: bool = False
    grasp_width: float | None = None
    recipe: dict[str, float | int | str] = field(default_factory=dict)

    def pieces(self) -> list[Piece]:
        """Return all pieces at joint value 0."""
        return [*self.body, *(piece for link in self.moving for piece in link.pieces)]


def painted(paint: Paint, *solids: Solid | Iterable[Solid]) -> list[Piece]:
    """Return the solids (or lists of solids) as pieces of one paint."""
    pieces: list[Piece] = []
    for entry in solids:
        pieces.extend(Piece(solid, paint) for solid in ([entry] if isinstance(entry, Solid) else entry))
    return pieces


def bar_handle(
    center: np.ndarray, along: str, length: float, standoff: float, radius: float, paint: Paint
) -> list[Piece]:
    """Return a bar handle before a surface that looks along -y: `center` (3,) is the middle of the bar.

    The posts reach back by `standoff` [m] at both ends; a gripper closes on the bar between them.
    """
    center = np.asarray(center, dtype=float)
    direction = np.array([1.0, 0, 0]) if along == "x" else np.array([0, 0, 1.0])
    start, end = center - 0.5 * length * direction, center + 0.5 * length * direction
    back = np.array([0, standoff, 0])
    posts = [
        bar(tip, tip + back, 0.8 * radius, count=8) for tip in (start + radius * direction, end - radius * direction)
    ]
    return painted(paint, bar(start, end, radius), posts)


def centered(design: Design) -> Design:
    """Return the design moved so that the origin is the centre of the bottom of its closed bounding box."""
    points = np.concatenate([piece.solid.vertices for piece in design.pieces()])
    lower, upper = points.min(axis=0), points.max(axis=0)
    shift = -np.array([0.5 * (lower[0] + upper[0]), 0.5 * (lower[1] + upper[1]), lower[2]])

    def moved(pieces: tuple[Piece, ...]) -> tuple[Piece, ...]:
        return tuple(replace(piece, solid=piece.solid.shifted(*shift)) for piece in pieces)

    def moved_joint(joint: Joint) -> Joint:
        handle = None if joint.handle is None else as_vector(np.asarray(joint.handle) + shift)
        return joint.model_copy(update={"origin": as_vector(np.asarray(joint.origin) + shift), "handle": handle})

    moving = tuple(replace(link, joint=moved_joint(link.joint), pieces=moved(link.pieces)) for link in design.moving)
    return replace(design, body=moved(design.body), moving=moving)


def mass_of(pieces: Iterable[Piece]) -> MassProperties:
    """Return the MassProperties of pieces, axes and origin of the frame they are in."""
    pieces = list(pieces)
    return mass_properties([piece.solid for piece in pieces], [piece.paint.density for piece in pieces])
