"""Training samples of the embedded encoder: crops of rooms and of single models, each with what is in it.

A crop of a room is labelled by the thing at its middle; other things that it shows are neither right nor wrong. Models
are rendered alone, half of them in another colour, and set before pieces of rooms.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import trimesh

from benchmarks.words.colors import color_shares
from benchmarks.words.lexicon import FALSE, Lexicon, Thing
from benchmarks.words.rooms import Furnished
from schemas.cad_library import CadLibrary, CadModel
from schemas.ground_truth import TrueObject
from schemas.scene_parts import Camera
from stages.kit.formats.cad_models import model_folder, posed_mesh
from stages.kit.formats.frames import FrameReader
from stages.kit.formats.part_colors import recolored, vertex_colors
from stages.kit.geometry.transforms import transform_from
from stages.kit.open_words.two_towers import SIDE
from stages.kit.rendering.ray_casting import SceneRenderer

LEAST_PIXELS = 40
"""Of a thing in a picture, for a crop about it."""
MAIN_SHARE = 0.3
"""Share, weighted towards the middle, of a crop from which on it shows its main thing."""
PRESENT_SHARE = 0.03
RENDERED = 48
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


@dataclass(frozen=True)
class Seen:
    """A picture with what is in it."""

    color: np.ndarray
    """(H, W, 3) uint8."""
    labels: np.ndarray
    """(H, W) uint16, rows of `things`; 0 nothing."""


@dataclass(frozen=True)
class Crop:
    """A crop and the things in it."""

    picture: np.ndarray
    """(SIDE, SIDE, 3) uint8."""
    main: np.ndarray
    """(A,) attributes of the main thing."""
    others: tuple[np.ndarray, ...]


class RoomCrops:
    """Crops of rooms, as many of each class."""

    def __init__(self, rooms: list[Furnished], lexicon: Lexicon, *, keep_held_out: bool = False) -> None:
        self.rows: list[np.ndarray] = [np.zeros(len(lexicon.attributes), np.int8)]
        self.things: list[Thing | None] = [None]
        self.held: list[bool] = [True]
        self.frames: list[Seen] = []
        self.places: dict[str, list[tuple[int, int]]] = {}
        """Class -> (frame, thing)."""
        for furnished in rooms:
            self._add(furnished, lexicon, keep_held_out)
        self.classes = sorted(self.places)

    def _add(self, room: Furnished, lexicon: Lexicon, keep_held_out: bool) -> None:
        models = {model.id: model for model in room.library.info.models}
        number = {}
        for entry in room.truth.info.objects:
            thing = thing_of(entry, room.library, models)
            number[entry.instance] = len(self.things)
            self.things.append(thing)
            self.rows.append(lexicon.row(thing))
            self.held.append(lexicon.is_held_out(thing))
        table = np.zeros(1 + max(number), np.uint16)
        table[list(number)] = list(number.values())
        with FrameReader(room.truth.path("log.mcap")) as reader:
            for index in range(len(reader)):
                frame = reader.read(index, ("color", "labels"))
                assert frame.color is not None and frame.labels is not None
                labels = table[frame.labels]
                counts = np.bincount(labels.reshape(-1), minlength=len(self.things))
                for which in np.flatnonzero(counts >= LEAST_PIXELS):
                    seen = self.things[which]
                    if seen is not None and (keep_held_out or not self.held[which]):
                        self.places.setdefault(seen.class_name, []).append((len(self.frames), int(which)))
                self.frames.append(Seen(frame.color, labels))

    def sample(self, random: np.random.Generator) -> Crop:
        """Return a crop whose middle shows one thing."""
        while True:
            choices = self.places[self.classes[int(random.integers(len(self.classes)))]]
            found = self.about(*choices[int(random.integers(len(choices)))], random)
            if found is not None:
                return found

    def about(self, frame: int, which: int, random: np.random.Generator) -> Crop | None:
        """Return a crop about a thing; None where the main thing is another one that is held out, or none is."""
        seen = self.frames[frame]
        rows, columns = np.nonzero(seen.labels == which)
        extent = max(np.ptp(rows), np.ptp(columns)) + 1
        height, width = seen.labels.shape
        if random.random() < 0.5:
            at = int(random.integers(len(rows)))
            row, column = int(rows[at]), int(columns[at])
        else:
            row, column = int(rows.min() + np.ptp(rows) // 2), int(columns.min() + np.ptp(columns) // 2)
        side = int(np.clip(extent * random.uniform(0.8, 1.9), 14, min(0.55 * height, 200)))
        low = [int(np.clip(v - side // 2, 0, n - side)) for v, n in ((row, height), (column, width))]
        window = np.s_[low[0] : low[0] + side, low[1] : low[1] + side]
        shares = _shares(seen.labels[window])
        main = max(shares, key=lambda k: shares[k][1], default=0)
        if main == 0 or shares[main][1] < MAIN_SHARE or self.held[main] != self.held[which]:
            return None
        others = tuple(self.rows[k] for k, (share, _) in shares.items() if k not in (0, main) and share > PRESENT_SHARE)
        picture = cv2.resize(seen.color[window], (SIDE, SIDE), interpolation=cv2.INTER_AREA)
        return Crop(picture, self.rows[main], others)


def _shares(labels: np.ndarray) -> dict[int, tuple[float, float]]:
    """Return thing -> (share of a square of labels, share weighted towards its middle)."""
    side = len(labels)
    offsets = (np.arange(side) + 0.5) / side - 0.5
    bell = np.exp(-0.5 * (offsets / 0.25) ** 2)
    weights = np.outer(bell, bell)
    ids, member = np.unique(labels, return_inverse=True)
    member = member.reshape(-1)
    plain, weighted = np.bincount(member) / labels.size, np.bincount(member, weights.reshape(-1)) / weights.sum()
    return {int(k): (float(a), float(b)) for k, a, b in zip(ids, plain, weighted, strict=True)}


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


@dataclass(frozen=True)
class Rendered:
    """Pictures of one model in one colour."""

    thing: Thing
    pictures: np.ndarray
    """(V, RENDERED, RENDERED, 3) uint8."""
    masks: np.ndarray
    """(V, RENDERED, RENDERED) bool."""


def rendered_models(libraries: list[CadLibrary], views: int, seed: int) -> list[Rendered]:
    """Return every model as it is and in another colour, each from `views` sides."""
    found = []
    for number, library in enumerate(libraries):
        for index, model in enumerate(library.info.models):
            random = np.random.default_rng([seed, number, index])
            mesh = posed_mesh(model_folder(library, model.id), model, {})
            colors = vertex_colors(mesh)
            if colors is None:
                continue
            for paint in (None, PALETTE[random.integers(len(PALETTE))] + random.uniform(-0.04, 0.04, 3)):
                if paint is not None:
                    changed = recolored(np.asarray(colors, float)[:, :3] / 255.0, _corner_areas(mesh), paint)
                    mesh.visual = trimesh.visual.ColorVisuals(
                        mesh, vertex_colors=np.round(255 * changed).astype(np.uint8)
                    )
                thing = Thing(
                    model.class_name, str(model.recipe.get("style", "")), _shares_of(mesh), float(max(mesh.extents))
                )
                found.append(_rendered(mesh, thing, views, random))
    return found


def _rendered(mesh: trimesh.Trimesh, thing: Thing, views: int, random: np.random.Generator) -> Rendered:
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
    return Rendered(thing, np.stack(pictures), np.stack(masks))


def composed(rendered: Rendered, frames: list[Seen], row: np.ndarray, random: np.random.Generator) -> Crop:
    """Return a model before a piece of a room."""
    view = int(random.integers(len(rendered.pictures)))
    seen = frames[int(random.integers(len(frames)))]
    height, width = seen.labels.shape
    side = int(random.integers(16, 110))
    top, left = int(random.integers(height - side)), int(random.integers(width - side))
    behind = cv2.resize(seen.color[top : top + side, left : left + side], (RENDERED, RENDERED))
    mask = cv2.GaussianBlur(rendered.masks[view].astype(np.float32), (0, 0), 0.6)[..., None]
    light = random.uniform(0.6, 1.25) * random.uniform(0.93, 1.07, 3)
    front = np.clip(rendered.pictures[view] * light, 0, 255)
    whole = (front * mask + behind * (1 - mask)).astype(np.uint8)
    return Crop(cv2.resize(whole, (SIDE, SIDE), interpolation=cv2.INTER_AREA), row, ())


def changed(picture: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return a picture in slightly other light, mirrored half of the time, blurred or noisy."""
    image = picture.astype(np.float32) / 255.0
    if random.random() < 0.5:
        image = image[:, ::-1]
    image = (
        np.clip(image, 0, 1) ** random.uniform(0.8, 1.25) * random.uniform(0.75, 1.2) * random.uniform(0.94, 1.06, 3)
    )
    if random.random() < 0.4:
        image = cv2.GaussianBlur(image.astype(np.float32), (0, 0), random.uniform(0.3, 1.1))
    image = image + random.normal(0, random.uniform(0, 0.02), image.shape)
    return (np.clip(image, 0, 1) * 255 + 0.5).astype(np.uint8)


def labels_of(crops: list[Crop], truth: np.ndarray, others: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """Return (N, M) of truth (N, M) of the main things, unknown where it is false but not false of every other thing:
    `others` (K, M) are these, of the crop `owner` (K,)."""
    result = truth.copy()
    for k, own in enumerate(owner):
        hidden = (result[own] == FALSE) & (others[k] != FALSE)
        result[own, hidden] = -1
    return result
