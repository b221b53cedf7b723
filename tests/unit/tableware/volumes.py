"""Volumes of dishes and utensils in closed form, to hold meshes and masses against."""

from __future__ import annotations

import numpy as np
from scenewright.stages.tableware.world.dish_shapes import utensil_parts
from scenewright.stages.tableware.world.items import Measures


def shell_volume(shell: Measures, sides: int | None = None) -> float:
    """Return the volume [m^3] of a shell: outer minus inner frustum; of its mesh with `sides` sides, or of revolution.

    A frustum of height h and radii a, b has the volume pi h (a^2 + a b + b^2) / 3; a regular polygon's area is that of
    its circle times n sin(2 pi / n) / (2 pi).
    """
    inner = (shell.inner_radius(shell.wall), shell.inner_radius(shell.height))

    def frustum(height: float, a: float, b: float) -> float:
        return height * (a * a + a * b + b * b) / 3.0

    volume = frustum(shell.height, shell.foot_radius, shell.rim_radius)
    volume -= frustum(shell.height - shell.wall, *inner)
    return volume * (np.pi if sides is None else 0.5 * sides * np.sin(2.0 * np.pi / sides))


def utensil_volume(strip: Measures, fork: bool) -> float:
    """Return the volume [m^3]: plan area (trapezia between stations) times the thickness, whatever the arch."""
    area = sum(float(np.trapezoid(high - low, x)) for x, low, high in utensil_parts(strip, fork))
    return area * strip.height
