"""A small room as a CAD scene, with the library, the map and the graph that it is made of."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.stages.cad.parameters import CadParameters
from scenewright.stages.cad.stage import run as run_cad
from scenewright.stages.graph.parameters import GraphParameters
from scenewright.stages.graph.stage import run as run_graph
from scenewright.stages.kit.formats.cad_models import load_collision_parts, read_model
from scenewright.stages.kit.formats.model_writer import PartGeometry, write_model_folder
from scenewright.stages.kit.geometry.solids import hull, mass_properties

from tests.panoptic_maps import box_mesh, floor_mesh, seen_surface, write_map
from tests.unit.cad.conftest import context
from tests.unit.cad.models import block, chair, fridge, table, write_library
from tests.unit.cad.test_cad_stage import EYES, mesh_of
from tests.unit.viewing.artifacts import seal


def write_urdf_of(folder: Path) -> None:
    """Write a model folder again, with the URDF that the scene's tree is made of."""
    parts = []
    for name, pieces in load_collision_parts(folder).items():
        solids = [hull(np.asarray(piece.vertices)) for piece in pieces]
        grey = [(150, 150, 150)] * len(solids)
        parts.append(PartGeometry(name, solids, grey, mass_properties(solids, [300.0] * len(solids))))
    model = read_model(folder)
    write_model_folder(folder, model, sorted(parts, key=lambda part: model.parts.index(part.name)))


def scene_room(root: Path, built_ins: bool = False) -> dict[str, Path]:
    """A table with a box on it, a fridge, and a cabinet that no model fits: library, map, graph and CAD scene.

    Without `built_ins` the cabinet keeps its mesh.
    """
    library = write_library(
        root / "library",
        {
            "chair_low": chair(0.44, 0.45, 0.90),
            "table_long": table(1.4, 0.7, 0.74),
            "table_square": table(0.8, 0.8, 0.74),
            "fridge_tall": fridge(0.6, 0.65, 1.6, (0.4, 0.8, 1.2)),
            "box_cube": block("box", 0.2, 0.2, 0.2),
        },
    )
    for model in library.info.models:
        write_urdf_of(root / "library" / "models" / model.id)
    meshes = {
        1: floor_mesh((-1.6, -1.4), (1.6, 1.6)),
        2: mesh_of(library, "table_long", (-0.5, 0.6, 0), 0.2),
        3: mesh_of(library, "fridge_tall", (1.0, 1.0, 0), 0.0),
        4: mesh_of(library, "box_cube", (-0.7, 0.6, 0.74), 0.5),
        5: box_mesh((-1.2, -1.2, 0.0), (-0.4, -0.8, 0.9)),
    }
    classes = {1: "floor", 2: "table", 3: "fridge", 4: "box", 5: "cabinet"}
    made = write_map(root / "map", seen_surface(meshes, [*EYES, (0.9, -0.6, 1.2)], noise=0.003), classes)
    graph = run_graph(made, parameters=GraphParameters(), context=context(root / "graph"))
    run_cad(graph, made, library, parameters=CadParameters(built_ins=built_ins), context=context(root / "cad"))
    made_of = {
        "library": ("cad_library", ()),
        "map": ("panoptic_map", ()),
        "graph": ("contact_graph", ("map",)),
        "cad": ("cad_scene", ("graph", "map", "library")),
    }
    for name, (kind, inputs) in made_of.items():
        if not (root / name / "manifest.json").exists():
            seal(root / name, kind, **{role: root / role for role in inputs})
    return {name: root / name for name in made_of}
