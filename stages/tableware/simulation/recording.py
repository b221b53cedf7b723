"""Key frames of a trial in physics as arrays, so that anything can draw them."""

from __future__ import annotations

from dataclasses import astuple
from pathlib import Path

import numpy as np
from scenewright.stages.tableware.simulation.physics import PhysicsTable
from scenewright.stages.tableware.world.items import Item


class Recording:
    """Give it to PhysicsTable as `record`; what left the table has NaN for a pose."""

    def __init__(self) -> None:
        self.labels: list[str] = []
        self.times: list[float] = []
        self.joints: list[np.ndarray] = []
        self.poses: list[dict[str, np.ndarray]] = []
        self.items: dict[str, Item] = {}

    def __call__(self, world: PhysicsTable, label: str) -> None:
        """Keep the present moment."""
        self.labels.append(label)
        self.times.append(world.arm.seconds)
        self.joints.append(np.append(world.arm.values(), world.arm.finger_gap()))
        self.poses.append({name: world.top.pose(name) for name in world.top.bodies})
        self.items |= world.top.items

    def arrays(self) -> dict[str, np.ndarray]:
        """Return labels (F,), seconds (F,), joints (F, J + 1) [rad, last the opening in m], names (N,), kinds (N,),
        measures (N, 6) as `Measures` has them, poses (F, N, 4, 4) world_from_item [m]."""
        names = sorted(self.items)
        away = np.full((4, 4), np.nan)
        return {
            "labels": np.array(self.labels),
            "seconds": np.array(self.times),
            "joints": np.array(self.joints),
            "names": np.array(names),
            "kinds": np.array([self.items[name].kind for name in names]),
            "measures": np.array([astuple(self.items[name].measures) for name in names]),
            "poses": np.array([[frame.get(name, away) for name in names] for frame in self.poses]),
        }

    def save(self, path: Path) -> None:
        """Write the arrays to an .npz file."""
        np.savez_compressed(path, **self.arrays())  # type: ignore[arg-type]
