"""Make the CAD library: draw each model, measure it, write its folder."""

from __future__ import annotations

from scenewright.schemas.cad_library import CadLibrary, LibraryFile
from scenewright.schemas.errors import UsageError
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.model_writer import write_model_folder
from scenewright.stages.kit.stage import Context
from scenewright.stages.library.affordances import affordances
from scenewright.stages.library.design import centered
from scenewright.stages.library.families import GENERATORS
from scenewright.stages.library.modelling import closed_solids, describe, part_geometries
from scenewright.stages.library.parameters import LibraryParameters


def run(*, parameters: LibraryParameters, context: Context) -> CadLibrary:
    """Sample every class of furniture into several shapes and write them as CAD models.

    Raises UsageError for a class that has no generator.
    """
    vocabulary = load_vocabulary()
    unknown = [name for name in parameters.classes if name not in GENERATORS]
    if unknown:
        raise UsageError(f"no furniture of class {unknown[0]!r}", hint=f"one of: {', '.join(GENERATORS)}")
    work = []
    for stream, (class_name, generate) in enumerate(GENERATORS.items()):
        if parameters.classes and class_name not in parameters.classes:
            continue
        movable = vocabulary.by_name(class_name).movable
        count = parameters.small_shapes_per_class if movable else parameters.shapes_per_class
        work += [(stream, class_name, generate, movable, k) for k in range(count)]
    models, affordance_files = [], []
    for stream, class_name, generate, movable, k in context.progress.track(work, description="drawing furniture"):
        design = centered(generate(context.random(stream, k), k))
        model = describe(design, f"{class_name}_{k:02d}", movable)
        write_model_folder(context.output / "models" / model.id, model, part_geometries(design))
        models.append(model)
        affordance_files.append(affordances(model, closed_solids(design)))
    library = LibraryFile(seed=context.seed, models=tuple(models), affordances=tuple(affordance_files))
    library.write(context.output / "library.json")
    summary = {
        "models": len(models),
        "classes": len({model.class_name for model in models}),
        "articulated": sum(model.articulated for model in models),
        "joints": sum(len(model.joints) for model in models),
    }
    return CadLibrary(context.output, summary=summary)
