"""Other people's models: imported by `library add` from where they lie, and what a person would call them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.cad_library import CadLibrary
from scenewright.stages.kit.formats.cad_models import model_folder, posed_mesh, read_model

from benchmarks.steps import made, opened

FOLDERS = {
    "aws": ("aws_furniture", ()),
    "mjcf": ("furniture_mjcf", ()),
    "dinner": ("dinnerware", ()),
    "shapenet": ("scan2cad_sample/shapenet-sample", ("--unknown", "object")),
}
"""Short name -> folder of the data, options of `library add`."""
SHAPENET_CLASSES = """[models]
"03001627/*" = {class_name = "chair", unit = "m"}
"04379243/*" = {class_name = "table", unit = "m"}
"02747177/*" = {class_name = "bin", unit = "m"}
"""
"""ShapeNet's names are numbers of categories; the unit is that in which the models furnish."""
AWS = "aws_robomaker_residential_"


@dataclass(frozen=True)
class Model:
    """A model to furnish with. `turn` [degrees] about z brings its front to -y; `scale` makes it as large as usual."""

    folder: str
    id: str
    class_name: str
    turn: float = 0.0
    scale: float = 1.0


MODELS: Mapping[str, Model] = {
    "balcony_table": Model("aws", AWS + "BalconyTable_01", "table"),
    "bed": Model("aws", AWS + "Bed_01", "bed"),
    "chair_a": Model("aws", AWS + "ChairA_01", "chair"),
    "chair_d": Model("aws", AWS + "ChairD_01", "chair"),
    "coffee_table": Model("aws", AWS + "CoffeeTable_01", "table"),
    "kitchen_unit": Model("aws", AWS + "KitchenCabinet_01", "cabinet"),
    "kitchen_table": Model("aws", AWS + "KitchenTable_01", "table", 90.0),
    "night_stand": Model("aws", AWS + "NightStand_01", "cabinet"),
    "reading_desk": Model("aws", AWS + "ReadingDesk_01", "desk", 90.0),
    "fridge": Model("aws", AWS + "Refrigerator_01", "fridge"),
    "shoe_rack": Model("aws", AWS + "ShoeRack_01", "shelf"),
    "sofa": Model("aws", AWS + "SofaC_01", "sofa"),
    "tv_cabinet": Model("aws", AWS + "TVCabinet_01", "cabinet", 90.0),
    "tv": Model("aws", AWS + "TV_02", "monitor", 90.0),
    "trash": Model("aws", AWS + "Trash_01", "bin"),
    "wardrobe": Model("aws", AWS + "Wardrobe_01", "wardrobe"),
    "plate": Model("dinner", "plate", "plate"),
    "pan": Model("dinner", "pan_tefal", "pan"),
    "cup": Model("dinner", "cup_small", "cup", 0.0, 1.5),
    "box_cabinet": Model("mjcf", "boxcabinet", "cabinet"),
    "dishwasher": Model("mjcf", "dishwasher", "dishwasher"),
    "kettle_a": Model("mjcf", "kettle_kettleroot0", "kettle"),
    "kettle_b": Model("mjcf", "kettle_kettleroot2", "kettle"),
    "kettle_c": Model("mjcf", "kettle_kettleroot5", "kettle"),
    "microwave": Model("mjcf", "microwave", "microwave"),
    "study_table": Model("mjcf", "studyTable", "table"),
    "wood_table": Model("mjcf", "simpleTable_simpleWoodTable", "table"),
    "vention_table": Model("mjcf", "ventionTable", "table"),
    "crate": Model("mjcf", "bin_bin_1", "bin"),
    "clock": Model("mjcf", "wallclock", "clock", 0.0, 0.6),
    "side_table": Model("shapenet", "model_normalized_6", "table"),
    "chair_s": Model("shapenet", "model_normalized_4", "chair"),
}


def absent(data: Path) -> list[str]:
    """Return the folders of models that are not there."""
    return [place for place, _ in FOLDERS.values() if not (data / place).is_dir()]


def import_all(data: Path, out: Path) -> None:
    """Import every folder of models into `out` unless that is up to date. Raises StepFailed."""
    for name, (place, options) in FOLDERS.items():
        made("library add", out / name, data / place, *options)


def imported(out: Path) -> dict[str, CadLibrary]:
    """Return what `import_all` made."""
    return {name: opened(CadLibrary, out / name) for name in FOLDERS}


def own_library(data: Path, out: Path, library: Path) -> Path:
    """Return `out`/library: a library with every folder of models added, named as a person would.

    Raises StepFailed.
    """
    out.mkdir(parents=True, exist_ok=True)
    named = out / "shapenet.toml"
    named.write_text(SHAPENET_CLASSES, encoding="utf-8")
    *_, last = FOLDERS
    for name, (place, options) in FOLDERS.items():
        said = ("--mapping", named) if name == "shapenet" else options
        target = out / ("library" if name == last else name)
        library = made("library add", target, data / place, *said, "--library", library)
    return library


def mesh_of(libraries: Mapping[str, CadLibrary], model: Model) -> trimesh.Trimesh:
    """Return a model [m]: z up, front along -y, the origin at the centre of the bottom of its box."""
    folder = model_folder(libraries[model.folder], model.id)
    mesh = posed_mesh(folder, read_model(folder), {}, model.scale)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(model.turn), (0, 0, 1)))
    (x_low, y_low, low), (x_high, y_high, _) = mesh.bounds
    mesh.apply_translation((-(x_low + x_high) / 2, -(y_low + y_high) / 2, -low))
    return mesh
