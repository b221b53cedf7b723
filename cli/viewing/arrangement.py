"""How a recording is laid out when it is opened: 3D views seen from above, pictures, the graph, texts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

EYE_DIRECTION = np.array([-0.45, -0.75, 0.95])
"""Direction from the middle of the scene to the eye: high enough to look into a room over the walls."""

SIDE_BY_SIDE = 2
"""Most views beside each other; more become tabs."""


@dataclass
class Arrangement:
    """What was drawn, as far as the layout depends on it."""

    world: str
    drawn: bool = False
    """Whether anything three-dimensional was drawn."""
    views: list[tuple[str, tuple[str, ...]]] = field(default_factory=list)
    """(name, hidden paths) of 3D views; none: a single view of everything."""
    pictures: list[str] = field(default_factory=list)
    documents: list[str] = field(default_factory=list)
    graph: bool = False
    minimum: np.ndarray | None = None
    maximum: np.ndarray | None = None

    def enclose(self, minimum: np.ndarray, maximum: np.ndarray) -> None:
        """Keep the box from `minimum` to `maximum` (3,) [m] in sight."""
        self.minimum = np.array(minimum) if self.minimum is None else np.minimum(self.minimum, minimum)
        self.maximum = np.array(maximum) if self.maximum is None else np.maximum(self.maximum, maximum)

    def blueprint(self) -> Any:
        """Return the Rerun blueprint."""
        import rerun.blueprint as rrb

        columns: list[Any] = []
        if self.drawn:
            eye = self._eye(rrb)
            views = self.views or [("world", ())]
            spatial = [
                rrb.Spatial3DView(
                    origin=f"/{self.world}",
                    name=name,
                    contents=["+ $origin/**", *(f"- $origin/{path}/**" for path in hidden)],
                    eye_controls=eye,
                )
                for name, hidden in views
            ]
            together = rrb.Vertical if len(spatial) == SIDE_BY_SIDE else rrb.Tabs
            columns.append(spatial[0] if len(spatial) == 1 else together(*spatial))
        aside: list[Any] = []
        if self.pictures:
            aside.append(
                rrb.Tabs(*(rrb.Spatial2DView(origin=f"/{self.world}/{path}", name=path) for path in self.pictures))
            )
        if self.graph:
            aside.append(rrb.GraphView(origin="/graph", name="graph"))
        if self.documents:
            aside.append(rrb.Tabs(*(rrb.TextDocumentView(origin=f"/{path}", name=path) for path in self.documents)))
        if aside:
            columns.append(aside[0] if len(aside) == 1 else rrb.Vertical(*aside))
        shares = [2, 1] if len(columns) == 2 else [1] * len(columns)
        return rrb.Blueprint(rrb.Horizontal(*columns, column_shares=shares), collapse_panels=True)

    def _eye(self, rrb: Any) -> Any:
        if self.minimum is None or self.maximum is None:
            return None
        center, extent = (self.minimum + self.maximum) / 2, float(np.linalg.norm(self.maximum - self.minimum))
        position = center + EYE_DIRECTION / np.linalg.norm(EYE_DIRECTION) * max(extent, 0.5)
        return rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=position, look_target=center, eye_up=(0.0, 0.0, 1.0)
        )
