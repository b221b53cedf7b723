"""Kind `tableware_scene`: a seeded table with tableware, its overhead RGB-D image, and the truth about it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar, Literal

from pydantic import Field, model_validator
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model, Name, Seed, Transform, Vector3
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.tableware_dishes import TablewareDishes

TablewareKind = Literal["cup", "bowl", "plate", "fork", "spoon"]
MOST_ITEMS = 60
"""Most items of a table; a bound, by eye."""


class TablewareItem(Model):
    """A thing on the table, world frame [m, rad]: origin in the middle of the table top, x along its long side, z up.

    `position`: foot centre of a dish, middle of the underside of a utensil; `yaw`: of a utensil's long axis against x;
    `on`: name of what carries it, None for the table. Sizes are those of its kind.
    """

    name: Name
    kind: TablewareKind
    position: Vector3
    yaw: float = 0.0
    on: Name | None = None


def check_carriers(items: Iterable[TablewareItem]) -> None:
    """Raise ValueError unless names differ and what carries something is there and stands, in the end, on the table."""
    carrier: dict[str, str | None] = {}
    for item in items:
        if item.name in carrier:
            raise ValueError(f"two items are called {item.name!r}")
        carrier[item.name] = item.on
    for name in carrier:
        passed = {name}
        below = carrier[name]
        while below is not None:
            if below not in carrier:
                raise ValueError(f"{name!r} stands on {below!r}, which is not there")
            if below in passed:
                raise ValueError(f"{name!r} stands on itself in the end")
            passed.add(below)
            below = carrier[below]


class TablewareSceneFile(Model):
    """scene.json: the recipe (tier, seed, light, colours) and the truth."""

    tier: str
    seed: Seed
    light: Literal["bright", "usual", "dim"]
    colors: Literal["dark_on_white", "white_on_dark"]
    camera: Camera
    world_from_camera: Transform
    items: tuple[TablewareItem, ...] = Field(max_length=MOST_ITEMS)
    dishes: TablewareDishes | None = None
    """The user's sizes and gripper; None: the standard ones."""

    @model_validator(mode="after")
    def _carriers_are_there(self) -> TablewareSceneFile:
        check_carriers(self.items)
        return self


class TablewareScene(Artifact):
    """`scene.json`, `color.png` (sRGB), `depth.npz` (`depth` (H, W) float32 z-depth [m], 0 where unknown),
    `shapes/<kind>.ply`."""

    kind: ClassVar[str] = "tableware_scene"
    description: ClassVar[str] = "a table with tableware, its overhead RGB-D image and the truth"
    info = Document(TablewareSceneFile, "scene.json")
