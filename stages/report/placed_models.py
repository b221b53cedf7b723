"""CAD models where candidates put them: meshes to draw and convex pieces to compare."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.cad_library import CadLibrary, CadModel
from scenewright.schemas.cad_scene import CadCandidate, CadScene
from scenewright.stages.kit.formats.cad_models import posed_collision, read_model
from scenewright.stages.kit.formats.painted_models import painted_mesh
from scenewright.stages.kit.measurement.convex_overlap import ConvexPiece, convex_piece


class ModelShelf:
    """Finds models by id: the CAD scene has copies of the chosen ones, the library (where it is given) has all."""

    def __init__(self, cad_scene: CadScene, library: CadLibrary | None = None) -> None:
        self._roots = [cad_scene.path("models")] + ([library.path("models")] if library is not None else [])
        self._models: dict[str, CadModel] = {}
        self._pieces: dict[tuple[object, ...], list[ConvexPiece]] = {}

    def folder(self, model_id: str) -> Path | None:
        """Return the folder of a model, None when nobody has it."""
        return next((root / model_id for root in self._roots if (root / model_id).is_dir()), None)

    def _model(self, folder: Path) -> CadModel:
        if folder.name not in self._models:
            self._models[folder.name] = read_model(folder)
        return self._models[folder.name]

    def mesh(
        self, candidate: CadCandidate, colors: Mapping[str, tuple[int, int, int]] | None = None
    ) -> trimesh.Trimesh | None:
        """Return the mesh of a candidate in the world, in its own colours or, where `colors` has its part, in those.

        None when its model is not there. Raises BadInput.
        """
        folder = self.folder(candidate.model_id)
        if folder is None:
            return None
        mesh = painted_mesh(folder, self._model(folder), candidate, colors)
        mesh.apply_transform(np.array(candidate.world_from_model))
        return mesh

    def pieces(self, candidate: CadCandidate) -> list[ConvexPiece]:
        """Return the convex collision pieces of a candidate in the world, none when its model is not there."""
        folder = self.folder(candidate.model_id)
        if folder is None:
            return []
        shape = (folder, candidate.scale, *sorted(candidate.joints.items()))
        if shape not in self._pieces:
            pieces = posed_collision(folder, self._model(folder), candidate.joints, candidate.scale)
            convex_pieces = [convex_piece(np.asarray(piece.vertices)) for piece in pieces]
            self._pieces[shape] = [piece for piece in convex_pieces if piece is not None]
        return [piece.placed(np.array(candidate.world_from_model)) for piece in self._pieces[shape]]
