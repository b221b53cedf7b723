"""Rooms from seeded recipes, rendered as RGB-D logs with everything that is true of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.synthesize.arrangement import Arrangement, arrange, world_meshes
    from scenewright.stages.synthesize.furniture import Catalogue
    from scenewright.stages.synthesize.recipes import load_recipe, recipe_names
    from scenewright.stages.synthesize.seen_surface import SeenSurface
    from scenewright.stages.synthesize.shell import build_room

__getattr__ = exported(__name__)
