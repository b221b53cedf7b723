"""What can be put right of a panoptic map."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import trimesh
from scenewright.cli.viewing.desk.subject import Subject
from scenewright.schemas.edits import Anchor
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.edit.anchoring import anchor_of
from scenewright.stages.edit.map_edits import MAP_EDITS
from scenewright.stages.edit.map_state import MapState, Thing, read_state
from scenewright.stages.kit.viewing.canvas import Canvas
from scenewright.stages.kit.viewing.maps import ShownThing, draw_map


class MapSubject(Subject[MapState]):
    """A panoptic map."""

    all_edits = MAP_EDITS
    option = "map --panoptic-map"

    @cached_property
    def _map_state(self) -> MapState:
        assert isinstance(self.artifact, PanopticMap)
        return read_state(self.artifact)[0]

    def begun(self) -> MapState:
        """See Subject."""
        state = self._map_state
        state.things()
        return replace(state, entities=dict(state.entities), touched=set(state.touched), _things=dict(state._things))

    def anchor_of(self, thing: Thing) -> Anchor:
        """See Subject."""
        return anchor_of(self.state, thing.instance)

    def draw(self, canvas: Canvas) -> None:
        """See Subject."""
        state = self.state
        mesh = trimesh.Trimesh(
            state.surface.vertices, state.surface.faces, vertex_colors=state.surface.colors, process=False
        )
        things = [
            ShownThing(thing.instance, thing.class_name, state.entities[thing.instance].confidence, thing.box)
            for thing in state.things()
        ]
        draw_map(mesh, state.instance, things, canvas)
