"""What can be put right of a panoptic map."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import trimesh

from cli.viewing.desk.subject import Subject
from schemas.edits import Anchor
from schemas.panoptic_map import PanopticMap
from stages.edit.anchoring import anchor_of
from stages.edit.map_edits import MAP_EDITS
from stages.edit.map_state import MapState, Thing, read_state
from stages.kit.viewing.canvas import Canvas
from stages.kit.viewing.maps import ShownThing, draw_map


class MapSubject(Subject[MapState]):
    """A panoptic map."""

    all_edits = MAP_EDITS
    option = "map --panoptic-map"

    @cached_property
    def _seen(self) -> MapState:
        assert isinstance(self.artifact, PanopticMap)
        return read_state(self.artifact)[0]

    def begun(self) -> MapState:
        """See Subject."""
        seen = self._seen
        seen.things()
        return replace(seen, entities=dict(seen.entities), touched=set(seen.touched), _things=dict(seen._things))

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
