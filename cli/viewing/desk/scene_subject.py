"""What can be put right of a CAD scene."""

from __future__ import annotations

import math
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

from scenewright.cli.viewing.cad_scene_view import draw_cad_scene_of
from scenewright.cli.viewing.desk.generations import behind
from scenewright.cli.viewing.desk.graph_subject import GraphSubject
from scenewright.cli.viewing.inputs import input_artifact
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import GraphNode
from scenewright.schemas.errors import UsageError
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.edit.anchoring import Conflict
from scenewright.stages.edit.applying import Table
from scenewright.stages.edit.map_state import Thing
from scenewright.stages.edit.scene_edits import SCENE_EDITS, asked_move, joint_anchors
from scenewright.stages.edit.scene_state import SceneState
from scenewright.stages.kit.formats.cad_models import read_model
from scenewright.stages.kit.measurement.cad_candidates import candidates_of
from scenewright.stages.kit.viewing.canvas import Canvas


class SceneSubject(GraphSubject):
    """A CAD scene."""

    all_edits: ClassVar[Table[Any]] = SCENE_EDITS
    option = "scene --cad-scene"
    state: SceneState

    @cached_property
    def _folder(self) -> tempfile.TemporaryDirectory[str]:
        """Where models that edits make are written; gone with the desk."""
        return tempfile.TemporaryDirectory(prefix="scenewright-desk-")

    @cached_property
    def _library(self) -> CadLibrary | None:
        return input_artifact(self.artifact, CadLibrary)

    @cached_property
    def _map(self) -> PanopticMap | None:
        return next(behind(self.artifact, PanopticMap), None)

    def begun(self) -> SceneState:
        """See Subject."""
        assert isinstance(self.artifact, CadScene)
        return SceneState(
            self.artifact.graph,
            {entry.node: entry for entry in self.artifact.info.replacements},
            self.artifact,
            None if self._library is None else self._library.path("models"),
            None if self._map is None else self._map.root,
            Path(tempfile.mkdtemp(dir=self._folder.name)),
        )

    def draw(self, canvas: Canvas) -> None:
        """See Subject."""
        assert isinstance(self.artifact, CadScene)
        root = Path(self._folder.name) / "shown"
        shutil.rmtree(root, ignore_errors=True)
        self.state.write(root)
        self.artifact.info.model_copy(update={"replacements": tuple(self.state.replacements.values())}).write(
            root / "scene.json"
        )
        self.state.graph.write(root / "graph.json")
        draw_cad_scene_of(CadScene(root), self._library, self._map, canvas)

    def fields(self, what: str, form: Sequence[Mapping[str, Any]], asked: Mapping[str, Any]) -> dict[str, Any]:
        """See Subject. A joint is meant by its name, a turn is one from where the thing looks now."""
        values = super().fields(what, form, asked)
        kinds = {field["kind"]: field["name"] for field in form}
        node = self.state.graph.nodes[self.thing(asked.get("of")).instance]
        if (name := kinds.get("joint")) is not None:
            values[name] = self._joint(node, str(values.get(name)))
        if (name := kinds.get("place")) is not None:
            turn = values.pop("turn_degrees", 0.0)
            if not isinstance(turn, int | float) or not math.isfinite(turn):
                raise UsageError(
                    f"edit {what}: turn_degrees: that is not a number", hint="leave it out, or give degrees"
                )
            to = values.get(name)
            if to is not None and not _is_place(to):
                raise UsageError(
                    f"edit {what}: {name}: that is not a place", hint="click where it goes, or give numbers"
                )
            values |= asked_move(node, to, turn)
        return values

    def _joint(self, node: GraphNode, name: str) -> dict[str, Any]:
        try:
            joints = joint_anchors(self.state, node)
        except Conflict as conflict:
            raise UsageError(str(conflict), hint="a new joint can be cut out of it") from None
        if name not in joints:
            raise UsageError(f"{node.id} has no joint {name!r:.80}", hint=f"it has: {', '.join(joints) or 'none'}")
        return joints[name].model_dump(mode="json")

    def facts(self) -> dict[str, Any]:
        """See Subject."""
        ids = {node.model_id for node in self.state.graph.nodes if node.model_id is not None}
        ids |= set() if self._library is None else {model.id for model in self._library.info.models}
        return super().facts() | {"models": sorted(ids)}

    def _facts_of(self, thing: Thing, node: GraphNode) -> dict[str, Any]:
        fields, before = super()._facts_of(thing, node), self.state.replacements.get(node.id)
        folder = None if node.model_id is None else self.state.model_folder(node.model_id)
        joints = [] if folder is None else list(read_model(folder).joints)
        held_joints = set() if before is None else set(before.held)
        tried = [] if before is None else [candidate.model_id for _, candidate in candidates_of(before)]
        return fields | {
            "joints": [
                {
                    "name": joint.name,
                    "says": f"{joint.type}, {joint.lower:.3g} to {joint.upper:.3g}, at "
                    f"{node.joints.get(joint.name, 0.0):.3g}" + (", held" if joint.name in held_joints else ""),
                }
                for joint in joints
            ],
            "models": list(dict.fromkeys(tried)),
        }

    def command(self) -> str:
        """See Subject."""
        input_options = [("--library", self._library), ("--panoptic-map", self._map)]
        return super().command() + "".join(
            f" {option} {artifact.root}" for option, artifact in input_options if artifact is not None
        )


def _is_place(value_given: object) -> bool:
    return (
        isinstance(value_given, list | tuple)
        and len(value_given) == 3
        and all(isinstance(value, int | float) and math.isfinite(value) for value in value_given)
    )
