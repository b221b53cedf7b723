"""Wiring of `edit graph`: a contact graph and what a person put right become another contact graph."""

from __future__ import annotations

from pathlib import Path

from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.scene_parts import CARRYING
from scenewright.stages.edit.anchoring import Fitting
from scenewright.stages.edit.applying import apply_edits
from scenewright.stages.edit.edits_file import read_edits
from scenewright.stages.edit.graph_edits import GRAPH_EDITS, GraphState
from scenewright.stages.edit.outcome import outcome_of, write_records
from scenewright.stages.edit.parameters import EditMapParameters
from scenewright.stages.kit.stage import Context


def run(contact_graph: ContactGraph, edits: Path, *, parameters: EditMapParameters, context: Context) -> ContactGraph:
    """Apply the edits of graphs in their order and write the graph that results, and what became of each (edits.json).

    The outcome is `conflicts` when an edit was not applied. The timeline is left out: it is of before.
    Raises BadInput when the edits or the graph are broken.
    """
    edits_file = read_edits(edits)
    state = GraphState(contact_graph.info)
    with context.progress.step("apply the edits"):
        records = apply_edits(state, edits_file.edits, Fitting(**parameters.model_dump()), GRAPH_EDITS)
    state.graph.write(context.output / "graph.json")
    summary = write_records(records, len(edits_file.edits), context)
    summary |= {
        "nodes": len(state.graph.nodes) - 1,
        "pinned": sum(record.what == "support" and record.status != "conflict" for record in records),
        "marked": sum(node.mark is not None for node in state.graph.nodes),
        "supports": sum(link.relation in CARRYING for link in state.graph.links),
    }
    return ContactGraph(context.output, outcome=outcome_of(records), summary=summary)
