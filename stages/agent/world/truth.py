"""What the judge reads of a world: how it truly is, and what was truly done."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from scenewright.schemas.apartment import Apartment, Furniture, Thing
from scenewright.stages.agent.body import Body
from scenewright.stages.agent.world.events import Event


class Lying(Protocol):
    """A thing as it truly is."""

    @property
    def thing(self) -> Thing:
        """What it is."""
        ...

    @property
    def on(self) -> str:
        """Name of what it is on or in; `floor`; empty: in the hand."""
        ...

    @property
    def at(self) -> tuple[float, float]:
        """Where [m]."""
        ...


class World(Body, Protocol):
    """A world that a trial runs in: the robot in it, and the truth for the judge alone."""

    apartment: Apartment

    @property
    def metres(self) -> float:
        """Driven so far."""
        ...

    @property
    def pictures(self) -> list[tuple[str, np.ndarray]]:
        """What the wrist camera took last, (H, W, 3) uint8, with a name each; none in a world without pictures."""
        ...

    @property
    def bodies(self) -> Mapping[str, Lying]:
        """Things by name."""
        ...

    @property
    def furniture(self) -> Mapping[str, Furniture]:
        """Furniture by name."""
        ...

    @property
    def opened(self) -> set[str]:
        """Names of furniture whose door is open."""
        ...

    @property
    def events(self) -> list[Event]:
        """Executions and errors of the eyes, in order."""
        ...

    def root(self, name: str) -> str:
        """Return the furniture (or `floor`, or "" for the hand) on which a thing is, through what carries it."""
        ...

    def close(self) -> None:
        """End it."""
        ...
