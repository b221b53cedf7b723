"""What can be put right of a contact graph."""

from __future__ import annotations

from typing import Any, ClassVar

from scenewright.cli.viewing.desk.subject import Subject
from scenewright.cli.viewing.inputs import input_artifact
from scenewright.schemas.contact_graph import ContactGraph, GraphNode
from scenewright.schemas.edits import Anchor
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.edit.anchoring import anchor_of_node, written_box
from scenewright.stages.edit.applying import Table
from scenewright.stages.edit.graph_edits import GRAPH_EDITS, GraphState
from scenewright.stages.edit.map_state import Thing
from scenewright.stages.kit.viewing.canvas import Canvas
from scenewright.stages.kit.viewing.graphs import draw_graph_over


class GraphSubject(Subject[GraphState]):
    """A contact graph."""

    all_edits: ClassVar[Table[Any]] = GRAPH_EDITS
    option = "graph --contact-graph"

    def begun(self) -> GraphState:
        """See Subject."""
        assert isinstance(self.artifact, ContactGraph)
        return GraphState(self.artifact.info)

    def anchor_of(self, thing: Thing) -> Anchor:
        """See Subject."""
        return anchor_of_node(thing)

    def draw(self, canvas: Canvas) -> None:
        """See Subject."""
        draw_graph_over(self.state.graph, input_artifact(self.artifact, PanopticMap), canvas)

    def facts(self) -> dict[str, Any]:
        """See Subject."""
        nodes = self.state.graph.nodes
        return {"things": {nodes[k.instance].id: self._facts_of(k, nodes[k.instance]) for k in self.state.things()}} | {
            "models": []
        }

    def _facts_of(self, thing: Thing, node: GraphNode) -> dict[str, Any]:
        link = self.state.graph.parent_link(node.id)
        stands = "" if link is None else link.says
        words = [word for word in (stands, node.mark and f"marked {node.mark}", node.model_id) if word]
        return {"box": written_box(thing.box).model_dump(), "says": "; ".join(words)}
