"""Samples out of rooms and libraries: what is known of their things, and single models rendered in several colours."""

from __future__ import annotations

import numpy as np
import trimesh
from scenewright.schemas.cad_library import CadLibrary, CadModel
from scenewright.schemas.ground_truth import TrueObject
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.formats.cad_models import model_folder, posed_mesh
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.part_colors import recolored, vertex_colors
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.kit.open_words.reading.colors import color_shares
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scenewright.stages.splat.training.words.lexicon import Lexicon, Thing
from scenewright.stages.splat.training.words.samples import RENDERED, Samples, numbered

from benchmarks.words.rooms import Furnished

PALETTE = (
    np.array(
        [
            (235, 235, 230),
            (150, 152, 156),
            (45, 46, 50),
            (190, 55, 50),
            (225, 130, 45),
            (235, 195, 70),
            (85, 145, 95),
            (60, 105, 170),
            (125, 85, 55),
            (215, 195, 160),
            (230, 150, 170),
            (120, 80, 150),
        ]
    )
    / 255.0
)


def gather(rooms: list[Furnished], libraries: list[CadLibrary], words: Lexicon, views: int, seed: int) -> Samples:
    """Return every picture of the rooms, and every model from `views` sides in its own colours and in two others."""
    things: list[Thing] = []
    frames, labels = [], []
    for room in rooms:
        models = {model.id: model for model in room.library.info.models}
        table = np.zeros(1 + max(entry.instance for entry in room.truth.info.objects), np.uint16)
        for entry in room.truth.info.objects:
            things.append(thing_of(entry, room.library, models))
            table[entry.instance] = len(things)
        with FrameReader(room.truth.path("log.mcap")) as reader:
            for index in range(len(reader)):
                frame = reader.read(index, ("color", "labels"))
                assert frame.color is not None and frame.labels is not None
                frames.append(frame.color)
                labels.append(table[frame.labels])
    sprites, masks, numbers = [], [], []
    for which, library in enumerate(libraries):
        for index, model in enumerate(library.info.models):
            for thing, pictures, shown in rendered(library, model, views, np.random.default_rng([seed, which, index])):
                things.append(thing)
                numbers.append(len(things))
                sprites.append(pictures)
                masks.append(shown)
    rows, held, styles = numbered(things, words)
    return Samples(
        frames=np.stack(frames),
        labels=np.stack(labels),
        sprites=np.stack(sprites),
        masks=np.stack(masks),
        sprite_things=np.array(numbers, np.int64),
        things=rows,
        held=held,
        held_style=styles,
    )


def thing_of(entry: TrueObject, library: CadLibrary, models: dict[str, CadModel]) -> Thing:
    """Return what is known of a thing of a room."""
    if entry.model_id is None:
        return Thing(entry.class_name)
    model = models[entry.model_id]
    mesh = posed_mesh(model_folder(library, entry.model_id), model, entry.joints, entry.scale)
    return Thing(entry.class_name, str(model.recipe.get("style", "")), _shares_of(mesh), float(max(entry.box.size)))


def _shares_of(mesh: trimesh.Trimesh) -> tuple[tuple[str, float], ...]:
    colors = vertex_colors(mesh)
    if colors is None:
        return ()
    return tuple(sorted(color_shares(np.asarray(colors, float)[:, :3] / 255.0, _corner_areas(mesh)).items()))


def _corner_areas(mesh: trimesh.Trimesh) -> np.ndarray:
    share = np.zeros(len(mesh.vertices))
    np.add.at(share, np.asarray(mesh.faces), np.repeat(mesh.area_faces[:, None] / 3.0, 3, axis=1))
    return share


def rendered(
    library: CadLibrary, model: CadModel, views: int, random: np.random.Generator
) -> list[tuple[Thing, np.ndarray, np.ndarray]]:
    """Return a model as it is and in two other colours: thing, pictures (V, RENDERED, RENDERED, 3) and masks."""
    mesh = posed_mesh(model_folder(library, model.id), model, {})
    colors = vertex_colors(mesh)
    if colors is None:
        return []
    own, found = np.asarray(colors, float)[:, :3] / 255.0, []
    for paint in (None, *random.permutation(len(PALETTE))[:2]):
        if paint is not None:
            changed = recolored(own, _corner_areas(mesh), PALETTE[paint] + random.uniform(-0.04, 0.04, 3))
            mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=np.round(255 * changed).astype(np.uint8))
        style = str(model.recipe.get("style", ""))
        thing = Thing(model.class_name, style, _shares_of(mesh), float(max(mesh.extents)))
        found.append((thing, *_pictures(mesh, views, random)))
    return found


def _pictures(mesh: trimesh.Trimesh, views: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    renderer = SceneRenderer([(1, mesh)], shadows=False, antialias=False)
    low, high = np.asarray(mesh.bounds)
    middle, reach = (low + high) / 2, 0.5 * float(np.linalg.norm(high - low))
    camera = Camera(width=RENDERED, height=RENDERED, fx=100.0, fy=100.0, cx=(RENDERED - 1) / 2, cy=(RENDERED - 1) / 2)
    pictures, masks = [], []
    for _ in range(views):
        around, up = random.uniform(-1.3, 1.3) - np.pi / 2, random.uniform(0.0, 0.9)
        away = np.array([np.cos(around) * np.cos(up), np.sin(around) * np.cos(up), np.sin(up)])
        distance = reach * 100.0 / (RENDERED / 2) * random.uniform(0.8, 1.5)
        z = -away
        x = np.cross(z, [0.0, 0.0, 1.0])
        x /= np.linalg.norm(x)
        pose = transform_from(np.stack([x, np.cross(z, x), z], axis=1), middle + distance * away)
        view = renderer.render(camera, pose)
        pictures.append(view.color)
        masks.append(view.instance == 1)
    return np.stack(pictures), np.stack(masks)
