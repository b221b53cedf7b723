"""Kind `contact_graph`: the parse tree of supports and the proximal relations (Han 2024, section 2.2)."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field
from scenewright.schemas.artifact import Artifact, Document, OptionalDocument
from scenewright.schemas.base import Model, Name, RelativePath, Transform
from scenewright.schemas.edits import AppliedEditsFile
from scenewright.schemas.scene_parts import TREE_RELATIONS, Box, Relation, SurfacePlane

SCENE_NODE = "scene"


class GraphNode(Model):
    """A node <o, c, M, B, Pi>. The scene root has neither mesh nor box."""

    id: Name
    """`<class>_<instance>`, unique; `scene` for the root."""
    instance: int
    """Instance label o in the panoptic map or ground truth; 0 for the scene root."""
    class_name: str
    node_type: Literal["scene", "layout", "rigid", "articulated"]
    mesh: RelativePath | None = None
    """M: path inside the panoptic map artifact (`entities/<instance>.ply`), or None."""
    box: Box | None = None
    """B, gravity-aligned, world frame, after refinement."""
    box_observed: Box | None = None
    """B before refinement onto the supporting plane."""
    planes: tuple[SurfacePlane, ...] = ()
    """Pi, world frame."""
    confidence: float = 1.0
    mark: Literal["fixed", "movable"] | None = Field(default=None, exclude_if=lambda mark: mark is None)
    """What a person said (`edit mark`); absent where nobody did: the class decides then."""
    # What cg' adds (kind cad_scene): which model stands for the node.
    model_id: Name | None = None
    world_from_model: Transform | None = None
    scale: float | None = None
    joints: dict[str, float] = {}


class ContactGraphFile(Model):
    """graph.json: node-link form (networkx.node_link_graph(edges="links") reads it)."""

    directed: bool = True
    multigraph: bool = True
    graph: dict[str, str] = {}
    nodes: tuple[GraphNode, ...]
    links: tuple[Relation, ...]

    def check_read(self) -> None:
        """Raise ValueError unless it has each node once, and relations of nodes and planes it has."""
        nodes = {node.id: node for node in self.nodes}
        if len(nodes) < len(self.nodes):
            raise ValueError("a node is there twice")
        for link in self.links:
            if link.source not in nodes or link.target not in nodes:
                raise ValueError(f"{link.source!r:.60} {link.relation} {link.target!r:.60}: no such node")
            if link.plane is not None and not 0 <= link.plane < len(nodes[link.source].planes):
                raise ValueError(f"{link.source} {link.relation} {link.target}: it has no plane {link.plane}")
            if link.relation == "unknown" and link.source != SCENE_NODE:
                raise ValueError(f"{link.source} unknown {link.target}: such a relation comes from {SCENE_NODE!r}")
        self._check_tree()

    def _check_tree(self) -> None:
        """Raise ValueError when the tree of supports leads in a circle."""
        parents = {link.target: link.source for link in self.links if link.relation in TREE_RELATIONS}
        standing = {SCENE_NODE}
        for node in self.nodes:
            above = [node.id]
            while above[-1] in parents and above[-1] not in standing:
                above.append(parents[above[-1]])
                if len(above) > len(self.nodes):
                    raise ValueError(f"what {node.id!r} stands on leads in a circle")
            standing.update(above)

    def node(self, node_id: str) -> GraphNode:
        """Return the node with this id. Raises KeyError."""
        for entry in self.nodes:
            if entry.id == node_id:
                return entry
        raise KeyError(node_id)

    def parent_link(self, node_id: str) -> Relation | None:
        """Return the directed relation whose target is `node_id` (every node but the root has one)."""
        for link in self.links:
            if link.target == node_id and link.relation in TREE_RELATIONS:
                return link
        return None

    def children(self, node_id: str) -> tuple[str, ...]:
        """Return the ids of the nodes that `node_id` carries or contains."""
        return tuple(link.target for link in self.links if link.source == node_id and link.relation in TREE_RELATIONS)


class Reattached(Model):
    """A node that hangs elsewhere in the tree than it did."""

    node: Name
    parent: Name
    relation: str
    before_parent: Name
    before_relation: str


class Beside(Model):
    """A relation beside the tree that came or went."""

    source: Name
    target: Name
    relation: str


class GraphChanges(Model):
    """What is different from the snapshot before. Nodes by their lasting ids."""

    appeared: tuple[Name, ...] = ()
    vanished: tuple[Name, ...] = ()
    """Nodes whose surface no node holds any more."""
    merged: dict[Name, Name] = {}
    """Node that is gone -> node that most of its surface went to."""
    renamed: dict[Name, Name] = {}
    """Node -> the class that it had before."""
    reattached: tuple[Reattached, ...] = ()
    added: tuple[Beside, ...] = ()
    removed: tuple[Beside, ...] = ()

    @property
    def count(self) -> int:
        """How many things changed."""
        return sum(len(getattr(self, name)) for name in type(self).model_fields)


class GraphSnapshot(Model):
    """The contact graph after so many frames. Links and nodes by lasting ids; planes and meshes are left out."""

    frames: int
    nodes: tuple[GraphNode, ...]
    links: tuple[Relation, ...]
    changes: GraphChanges


class TimelineFile(Model):
    """timeline.json: the graph while the map grew. A node keeps its id throughout: the one that it has in the last
    snapshot in which it occurs (numbered where another node has it). The last snapshot is graph.json."""

    snapshots: tuple[GraphSnapshot, ...]


class ContactGraph(Artifact):
    """`graph.json`; where the map holds snapshots also `timeline.json`; where people put it right, `edits.json` says
    what became of each edit."""

    kind: ClassVar[str] = "contact_graph"
    description: ClassVar[str] = "contact graph: support tree and proximal relations, node-link JSON"
    info = Document(ContactGraphFile, "graph.json")
    timeline = OptionalDocument(TimelineFile, "timeline.json")
    edits = OptionalDocument(AppliedEditsFile, "edits.json")
