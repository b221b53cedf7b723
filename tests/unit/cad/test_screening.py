"""Many placements of one shape at a time are measured as each by itself; pieces are read when they are asked for."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.cad.model_surfaces import load_surface, robust_error, robust_errors
from scenewright.stages.cad.shapes import Placement, shape_of_state
from scenewright.stages.kit.formats.cad_models import model_folder
from scipy.spatial.transform import Rotation


def test_together_as_each_alone(library):
    random = np.random.default_rng(0)
    models = {model.id: model for model in library.info.models}
    surfaces = {name: load_surface(model_folder(library, name), model) for name, model in models.items()}
    points = random.uniform(-0.5, 1.0, (90, 3))
    placements = []
    for _ in range(40):
        model = models[random.choice(["fridge_tall", "chair_low"])]
        shape = shape_of_state(model, model.states[random.integers(len(model.states))])
        turn = Rotation.random(random_state=random).as_matrix()
        placements.append(Placement(shape, random.uniform(0.7, 1.4), turn, random.uniform(-1, 1, 3), 0.0, 0.0, 0.0))
    together = robust_errors(surfaces, placements, points, 0.05)
    alone = [robust_error(surfaces[p.shape.model.id], p, points, None, 0.05) for p in placements]
    assert together == alone
    assert len(set(together)) > 5


def test_pieces_are_read_late(library, tmp_path):
    folder = tmp_path / "chair"
    shutil.copytree(model_folder(library, "chair_low"), folder)
    model = next(model for model in library.info.models if model.id == "chair_low")
    surface = load_surface(folder, model)
    shutil.rmtree(folder / "collision")
    assert surface.closest(np.zeros((1, 3)), {}).distance.shape == (1,)
    with pytest.raises(BadInput, match="collision"):
        surface.center_of_mass({})
