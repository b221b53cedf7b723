"""How far a placed CAD model is from the true one: centre, rotation, scale, and the Scan2CAD success measure."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scenewright.stages.evaluate.model_shapes import PlacedShape
from scenewright.stages.kit.measurement.shape_symmetry import Symmetry, symmetric_rotation_error

SUCCESS_TRANSLATION = 0.20
"""Largest shift of a success [m] (Avetisyan et al. 2019, Scan2CAD, section 7)."""
SUCCESS_ROTATION = math.radians(20.0)
"""Largest turn of a success [rad] (Avetisyan et al. 2019, Scan2CAD, section 7)."""
SUCCESS_SCALE = 0.20
"""Largest difference in scale of a success, as a share (Avetisyan et al. 2019, Scan2CAD, section 7)."""


@dataclass(frozen=True, eq=False)
class AlignmentError:
    """Errors of one placed model, whichever model it is."""

    translation: float
    """Distance of the middles of the two closed models' boxes (each along its model's own axes), world frame [m]."""
    rotation: float
    """Angle between the model frames modulo the symmetry of the true model's closed shape [rad]."""
    scale_ratios: tuple[float, float, float]
    """Placed extent over true extent along the true model's x, y, z (closed boxes, scaled)."""
    symmetry: np.ndarray
    """(3, 3) the rotation of the true model's symmetry that the placement took: true axes from placed axes."""

    @property
    def scale(self) -> float:
        """|mean of the three ratios - 1|, as the benchmark's own evaluation takes it."""
        return abs(float(np.mean(self.scale_ratios)) - 1.0)

    @property
    def worst_scale(self) -> float:
        """Largest |ratio - 1| over the axes."""
        return max(abs(ratio - 1.0) for ratio in self.scale_ratios)

    def succeeds(self, *, every_axis: bool = False) -> bool:
        """Whether translation, rotation and scale are within 0.20 m, 20 degrees, 20 % (the class is judged apart).

        `every_axis` asks the 20 % of each extent instead of their mean.
        """
        scale = self.worst_scale if every_axis else self.scale
        return self.translation <= SUCCESS_TRANSLATION and self.rotation <= SUCCESS_ROTATION and scale <= SUCCESS_SCALE


def alignment_error(true: PlacedShape, placed: PlacedShape, *, is_round: bool = False) -> AlignmentError:
    """Compare a placed model with the true one. `is_round`: the truth says that turns about the vertical do not matter.

    Model frames of all models of the library share up (z) and front (-y), so that frames of different models can be
    compared. Joints are taken as closed: their values are judged by themselves.
    """
    symmetry = true.shape.symmetry
    if is_round:
        symmetry = Symmetry(symmetry.rotations, round=True)
    angle, rotation = symmetric_rotation_error(true.rotation, placed.rotation, symmetry)
    ratios = (np.abs(rotation) @ placed.extents) / np.maximum(true.extents, 1e-9)
    return AlignmentError(
        translation=float(np.linalg.norm(placed.center - true.center)),
        rotation=angle,
        scale_ratios=(float(ratios[0]), float(ratios[1]), float(ratios[2])),
        symmetry=rotation,
    )
