"""Level places of a chest with one drawer: what fits into it while it slides."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.plan.regions import OPEN_AIR, Region, find_regions

SLIDE = Joint(
    name="chest__slide", type="prismatic", part="chest__drawer", origin=(0, 0, 0), axis=(0, -1, 0), lower=0, upper=0.3
)
RAIL = ((-0.25, -0.21, 0.3), (0.25, -0.19, 0.4))


def chest(rail: bool) -> tuple[Region, ...]:
    """A top board 0.29 m over a drawer's bottom, and a rail over its front that leaves 0.19 m."""
    body = [((-0.25, -0.2, 0.4), (0.25, 0.2, 0.42)), *([RAIL] if rail else [])]
    parts = {"chest": body, "chest__drawer": [((-0.24, -0.19, 0.1), (0.24, 0.19, 0.11))]}
    meshes = {
        link: trimesh.util.concatenate([trimesh.creation.box(bounds=bounds) for bounds in boxes])
        for link, boxes in parts.items()
    }
    return find_regions("chest", [SLIDE], meshes)


def drawer_of(regions: tuple[Region, ...]) -> Region:
    return next(region for region in regions if region.link == "chest__drawer")


def test_what_stands_in_a_drawer_passes_under_the_rail():
    region = drawer_of(chest(rail=True))
    y = region.low[1] + 0.02 * (np.arange(region.free.shape[1]) + 0.5)
    passes = (y > -0.19) & (y < 0.09)
    assert region.free[:, passes] == pytest.approx(0.19, abs=0.003)
    assert region.free[:, y > 0.12] == pytest.approx(0.29, abs=0.003), "the back never comes out from under the top"
    assert region.takes(0.03, 0.17) and not region.takes(0.03, 0.2)
    assert region.carries(np.array([0.0, 0.16]), 0.02, 0.25) and not region.carries(np.array([0.0, -0.1]), 0.02, 0.25)


def test_without_a_rail_the_top_alone_counts():
    region = drawer_of(chest(rail=False))
    assert region.free.min() == pytest.approx(0.29, abs=0.003) and region.takes(0.03, 0.25)
    assert region.doors == ("chest__slide",) and region.carries_things and not region.covered


def test_the_top_is_open_air():
    top = next(region for region in chest(rail=False) if region.link == "chest")
    assert top.clearance == OPEN_AIR and top.level == pytest.approx(0.42) and top.doors == ()
