"""One rendered table for all who look: a cup in a bowl, a spoon, and a brick that is no tableware."""

from dataclasses import replace

import pytest
import trimesh
from scenewright.stages.tableware.world.items import Table, make_item, stand_height
from scenewright.stages.tableware.world.overhead import overhead_camera, render_overhead


@pytest.fixture(scope="package")
def images():
    """Colour (720, 1280, 3) and depth (720, 1280) [m] from straight above."""
    table = Table((make_item("bowl_1", "bowl", -0.2, 0.1), make_item("spoon_1", "spoon", 0.15, -0.1, 0.6)))
    cup = make_item("cup_1", "cup", -0.2, 0.1, on="bowl_1")
    cup = replace(cup, position=(-0.2, 0.1, stand_height(table, cup, "bowl_1")))
    brick = trimesh.creation.box((0.06, 0.05, 0.04), trimesh.transformations.translation_matrix([0.2, 0.15, 0.02]))
    return render_overhead(Table((*table.items, cup)), 3, "usual", others=(brick,), view=overhead_camera())
