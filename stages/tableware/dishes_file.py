"""A user's dishes and gripper: read from dishes.toml, and as what a plan goes by."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pydantic import ValidationError
from scenewright.schemas.errors import BadInput, first_problem
from scenewright.schemas.outside import LARGEST_SETTINGS, file_toml
from scenewright.schemas.tableware_dishes import DishSize, TablewareDishes, UtensilSize
from scenewright.stages.tableware.vision.detections import Detection
from scenewright.stages.tableware.world.items import DISHES, STANDARD, DishSizes, Kind, Measures, dish_measures
from scenewright.stages.tableware.world.setting import Gripper, Setting

HINT = "docs/TIDY.md shows a dishes.toml"
ALIKE = 0.005
"""Dishes of a kind whose rims or heights differ by more [m] are not lifted side by side."""
LETTERS: dict[Kind, str] = {"plate": "p", "bowl": "b", "cup": "c"}


def read_dishes(path: Path) -> TablewareDishes:
    """Read and check a dishes.toml. Raises BadInput in one line that names the field that is wrong."""
    values = file_toml(path, LARGEST_SETTINGS, hint=HINT)
    try:
        return TablewareDishes.model_validate(values)
    except ValidationError as error:
        raise BadInput(f"{path}: {first_problem(error)}", hint=HINT) from None


def setting_of(dishes: TablewareDishes | None) -> Setting:
    """Return what a file says, with the standard for what it leaves out altogether: sizes, gripper, or both."""
    if dishes is None:
        return Setting()
    gripper = Gripper()
    if dishes.gripper is not None:
        gripper_file = dishes.gripper
        gripper = Gripper(gripper_file.opening, gripper_file.jaw_height, gripper_file.finger_width / 2)
    if not dishes.has_sizes:
        return Setting(gripper=gripper)
    round_things = {kind: getattr(dishes, kind) for kind in DISHES}
    sizes = DishSizes(
        **{kind: _dish(dish) for kind, dish in round_things.items()},
        fork=_utensil(dishes.fork),
        spoon=_utensil(dishes.spoon),
    )
    stackable = all(d is None or (d.foot_radius is not None and d.wall is not None) for d in round_things.values())
    return Setting(sizes, gripper, stacking=stackable)


def estimated_setting(items: tuple[Detection, ...], gripper: Gripper) -> Setting:
    """Return the setting of dishes that were each measured in an image: of a kind the median, no stacking, and side by
    side only kinds whose dishes are alike. Utensils are not looked for in such an image."""
    sizes: dict[str, Measures | None] = dict.fromkeys(("cup", "bowl", "plate", "fork", "spoon"))
    alike = set()
    for kind in DISHES:
        sizes_of_kind = [item.size for item in items if item.kind == kind and item.size is not None]
        if not sizes_of_kind:
            continue
        rims, heights = (
            np.array([size.rim_radius for size in sizes_of_kind]),
            np.array([size.height for size in sizes_of_kind]),
        )
        sizes[kind] = dish_measures(float(np.median(heights)), float(np.median(rims)))
        if max(float(np.ptp(rims)), float(np.ptp(heights))) <= ALIKE:
            alike.add(LETTERS[kind])
    return Setting(DishSizes(**sizes), gripper, stacking=False, alike=frozenset(alike))


def file_of(setting: Setting) -> TablewareDishes | None:
    """Return the sizes and the hand of a setting as an artifact keeps them; None for the standard ones."""
    if setting == Setting():
        return None
    grip = setting.gripper
    fields: dict[str, object] = {
        "gripper": {"opening": grip.opening, "jaw_height": grip.jaw_height, "finger_width": 2 * grip.finger}
    }
    for kind in setting.sizes.dishes if setting.sizes != STANDARD else ():
        size = setting.sizes[kind]
        fields[kind] = {"height": size.height, "rim_radius": size.rim_radius}
        if setting.stacking:
            fields[kind] |= {"foot_radius": size.foot_radius, "wall": size.wall}  # type: ignore[operator]
    for kind in setting.sizes.utensils if setting.sizes != STANDARD else ():
        size = setting.sizes[kind]
        fields[kind] = {"length": size.length, "width": size.width, "thickness": size.height}
    return TablewareDishes.model_validate(fields)


def _dish(size: DishSize | None) -> Measures | None:
    if size is None:
        return None
    guessed = dish_measures(size.height, size.rim_radius)
    return Measures(
        height=size.height,
        rim_radius=size.rim_radius,
        foot_radius=guessed.foot_radius if size.foot_radius is None else size.foot_radius,
        wall=guessed.wall if size.wall is None else size.wall,
    )


def _utensil(size: UtensilSize | None) -> Measures | None:
    if size is None:
        return None
    return Measures(height=size.thickness, length=size.length, width=size.width)
