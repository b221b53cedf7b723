"""What was decided, in the form of the files: scene.json and graph.json."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.cad_scene import CadCandidate, CadSceneFile, Inferred, JointEvidence, Replacement
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.scene_parts import TREE_RELATIONS
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.cad.arranging import Arrangement, shifted_box
from scenewright.stages.cad.candidates import Shortlist
from scenewright.stages.cad.conflicts import Selection
from scenewright.stages.cad.model_surfaces import ModelSurface
from scenewright.stages.cad.placing import placed_box, placed_planes
from scenewright.stages.cad.scene_explanation import Explanation
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.cad.stretching import source_of
from scenewright.stages.kit.formats.mobility import mobility
from scenewright.stages.kit.geometry.planes import moved_planes
from scenewright.stages.kit.geometry.transforms import transform_from


def candidate_record(placement: Placement, explained: float | None = None) -> CadCandidate:
    """Return a placement as it is written; `explained`: the share of what was seen that it explains, where known."""
    return CadCandidate(
        model_id=placement.shape.model.id,
        stretched_from=source_of(placement.shape.model),
        joints=placement.shape.joints,
        scale=placement.scale,
        world_from_model=as_transform(transform_from(placement.rotation, placement.translation)),
        matching_error=placement.matching_error,
        alignment_error=placement.alignment_error,
        score=placement.score,
        explained=explained,
    )


def scene_file(
    graph: ContactGraphFile,
    final: ContactGraphFile,
    shortlists: dict[str, Shortlist],
    arranged: Arrangement,
    colors: dict[str, dict[str, tuple[int, int, int]]],
    evidence: dict[str, dict[str, JointEvidence]],
    inferred: dict[str, Inferred],
    explanation: Explanation,
    selection: Selection,
    conflicts_after: int,
    gain: float,
) -> CadSceneFile:
    """Return scene.json: the decision on every node.

    `final`: cg'; `colors`: node -> part -> colour in the map; `evidence`: node -> joint -> why it is believed, for the
    nodes where that was asked; `inferred`: node -> what is added to its mesh; `gain`: by how much light was multiplied.
    """
    replacements = []
    for node in graph.nodes:
        if node.node_type == "layout":
            replacements.append(Replacement(node=node.id, decision="layout"))
        elif node.id in arranged.placements:
            entry, placement = shortlists[node.id], arranged.placements[node.id]
            seen, shares = explanation.things.get(node.id), dict(explanation.next_models.get(node.id, {}))
            chosen = candidate_record(placement, None if seen is None else seen.by_model)
            others = [
                candidate_record(p, shares.pop(p.shape.model.id, None))
                for p in entry.placements
                if p.score != placement.score
            ]
            first = candidate_record(entry.placements[0])
            replacements.append(
                Replacement(
                    node=node.id,
                    decision="cad",
                    reason=entry.reason,
                    chosen=chosen,
                    best_single=first,
                    part_colors=colors[node.id],
                    alternatives=tuple(others),
                    rejected=entry.rejected,
                    inferred=inferred.get(node.id),
                    explained=explanation.things.get(node.id),
                    joint_evidence=evidence.get(node.id),
                    tries=entry.tries,
                    stays=stays_why(final, node, None),
                )
            )
        elif node.id in shortlists:
            entry = shortlists[node.id]
            went = float(np.linalg.norm(arranged.shifts.get(node.id, 0.0)))
            reason = f"{entry.reason}; moved by {1000 * went:.0f} mm" if went > 5e-4 else entry.reason
            added = inferred.get(node.id)
            replacements.append(
                Replacement(
                    node=node.id,
                    decision="mesh",
                    reason=reason,
                    rejected=entry.rejected,
                    tries=entry.tries,
                    stays=stays_why(final, node, added),
                    inferred=added,
                    explained=explanation.things.get(node.id),
                )
            )
    return CadSceneFile(
        replacements=tuple(replacements),
        conflicts_before=selection.conflicts_before,
        conflicts_after=conflicts_after,
        iterations=selection.steps,
        explained_within=explanation.within,
        light_gain=None if gain == 1.0 else gain,
    )


def stays_why(final: ContactGraphFile, node: GraphNode, inferred: Inferred | None) -> str:
    """Return why a thing is held, or free, by cg' and by what is added to it."""
    carriable = {entry.name for entry in load_vocabulary().classes if entry.movable}
    mobile = mobility(final, final.node(node.id), carriable, ())
    if mobile.movable and inferred is not None and not inferred.pieces:
        return f"held: {inferred.because}"
    return f"{'free' if mobile.movable else 'held'}: {mobile.why}"


def cad_graph(graph: ContactGraphFile, arranged: Arrangement, surfaces: dict[str, ModelSurface]) -> ContactGraphFile:
    """Return cg': the same nodes and relations, with model, pose, scale, joints, and the model's box and planes."""
    nodes: list[GraphNode] = []
    for node in graph.nodes:
        placement = arranged.placements.get(node.id)
        if placement is None:
            nodes.append(shifted_node(node, arranged.shifts[node.id]) if node.id in arranged.shifts else node)
            continue
        nodes.append(
            node.model_copy(
                update={
                    "box": placed_box(placement, surfaces[placement.shape.model.id]),
                    "planes": placed_planes(placement),
                    "model_id": placement.shape.model.id,
                    "world_from_model": as_transform(transform_from(placement.rotation, placement.translation)),
                    "scale": placement.scale,
                    "joints": dict(placement.shape.joints),
                }
            )
        )
    links = tuple(
        arranged.relations.get(link.target, link)
        if link.relation in TREE_RELATIONS
        else link.model_copy(update={"plane": None})  # it counted the planes that were seen, not the model's
        for link in graph.links
    )
    return graph.model_copy(update={"nodes": tuple(nodes), "links": links})


def shifted_node(node: GraphNode, shift: np.ndarray) -> GraphNode:
    """Return a node with a box whose mesh went by `shift` (3,) [m]."""
    assert node.box is not None  # nothing else goes
    planes = moved_planes(node.planes, np.eye(3), shift)
    return node.model_copy(update={"box": shifted_box(node.box, shift), "planes": planes})
