"""CAD libraries: every model on a grid by class; articulated ones open and close over time; what each is good for."""

from __future__ import annotations

import numpy as np
from scenewright.cli.viewing.affordance_view import affordance_table, draw_affordances
from scenewright.schemas.cad_library import CadLibrary, CadModel
from scenewright.stages.kit.drawing.palette import instance_color
from scenewright.stages.kit.formats.cad_models import load_visual_parts, model_folder, part_transforms
from scenewright.stages.kit.geometry.boxes import box_from_bounds
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.kit.viewing.canvas import Canvas

GAP = 0.4
"""Gap between two models [m]; by eye."""
SWING_STEPS = 12
"""Steps in which a joint is shown to move."""


def draw_cad_library(library: CadLibrary, canvas: Canvas) -> None:
    """Draw a row of models for each class; scrub `opening` (0..1) to move the joints."""
    models = library.info.models
    places = row_places(models)
    uses = {entry.model: entry for entry in library.info.affordances}
    for model in models:
        entity = f"library/{model.class_name}/{model.id}"
        canvas.transform(entity, transform_from(np.eye(3), places[model.id]))
        for part, mesh in load_visual_parts(model_folder(library, model.id)).items():
            canvas.mesh(f"{entity}/{part}", mesh)
        if model.id in uses:
            draw_affordances(entity, model, uses[model.id], canvas)
        state = model.states[0]
        box = box_from_bounds(state.box_minimum, state.box_maximum)
        canvas.boxes(
            f"{entity}/box", [box], [model.id], [instance_color(1 + sorted_classes(models).index(model.class_name))]
        )
    reach = np.array([places[m.id] + np.array(m.states[0].box_maximum) for m in models] or [np.ones(3)])
    canvas.enclose(np.zeros(3), reach.max(axis=0))
    if table := affordance_table(library):
        canvas.document("affordances", table)
    moving = [model for model in models if model.joints]
    for step in range(SWING_STEPS + 1) if moving else ():
        share = step / SWING_STEPS
        canvas.time(share, timeline="opening")
        for model in moving:
            values = {joint.name: share * joint.upper for joint in model.joints}
            for part, model_from_part in part_transforms(model, values).items():
                canvas.transform(f"library/{model.class_name}/{model.id}/{part}", model_from_part)


def sorted_classes(models: tuple[CadModel, ...]) -> list[str]:
    """Return the class names, sorted."""
    return sorted({model.class_name for model in models})


def row_places(models: tuple[CadModel, ...]) -> dict[str, np.ndarray]:
    """Return model id -> where its frame stands (3,) [m]: classes one behind the other, models side by side."""
    places: dict[str, np.ndarray] = {}
    y = 0.0
    for name in sorted_classes(models):
        row = [model for model in models if model.class_name == name]
        bounds = [(np.array(model.states[0].box_minimum), np.array(model.states[0].box_maximum)) for model in row]
        y += max(-low[1] for low, _ in bounds)
        x = 0.0
        for model, (low, high) in zip(row, bounds, strict=True):
            x -= low[0]
            places[model.id] = np.array([x, y, 0.0])
            x += high[0] + GAP
        y += max(high[1] for _, high in bounds) + 2 * GAP
    return places
