"""Declaration of `cad`: replace reconstructed objects by CAD models."""

from __future__ import annotations

from typing import Literal

from pydantic import Field
from scenewright.schemas.articulations import Articulations
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.kit.estimates import grows_with
from scenewright.stages.kit.stage import Optionally, Parameters, Stage


class CadParameters(Parameters):
    """Defaults are the thesis's constants where it states them, its released code's where it does not (PROTOCOLS 3)."""

    method: Literal["ours", "thesis"] = Field(
        "ours",
        description="`thesis`: section 2.4 as written; `ours`: also refines poses and joints on the vertices, "
        "and weighs the size",
    )
    candidates: int = Field(10, ge=1, description="Oriented candidates kept after matching")
    matched: int = Field(
        160, ge=1, description="ours: oriented candidates screened against the vertices before the alignment"
    )
    screening: int = Field(
        2, ge=1, description="ours: factor of candidates aligned; those with the least alignment error are kept"
    )
    size_weight: float = Field(1.0, ge=0.0, description="omega_1 of the matching error (2.7): relative size")
    plane_weight: float = Field(1.0, ge=0.0, description="omega_2 of the matching error (2.7): surface planes")
    upright_weight: float = Field(0.2, ge=0.0, description="omega_3 of the matching error (2.7): not upright")
    unmatched_plane: float = Field(
        1.0,
        ge=0.0,
        description="ours: matching error of an unmatched plane (`thesis` rejects models with fewer planes)",
    )
    minimum_scale: float = Field(0.6, gt=0.0, description="Minimum scale of a CAD model")
    maximum_scale: float = Field(1.6, gt=0.0, description="Maximum scale of a CAD model")
    support_weight: float = Field(8.0, ge=0.0, description="Alignment: weight of supporting planes' offsets")
    offset_weight: float = Field(5.0, ge=0.0, description="Alignment: weight of other planes' offsets")
    angle_weight: float = Field(5.0, ge=0.0, description="Alignment: weight of planes' angles")
    containment_weight: float = Field(0.5, ge=0.0, description="Alignment: weight of the footprint outside the box")
    height_weight: float = Field(2.0, ge=0.0, description="Alignment: weight of the height difference")
    evaluations: int = Field(1000, ge=1, description="Alignment: most evaluations of the residuals")
    vertices: int = Field(1500, ge=10, description="Vertices of a thing drawn for the alignment error")
    misfit_weight: float = Field(
        0.05, ge=0.0, description="ours: weight of the difference in extent from the observed box"
    )
    tilt_weight: float = Field(
        0.02, ge=0.0, description="ours: weight of the tilt (2.10); furniture only stands upright"
    )
    free_space_weight: float = Field(
        0.5, ge=0.0, description="ours: weight of the model's surface in observed free space"
    )
    scale_weight: float = Field(
        0.03, ge=0.0, description="ours: weight of |ln(scale)|; models of the library have real sizes"
    )
    carrying_weight: float = Field(0.1, ge=0.0, description="ours: weight of the height by which children would move")
    facing_weight: float = Field(0.004, ge=0.0, description="ours: weight of a front that faces the wall behind it")
    choice_margin: float = Field(
        0.01,
        ge=0.0,
        description="ours: largest score difference from the best over which min-conflicts exchanges candidates [m]",
    )
    maximum_alignment_error: float = Field(0.08, gt=0.0, description="ours: maximum alignment error of a candidate [m]")
    area_threshold: float = Field(
        0.5, ge=0.0, le=1.0, description="b_th: least share of a child's footprint over the CAD model's surface"
    )
    support_tolerance: float = Field(
        0.12, gt=0.0, description="Largest height difference of a child's old and new supporting surface [m]"
    )
    wall_penetration: float = Field(
        0.15,
        ge=0.0,
        description="Maximum penetration of a wall [m]; ours: by parts and built-ins, as models are put before it",
    )
    collision_tolerance: float = Field(0.015, ge=0.0, description="Penetration from which two things collide [m]")
    conflict_iterations: int = Field(50, ge=0, description="Most steps of min-conflicts")
    maximum_shift: float = Field(
        0.08, ge=0.0, description="ours: maximum shift that resolves a collision, 0 for none [m]"
    )
    resting_tolerance: float = Field(0.002, ge=0.0, description="ours: penetration aimed at in the finished scene [m]")
    vouched: tuple[str, ...] = Field(
        (),
        description="ours: nodes (fridge_3) and classes whose joints are believed without evidence; others "
        "need motion, an open part, a handle or a seam",
    )
    recognition_error: float = Field(
        0.028,
        ge=0.0,
        description="ours: maximum error at which a thing takes the class of a model of another class; 0 for never [m]",
    )
    recognition_margin: float = Field(
        0.01, ge=0.0, description="ours: least margin of that error to all other classes [m]"
    )
    built_ins: bool = Field(
        True, description="ours: replace a thing without model by boxes fitted to it, where these explain its surface"
    )
    families: bool = Field(
        True,
        description="ours: build a table, chair or shelf of parts fitted to its surface where no model explains it",
    )
    stretched: bool = Field(
        True, description="ours: stretch a model along its own axes where none has the size of the thing"
    )
    shell: bool = Field(
        True, description="ours: close floor, walls and ceiling to a shell with its openings, where the map tells them"
    )
    surroundings: bool = Field(True, description="ours: keep unlabelled surface of the map as a static body")
    surroundings_clearance: float = Field(
        0.03, ge=0.0, description="Unlabelled surface this near to an entity belongs to its rim [m]"
    )
    surroundings_area: float = Field(
        0.02, ge=0.0, description="Smallest connected unlabelled surface that is kept [m²]"
    )


STAGE = Stage(
    name="cad",
    summary="Replace things by CAD models that fit, stand on their supports and do not collide",
    parameters=CadParameters,
    reads={
        "contact_graph": ContactGraph,
        "panoptic_map": PanopticMap,
        "library": CadLibrary,
        "articulations": Optionally(Articulations),
    },
    writes=CadScene,
    libraries=("numpy", "scipy", "trimesh", "python-fcl", "numba"),
    example="scenewright cad --contact-graph outputs/demo/contact_graph --panoptic-map outputs/demo/panoptic_map "
    "--library outputs/demo/cad_library --out outputs/demo/cad_scene",
    estimate=grows_with("panoptic_map", 0.6, 0.28, 490, 0.0),
)
