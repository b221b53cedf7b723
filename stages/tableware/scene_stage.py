"""The step `tableware scene`: a seeded table, rendered from above."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image
from scenewright.schemas.base import as_transform
from scenewright.schemas.tableware_scene import TablewareScene, TablewareSceneFile
from scenewright.stages.kit.stage import Context
from scenewright.stages.tableware.dishes_file import read_dishes, setting_of
from scenewright.stages.tableware.parameters import SceneParameters
from scenewright.stages.tableware.world.overhead import overhead_camera, render_overhead
from scenewright.stages.tableware.world.records import as_records
from scenewright.stages.tableware.world.scenes import make_table
from scenewright.stages.tableware.world.shape_files import write_shapes


def run(dishes: Path | None, *, parameters: SceneParameters, context: Context) -> TablewareScene:
    """Make the table of a tier and a seed, and its image."""
    dish_sizes = None if dishes is None else read_dishes(dishes)
    sizes = setting_of(dish_sizes).sizes
    table, view = make_table(parameters.tier, context.seed, sizes), overhead_camera()
    with context.progress.step("image"):
        color, depth = render_overhead(table, context.seed, parameters.light, parameters.colors, view=view)
    Image.fromarray(color).save(context.output / "color.png")
    np.savez_compressed(context.output / "depth.npz", depth=depth.astype(np.float32))
    write_shapes(context.output, sizes)
    TablewareSceneFile(
        tier=parameters.tier,
        seed=context.seed,
        light=parameters.light,
        colors=parameters.colors,
        camera=view.camera,
        world_from_camera=as_transform(view.world_from_camera),
        items=as_records(table),
        dishes=dish_sizes,
    ).write(context.output / "scene.json")
    summary = {"tier": parameters.tier, "items": len(table.items), "piles": len(table.stacks)}
    return TablewareScene(root=context.output, summary=summary)
