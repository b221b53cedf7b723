"""A scan in metres with z up: by the options, else by what its format declares; a room of no size is refused."""

from __future__ import annotations

import logging
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.fuse.annotated_scan import AnnotatedScan
from scenewright.stages.kit.geometry.file_axes import AXES, UNITS, size_text, size_under, upright_rotation
from scenewright.stages.kit.known_names import AxisName, UnitName

LARGEST, SMALLEST = 100.0, 0.2
"""Largest extent [m] of what is scanned indoors: a floor of a large building, a thing on a table."""
HIGHEST = 6.0
"""Height [m] over which a scan is doubted: two storeys."""
USUAL_HEIGHT = 2.5
"""Height of a room [m]."""


def in_metres_and_upright(
    scan: AnnotatedScan, unit: str, up: str, where: Path, logger: logging.Logger
) -> AnnotatedScan:
    """Return a scan in metres, z up. `unit` and `up` are the options: `declared`, or a name of UNITS and AXES.

    Raises BadInput when it then has the size of no room, with the option that gives it one.
    """
    taken: AxisName = scan.up if up == "declared" else up  # type: ignore[assignment]
    metres = UNITS["m" if unit == "declared" else unit]  # type: ignore[index]
    vertices = metres * scan.vertices @ upright_rotation(AXES[taken]).T
    size = np.ptp(vertices, axis=0) if len(vertices) else np.zeros(3)
    if len(vertices) and not SMALLEST <= size.max() <= LARGEST:
        raise BadInput(f"{where}: the scan is {size_text(size)}, which is no room", hint=_unit_hint(scan, taken))
    if up == "declared" and size[2] > size[:2].min() and not (scan.labels > 0).any():
        logger.warning("%s: z is taken to be up, %.3g m high%s", where, size[2], _up_hint(size, taken))
    elif size[2] > HIGHEST:
        logger.warning("%s: the scan is %s: is the unit right (%s)?", where, size_text(size), _unit_hint(scan, taken))
    return replace(scan, vertices=vertices)


def _unit_hint(scan: AnnotatedScan, up: AxisName) -> str:
    """Return the units under which a scan is as high as a room, likeliest first."""
    size = size_under(scan.vertices, AXES[up])
    sizes = {name: metres * size for name, metres in UNITS.items()}
    fitting = [name for name, size in sizes.items() if 1.0 <= size[2] <= HIGHEST and size.max() <= LARGEST]

    def rank(name: UnitName) -> float:
        return abs(math.log(sizes[name][2] / USUAL_HEIGHT))

    words = [f"--unit {name} makes it {size_text(sizes[name])}" for name in sorted(fitting, key=rank)]
    return ", ".join(words[:2]) or "give its unit (--unit), or the scan of a room"


def _up_hint(size: np.ndarray, taken: AxisName) -> str:
    """Return the option under which the least extent of a scan (3,) [m] is its height; empty where there is none."""
    if taken != "+z" or size[1] != size.min():
        return ""
    return f"; if y is up: --up +y makes it {size[1]:.3g} m high"
