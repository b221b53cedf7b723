"""Depth units that only the layout states, against what the depth images hold."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scenewright.stages.ingest.folders.files import raw_depth
from scenewright.stages.ingest.images import INVALID_DEPTH, STORED, depth_roughness
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.preflight.units import TYPICAL
from scenewright.stages.ingest.source import Unusable

IMAGES = 5
"""Depth images that are looked at, spread over the log."""
MILLIMETRES = 1000.0
NEAREST = 0.2
"""Depth [m] nearer than which the usual depth cameras measure nothing: Kinect 0.4, RealSense D435 and phones 0.2."""
NEAR_SHARE = 0.05
"""Share of the depth that may lie nearer all the same: holes' edges, reflections."""
NO_DEPTH = 0.05
"""`depth_roughness` of what is no depth as it is read."""


def settled_units(assumed: float, depths: Sequence[Path], parameters: IngestParameters) -> tuple[float, str]:
    """Return the units a metre of depth images whose layout has `assumed`, and a warning where it can't be those.

    They are millimetres where the layout's unit puts things nearer than depth cameras measure and millimetres put them
    as far as rooms and tables are. Millimetres that a layout's writer multiplied keep the factor in every value, which
    nothing else does: the unit is then the layout's, however near. For logs without poses to compare with.
    """
    if parameters.depth_scale is not None or assumed == MILLIMETRES or not depths:
        return assumed, ""
    values = _values(depths, parameters)
    factor = assumed / MILLIMETRES
    if not len(values) or (factor.is_integer() and not (values % int(factor)).any()):
        return assumed, ""
    near, median = (float(value) for value in np.quantile(values, (NEAR_SHARE, 0.5)))
    too_near = near < NEAREST * assumed or median < TYPICAL[0] * assumed
    if not (too_near and TYPICAL[0] <= median / MILLIMETRES <= TYPICAL[1]):
        return assumed, ""
    return MILLIMETRES, (
        f"WARNING: depth is taken as millimetres, {median / MILLIMETRES:.3g} m away (median): in this layout's unit, "
        f"1/{assumed:g} m, it would be {median / assumed:.3g} m away and nearer than {near / assumed:.2g} m in places "
        f"(--depth-scale {MILLIMETRES:g}, or {assumed:g} where things were that near)"
    )


def _values(depths: Sequence[Path], parameters: IngestParameters) -> np.ndarray:
    """Return stored values (N,) of some depth images, none where they are no whole numbers, or no depth."""
    chosen = np.unique(np.linspace(0, len(depths) - 1, min(len(depths), IMAGES)).astype(int))
    parts = [np.zeros(0, np.uint16)]
    for index in chosen:
        try:
            image = raw_depth(depths[index])
        except Unusable:
            continue
        if image.ndim != 2 or image.dtype != np.uint16:
            return parts[0]
        image = STORED[parameters.depth_bits](np.where(image == INVALID_DEPTH, np.uint16(0), image))
        if depth_roughness(image) > NO_DEPTH:
            return parts[0]
        parts.append(image[image > 0])
    return np.concatenate(parts)
