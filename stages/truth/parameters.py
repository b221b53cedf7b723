"""Declarations of the steps `truth scenenn`, `truth supports` and `truth edited`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.sequence import Sequence
from scenewright.stages.kit.stage import External, Optionally, Parameters, Stage

WORDS = "annotations/scenenn.toml"
"""File below data/ that says which annotated words are which class."""


class SceneNNParameters(Parameters):
    """How an annotation is read."""

    matching: Literal["thesis", "words"] = Field(
        "thesis",
        description="Class of a label: `words`: the last word of its text or nyu_class; `thesis`: a class's "
        "word anywhere (a `table lamp` is a table)",
    )
    name: str = Field("", pattern=r"^[A-Za-z0-9_.\-]*$", description="Name of the scene; default: that of the XML file")
    maximum_unlisted: float = Field(
        0.05, ge=0, le=1, description="Largest share of the vertices whose label the XML may not list; these are void"
    )


class SupportsParameters(Parameters):
    """How the things of a support annotation are found."""

    every: int = Field(1, ge=1, description="Use every n-th frame")
    maximum_depth: float = Field(4.0, gt=0, description="Maximum depth [m]")
    point_reach: float = Field(
        0.1, gt=0, le=1, description="Largest distance of a node's point from its entity in the map [m]"
    )
    outline_reach: float = Field(
        0.05, gt=0, le=1, description="Largest distance of a point from its frame's depth to be inside an outline [m]"
    )


class EditedParameters(Parameters):
    """How an edited scene is called as an annotation."""

    name: str = Field("", pattern=r"^[A-Za-z0-9_.\-]*$", description="Name of the scene")


SCENENN = Stage(
    name="truth scenenn",
    summary="Make ground truth out of SceneNN's annotation, in the world frame of a sequence of that scene",
    parameters=SceneNNParameters,
    reads={
        "annotation": External("<scene>.xml of SceneNN"),
        "mesh": External("<scene>.ply of the same annotation, with a label per vertex"),
        "sequence": Sequence,
    },
    writes=GroundTruth,
    libraries=("numpy", "scipy", "trimesh"),
    data_files=lambda parameters: (WORDS,),
    example="scenewright truth scenenn --annotation scenenn/011/011.xml --mesh scenenn/011/011.ply "
    "--sequence outputs/011/sequence --out outputs/011/ground_truth",
)

SUPPORTS = Stage(
    name="truth supports",
    summary="Make ground truth with a contact graph out of a support annotation (JSON) of a real sequence",
    parameters=SupportsParameters,
    reads={
        "annotation": External("support annotation, JSON (docs/FORMATS.md)"),
        "sequence": Sequence,
        "panoptic_map": Optionally(PanopticMap),
        "outlines": Optionally(External("outlines of its nodes painted in frames, JSON (docs/FORMATS.md)")),
    },
    writes=GroundTruth,
    libraries=("numpy", "scipy"),
    module="supports",
    example="scenewright truth supports --annotation data/annotations/real/kitchen.json "
    "--sequence outputs/kitchen/sequence --out outputs/kitchen/ground_truth",
)

EDITED = Stage(
    name="truth edited",
    summary="Make ground truth out of a map, graph and scene that somebody put right by hand (`edit`)",
    parameters=EditedParameters,
    reads={
        "sequence": Sequence,
        "panoptic_map": PanopticMap,
        "contact_graph": ContactGraph,
        "cad_scene": Optionally(CadScene),
    },
    writes=GroundTruth,
    libraries=("numpy", "scipy", "trimesh"),
    module="edited",
    example="scenewright truth edited --sequence outputs/room/sequence --panoptic-map outputs/room/edited_map "
    "--contact-graph outputs/room/edited_graph --out outputs/room/ground_truth",
)

STAGES = (SCENENN, SUPPORTS, EDITED)
