"""Pictures of the kitchen, short animations, and plots of where a predicate holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw
from scenewright.stages.kit.predicates.evaluating import Evaluator
from scenewright.stages.kit.predicates.expressions import Predicate
from scenewright.stages.kit.predicates.room import RoomState
from scenewright.stages.kit.predicates.vocabulary import Perceived
from scenewright.stages.predicates.state import TABLE_LEFT, TABLE_RIGHT, State
from scenewright.stages.predicates.world.kitchen import FAUCET_HEIGHT, SINK_DEPTH, SINK_WIDTH, SINK_X

Polygons = Sequence[tuple[str, Sequence[tuple[float, float]]]]
LEFT, RIGHT, BOTTOM, TOP = -42.0, 40.0, -12.0, 30.0
"""Part of the kitchen that is drawn [units]."""
COLORS = {
    "gripper": (70, 70, 80),
    "water": (60, 130, 220),
    "shelf": (150, 110, 70),
    "placemat": (120, 170, 120),
    "plate": (210, 210, 220),
    "pot": (110, 120, 140),
    "cup": (170, 120, 170),
    "tallcup": (140, 90, 160),
    "coaster": (190, 160, 90),
}
"""Name -> colour (RGB)."""
USUAL = (205, 110, 80)
"""Colour (RGB) of everything else."""
ROOM_HALF = 3.0
"""Half the width of the plots of a room [m]; their height is 2 m."""
GRID = 60
"""Cells along an edge of a plot."""


def draw_kitchen(polygons: Polygons, width: int, title: str = "") -> Image.Image:
    """Return a picture of a kitchen, (RIGHT - LEFT) wide."""
    scale = width / (RIGHT - LEFT)
    image = Image.new("RGB", (width, round((TOP - BOTTOM) * scale)), (250, 249, 246))
    draw = ImageDraw.Draw(image)

    def at(point: tuple[float, float]) -> tuple[float, float]:
        return (point[0] - LEFT) * scale, (TOP - point[1]) * scale

    wood = (214, 196, 170)
    draw.rectangle((*at((TABLE_LEFT, 0.0)), *at((TABLE_RIGHT, BOTTOM))), fill=wood)
    draw.rectangle((*at((TABLE_RIGHT, -SINK_DEPTH)), *at((TABLE_RIGHT + SINK_WIDTH + 1, BOTTOM))), fill=wood)
    draw.rectangle((*at((SINK_X - 0.8, FAUCET_HEIGHT + 2)), *at((SINK_X + 6, FAUCET_HEIGHT))), fill=(150, 155, 160))
    for name, corners in polygons:
        if name == "water":
            x, y = at((corners[0][0], corners[0][1]))
            radius = max(1.0, 0.12 * scale)
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=COLORS["water"])
        else:
            draw.polygon([at((x, y)) for x, y in corners], fill=COLORS.get(name, USUAL), outline=(60, 50, 45))
    if title:
        draw.text((6, 4), title, fill=(40, 40, 40))
    return image


def draw_predicates(predicates: Sequence[Predicate], state: Perceived, vocabulary: dict[str, Predicate]) -> Image.Image:
    """Return plots, one a predicate, of where the middle of its first object may be for it to hold, green, in a state;
    each is about the first objects of the state."""
    size, line = 3 * GRID, 16
    columns = 4
    rows = -(-len(predicates) // columns)
    sheet = Image.new("RGB", (columns * (size + 8), max(1, rows) * (size + line + 8)), (255, 255, 255))
    draw = ImageDraw.Draw(sheet)
    for number, predicate in enumerate(predicates):
        holds = _holding_grid(predicate, state, vocabulary)
        colors = np.where(holds[:, :, None], (130, 190, 130), (232, 232, 232)).astype(np.uint8)
        corner = (number % columns * (size + 8), number // columns * (size + line + 8))
        sheet.paste(
            Image.fromarray(colors).resize((size, size), Image.Resampling.NEAREST), (corner[0], corner[1] + line)
        )
        draw.text(corner, predicate.name[:30], fill=(30, 30, 30))
    return sheet


def draw_learning(course: Sequence[tuple[int, int, int]]) -> Image.Image:
    """Return a plot (thesis, figure 5.4) of predicates (red) and operators (blue) over steps, with bars (green) where
    the teacher said something. `course`: after each step predicates, operators, and sentences so far."""
    width, height, edge = 900, 280, 36
    image = Image.new("RGB", (width, height), (255, 255, 255))
    draw = ImageDraw.Draw(image)
    most = max([1, *(max(step[:2]) for step in course)])
    across = (width - 2 * edge) / max(1, len(course))

    def y(value: float) -> float:
        return height - edge - value / most * (height - 2 * edge)

    before = 0
    for number, (_, _, sentences) in enumerate(course):
        if sentences > before:
            band_start = edge + number * across
            draw.rectangle((band_start, edge, band_start + max(1.0, across - 1), height - edge), fill=(205, 232, 205))
        before = sentences
    for value in range(0, most + 1, max(1, most // 6)):
        draw.line((edge, y(value), width - edge, y(value)), fill=(225, 225, 225))
        draw.text((8, y(value) - 6), str(value), fill=(60, 60, 60))
    for which, color, name in ((0, (190, 60, 50), "predicates"), (1, (50, 90, 180), "operators")):
        points = [(edge + (number + 0.5) * across, y(step[which])) for number, step in enumerate(course)]
        if len(points) > 1:
            draw.line(points, fill=color, width=2)
        draw.text((edge + 110 * which, 10), name, fill=color)
    draw.text((edge + 220, 10), "green: the teacher said something", fill=(70, 130, 70))
    draw.text((width - edge - 60, height - 22), f"{len(course)} steps", fill=(60, 60, 60))
    return image


def _holding_grid(predicate: Predicate, state: Perceived, vocabulary: dict[str, Predicate]) -> np.ndarray:
    """Return (GRID, GRID) where the predicate holds, rows from above."""
    names = list(state.names)[: max(1, predicate.arguments)]
    holds = np.zeros((GRID, GRID), dtype=bool)
    kitchen = isinstance(state, State)
    heights = np.linspace(TOP - 10, -4.0, GRID) if kitchen else np.linspace(2.0, 0.0, GRID)
    places = np.linspace(LEFT, RIGHT, GRID) if kitchen else np.linspace(-ROOM_HALF, ROOM_HALF, GRID)
    for row, height in enumerate(heights.tolist()):
        for column, x in enumerate(places.tolist()):
            moved_state = _move_object(state, names[0], x, height)
            holds[row, column] = Evaluator(moved_state, vocabulary).holds(
                (predicate.name, *names[: predicate.arguments])
            )
    return holds


def _move_object(state: Perceived, name: str, x: float, height: float) -> Perceived:
    """Return a state with the middle of an object elsewhere."""
    if isinstance(state, RoomState):
        body = state.bodies[name]
        return state.moved(name, replace(body, middle=(x, body.middle[1], height)))
    assert isinstance(state, State)
    return replace(state, objects={**state.objects, name: replace(state.objects[name], x=x, y=height)})


def animate(path: Path, frames: Sequence[Polygons], width: int) -> None:
    """Write an animation of kitchens."""
    images = [draw_kitchen(frame, width).quantize(64) for frame in frames]
    images[0].save(path, save_all=True, append_images=images[1:], duration=80, loop=0)
