"""Everything thin in the needle world is a tube: a chain of short cones. Needle, thread and drivers are built here.

Points are in metres, in whatever frame the caller works in. A `Tubes` holds the cones of all bodies of one scene,
with the body they belong to, so that one rasteriser draws them all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.suture.rig import NEEDLE_RADIUS, NeedlePose

NEEDLE, THREAD, LEFT_DRIVER, RIGHT_DRIVER = 1, 2, 3, 4
"""Numbers of the bodies in pictures."""
WIRE_RADIUS = 0.0005
"""Half the thickness of the needle's wire [m]; a needle for a 2-0 thread is about 1 mm thick."""
TIP_RADIUS = 0.00004
"""Half the thickness of the needle's tip [m]."""


@dataclass(frozen=True)
class NeedleShape:
    """How a needle is made, and bent by use."""

    radius: float = NEEDLE_RADIUS
    """Of its half circle [m]."""
    wire: float = WIRE_RADIUS
    """Half the wire's thickness [m]."""
    taper_angle: float = 0.7
    """The tip's taper runs over this angle of the arc [rad], 8.4 mm."""
    taper_power: float = 1.6
    """How round the taper is; 1 is a cone."""
    opened: float = 0.0
    """By what share of it the ends lie farther from the centre than the middle."""
    warped: float = 0.0
    """By how much [m] the ends lie farther along the normal than the middle."""


USUAL_NEEDLE = NeedleShape()


@dataclass(frozen=True)
class Tubes:
    """Cones from `starts` to `ends` (N, 3) [m] with `start_radii`, `end_radii` (N,) [m] of the body `bodies` (N,)."""

    starts: np.ndarray
    ends: np.ndarray
    start_radii: np.ndarray
    end_radii: np.ndarray
    bodies: np.ndarray

    def moved(self, target_from_source: np.ndarray) -> Tubes:
        """Return the tubes in another frame, by a rigid (4, 4) transform."""
        rotation, shift = target_from_source[:3, :3], target_from_source[:3, 3]
        starts, ends = self.starts @ rotation.T + shift, self.ends @ rotation.T + shift
        return Tubes(starts, ends, self.start_radii, self.end_radii, self.bodies)


def joined(parts: list[Tubes]) -> Tubes:
    """Return all cones of `parts` as one set."""
    return Tubes(
        np.concatenate([part.starts for part in parts]),
        np.concatenate([part.ends for part in parts]),
        np.concatenate([part.start_radii for part in parts]),
        np.concatenate([part.end_radii for part in parts]),
        np.concatenate([part.bodies for part in parts]),
    )


def chain(points: np.ndarray, radii: np.ndarray, body: int) -> Tubes:
    """Return the tube through points (N, 3) with radii (N,) [m]."""
    bodies = np.full(len(points) - 1, body, dtype=np.int32)
    return Tubes(points[:-1], points[1:], radii[:-1], radii[1:], bodies)


def needle_radii(angles: np.ndarray, shape: NeedleShape = USUAL_NEEDLE) -> np.ndarray:
    """Return the wire's radius [m] at arc angles [rad]: a more or less rounded taper to the tip, a crimp at the
    swage."""
    along = np.clip(angles / shape.taper_angle, 0.0, 1.0)
    taper = TIP_RADIUS + (shape.wire - TIP_RADIUS) * (1.0 - (1.0 - along) ** shape.taper_power)
    crimp = 1.0 - 0.08 * np.exp(-(((np.pi - angles) * 12.0 - 2.5) ** 2) / 0.8)
    return taper * crimp


def needle_line(pose: NeedlePose, angles: np.ndarray, shape: NeedleShape = USUAL_NEEDLE) -> np.ndarray:
    """Return the wire's middle (N, 3) [m] at arc angles [rad]; `pose` is that of the half circle nearest to it."""
    ends = (2.0 * angles / np.pi - 1.0) ** 2 - 1.0 / 3.0
    line = pose.points(angles, shape.radius * (1.0 + shape.opened * ends))
    return np.asarray(line + (shape.warped * ends)[:, None] * pose.normal)


def needle_tube(pose: NeedlePose, pieces: int = 120, shape: NeedleShape = USUAL_NEEDLE) -> Tubes:
    """Return the needle at `pose`."""
    angles = np.linspace(0.0, np.pi, pieces + 1)
    return chain(needle_line(pose, angles, shape), needle_radii(angles, shape), NEEDLE)


def driver_tube(grip: np.ndarray, approach: np.ndarray, across: np.ndarray, opening: float, body: int) -> Tubes:
    """Return a needle driver that grips at `grip` (3,): two jaws, a wrist and a shaft.

    `approach` (3,) is the unit direction from the shaft to the grip; `across` (3,) the unit direction in which the
    jaws open; `opening` half the angle between them [rad]. The jaws are 9 mm long and reach 2 mm beyond the grip;
    the shaft is 8 mm thick.
    """
    across = across - (across @ approach) * approach
    across = across / np.linalg.norm(across)
    hinge = grip - approach * 0.0085
    chains = []
    for side in (-1.0, 1.0):
        direction = np.cos(opening) * approach + side * np.sin(opening) * across
        start = hinge + side * across * 0.0011
        points = start + direction * np.linspace(0.0, 0.0105, 8)[:, None]
        chains.append(chain(points, np.linspace(0.0017, 0.0009, 8), body))
    wrist = hinge - approach * np.linspace(-0.001, 0.010, 5)[:, None]
    chains.append(chain(wrist, np.array([0.0020, 0.0028, 0.0031, 0.0032, 0.0034]), body))
    shaft = hinge - approach * np.linspace(0.010, 0.30, 60)[:, None]
    chains.append(chain(shaft, np.full(60, 0.0040), body))
    return joined(chains)
