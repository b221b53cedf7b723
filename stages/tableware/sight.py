"""Seeing a table: from an RGB-D image to what is planned for, and eyes that look anew before each action."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import hypot

import numpy as np
from scenewright.stages.tableware.planning.policy import STANDARD_SETTING
from scenewright.stages.tableware.planning.refusals import Accepted, Doubt, Unknown, accept
from scenewright.stages.tableware.planning.rules import Rules
from scenewright.stages.tableware.simulation.trial import World
from scenewright.stages.tableware.vision.detections import Detection, as_table
from scenewright.stages.tableware.vision.seeing import OBLIQUE_VIEW, Sight, see
from scenewright.stages.tableware.world.items import Table
from scenewright.stages.tableware.world.overhead import OverheadCamera, Scheme, overhead_camera, render_overhead
from scenewright.stages.tableware.world.setting import Setting

SAME_PLACE = 0.025
"""What is seen no farther than this [m] from where an item of its sort is, is that item: a grasp there meets it."""


@dataclass(frozen=True)
class Seen:
    """What an image says, and what of it is planned for."""

    sight: Sight
    accepted: Accepted


def look(color: np.ndarray, depth: np.ndarray, view: OverheadCamera, least: float, setting: Setting) -> Seen:
    """Return what an image says, and what of it is planned for. Raises BadInput for an image that cannot be used."""
    sight = see(color, depth, view, dishes=setting.sizes)
    return Seen(sight, understood(sight.detections, least, setting))


def understood(detections: tuple[Detection, ...], least: float, setting: Setting) -> Accepted:
    """Return what of some detections is planned for; items are named by their kind and their row."""
    names = {
        row: f"{detection.kind}_{row + 1}" for row, detection in enumerate(detections) if detection.kind is not None
    }
    doubts = {name: Doubt(detections[row].confidence, detections[row].unsure) for row, name in names.items()}
    unknown = tuple(
        Unknown(f"unknown_{row + 1}", detection.position[0], detection.position[1], max(detection.extent, 0.01))
        for row, detection in enumerate(detections)
        if detection.kind is None
    )
    return accept(as_table(detections, setting.sizes), doubts, unknown, least, Rules(setting))


def setting_seen(detections: tuple[Detection, ...], setting: Setting) -> Setting:
    """Return the setting by which detections are planned for: of what was seen from the side nothing is stacked, as
    lower rims are hidden there, and one dish that is taken for another is a wrong stack."""
    oblique = any(OBLIQUE_VIEW in detection.unsure for detection in detections)
    return replace(setting, stacking=False) if oblique else setting


class Eyes:
    """Looks at a world before each action: the image that it gives, or one rendered of its table. Items get the names
    of the true ones that stand there, so that a policy can follow them; what is nobody keeps a name of its own. Where
    the hand closed on nothing (`vain` of the world, as a gripper reports it) nothing is believed to be any more."""

    def __init__(
        self, seed: int, light: str, colors: Scheme, least: float, setting: Setting = STANDARD_SETTING
    ) -> None:
        self._seed, self._light, self._colors, self._least = seed, light, colors, least
        self._setting = setting
        self.images = 0
        self.last: Seen | None = None
        self._believed = Table(())
        self._nothing: list[tuple[float, float]] = []

    def __call__(self, world: World) -> Table:
        """Return what is seen."""
        color, depth, view = self._image(world)
        self.images += 1
        self.last = look(color, depth, view, self._least, self._setting)
        for name in getattr(world, "vain", ()):
            if name in self._believed.by_name:
                self._nothing.append(self._believed.by_name[name].position[:2])
        self._believed = named_as(without_places(self.last.accepted.table, self._nothing), world.table)
        return self._believed

    def _image(self, world: World) -> tuple[np.ndarray, np.ndarray, OverheadCamera]:
        seed = 1000 * self._seed + self.images
        image = getattr(world, "image", None)
        if image is not None:
            color, depth, view = image(seed, self._light, self._colors)
            return color, depth, view
        view = overhead_camera()
        color, depth = render_overhead(world.table, seed, self._light, self._colors, view=view)
        return color, depth, view


def named_as(seen: Table, truth: Table, reach: float = SAME_PLACE) -> Table:
    """Return a table whose items have the names of those of another that they are: of the same kind (forks and spoons
    are one), nearest first, no farther than `reach` [m]. The others are called `stray_1` and so on."""
    pairs = sorted(
        (hypot(*(a - b for a, b in zip(item.position, true_item.position, strict=True))), item.name, true_item.name)
        for item in seen.items
        for true_item in truth.items
        if item.kind == true_item.kind or not (item.is_dish or true_item.is_dish)
    )
    names: dict[str, str] = {}
    used_names: set[str] = set()
    for apart, name, true_name in pairs:
        if apart <= reach and name not in names and true_name not in used_names:
            names[name] = true_name
            used_names.add(true_name)
    for item in seen.items:  # what lies on something is met there, wherever exactly it was seen
        if item.name in names:
            continue
        for on_it in truth.carried.get(names.get(item.on or "", ""), ()):
            if on_it.name not in used_names and (item.kind == on_it.kind or not (item.is_dish or on_it.is_dish)):
                names[item.name] = on_it.name
                used_names.add(on_it.name)
                break
    strays = (item.name for item in seen.items if item.name not in names)
    names |= {name: f"stray_{number}" for number, name in enumerate(strays, start=1)}
    items = tuple(
        replace(item, name=names[item.name], on=None if item.on is None else names[item.on]) for item in seen.items
    )
    return Table(items, seen.obstacles)


def without_places(table: Table, places: list[tuple[float, float]]) -> Table:
    """Return a table less what carries nothing and stands at one of some places [m]."""
    gone = {
        item.name
        for item in table.tops
        if any(hypot(item.position[0] - x, item.position[1] - y) < SAME_PLACE for x, y in places)
    }
    return table.without(gone)
