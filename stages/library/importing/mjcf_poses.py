"""Where MJCF puts things: positions, and the five ways in which it writes a turn (MuJoCo's XML reference, Frame)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.library.importing.source_folder import numbers
from scipy.spatial.transform import Rotation

EULER_ORDER = re.compile(r"(?!.?(.)\1)(?:[xyz]{3}|[XYZ]{3})")
"""Three axes, none twice in a row."""


@dataclass(frozen=True)
class Angles:
    """How a file writes angles: `unit` [rad], and the order of Euler's."""

    unit: float
    order: str

    def pose(self, attributes: Mapping[str, str], where: str) -> np.ndarray:
        """Return parent_from_element (4, 4). Raises BadInput, beginning with `where`."""
        return transform_from(
            self._rotation(attributes, where), numbers(attributes.get("pos", "0 0 0"), 3, f"{where}: pos")
        )

    def euler(self, text: str, where: str) -> np.ndarray:
        """Return the rotation (3, 3) of three angles. Raises BadInput, beginning with `where`."""
        if EULER_ORDER.fullmatch(self.order) is None:
            raise BadInput(f"{where}: eulerseq {self.order!r:.20}")
        # MuJoCo: small letters turn with the frame. SciPy: large letters do.
        angles = numbers(text, 3, f"{where}: euler") * self.unit
        return Rotation.from_euler(self.order.swapcase(), angles).as_matrix()

    def _rotation(self, attributes: Mapping[str, str], where: str) -> np.ndarray:
        if "quat" in attributes:
            return turn_of(attributes["quat"], f"{where}: quat")
        if "euler" in attributes:
            return self.euler(attributes["euler"], where)
        if "axisangle" in attributes:
            values = numbers(attributes["axisangle"], 4, f"{where}: axisangle")
            return Rotation.from_rotvec(unit_vector(values[:3], where) * values[3] * self.unit).as_matrix()
        if "zaxis" in attributes:
            return z_towards(unit_vector(numbers(attributes["zaxis"], 3, f"{where}: zaxis"), where))
        if "xyaxes" in attributes:
            values = numbers(attributes["xyaxes"], 6, f"{where}: xyaxes")
            x_axis = unit_vector(values[:3], where)
            y_axis = unit_vector(values[3:] - (values[3:] @ x_axis) * x_axis, where)
            return np.column_stack([x_axis, y_axis, np.cross(x_axis, y_axis)])
        return np.eye(3)


def turn_of(text: str, where: str) -> np.ndarray:
    """Return the rotation (3, 3) of a quaternion w x y z of any length but 0. Raises BadInput."""
    w, x, y, z = numbers(text, 4, where)
    length = float(np.linalg.norm([w, x, y, z]))
    if length < 1e-10:
        raise BadInput(f"{where} of length 0")
    return Rotation.from_quat([x, y, z, w]).as_matrix()


def unit_vector(vector: np.ndarray, where: str) -> np.ndarray:
    """Return the vector (3,) at length 1. Raises BadInput for one of length 0."""
    length = float(np.linalg.norm(vector))
    if length < 1e-12:
        raise BadInput(f"{where}: a direction of length 0")
    return vector / length


def z_towards(direction: np.ndarray) -> np.ndarray:
    """Return the smallest rotation (3, 3) that turns z into a unit direction."""
    z = np.array([0.0, 0.0, 1.0])
    turn = np.cross(z, direction)
    sine, cosine = float(np.linalg.norm(turn)), float(z @ direction)
    if sine < 1e-12:
        return np.eye(3) if cosine > 0 else np.diag([1.0, -1.0, -1.0])
    return Rotation.from_rotvec(turn / sine * np.arctan2(sine, cosine)).as_matrix()
