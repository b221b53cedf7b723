"""Tables drawn from above, actions on them; strips of pictures and animations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import atan2, ceil, cos, hypot, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scenewright.stages.tableware.actions.grasp import Grasp
from scenewright.stages.tableware.actions.pull import Pull
from scenewright.stages.tableware.actions.stack import Stack
from scenewright.stages.tableware.planning.action import Action, Primitive
from scenewright.stages.tableware.world.items import TABLE_SIDES, Item, Kind, Table
from scenewright.stages.tableware.world.setting import Gripper

SUPERSAMPLING = 2
"""Sub-pixels of a pixel along each side."""
MARGIN = 0.03
"""Room around the table in a picture [m]."""
COLORS: dict[Kind, str] = {
    "bowl": "#5b8fc9",
    "cup": "#e0904a",
    "plate": "#9aa5b1",
    "fork": "#4b5563",
    "spoon": "#7c5ca8",
}
GROUND, CLOTH, EDGE, INK = "#e5e7eb", "#ffffff", "#9ca3af", "#1f2937"
PULL_INK, STACK_INK, GRASP_INK, REFUSED_INK = "#15803d", "#7c3aed", "#b91c1c", "#dc2626"


@dataclass(frozen=True)
class _Sheet:
    """A drawing with the scale from metres to its pixels; y points up on the table, down in the image."""

    draw: ImageDraw.ImageDraw
    scale: float

    def at(self, x: float, y: float) -> tuple[float, float]:
        return ((x + TABLE_SIDES[0] / 2 + MARGIN) * self.scale, (TABLE_SIDES[1] / 2 + MARGIN - y) * self.scale)

    def disc(self, x: float, y: float, radius: float, fill: str | None, outline: str | None, width: float) -> None:
        u, v = self.at(x, y)
        r = radius * self.scale
        pixels = max(1, round(width * self.scale))
        self.draw.ellipse((u - r, v - r, u + r, v + r), fill=fill, outline=outline, width=pixels)

    def line(self, start: tuple[float, float], end: tuple[float, float], ink: str, width: float) -> None:
        self.draw.line((*self.at(*start), *self.at(*end)), fill=ink, width=max(1, round(width * self.scale)))

    def arrow(self, start: tuple[float, float], end: tuple[float, float], ink: str) -> None:
        length = hypot(end[0] - start[0], end[1] - start[1])
        if length < 1e-6:
            return
        self.line(start, end, ink, 0.006)
        angle = atan2(end[1] - start[1], end[0] - start[0])
        for side in (-1, 1):
            turned = angle + side * 2.6
            self.line(end, (end[0] + 0.03 * cos(turned), end[1] + 0.03 * sin(turned)), ink, 0.006)


def draw_table(table: Table, width: int, action: Action | None = None, caption: str = "") -> Image.Image:
    """Return a table from above, `width` pixels wide, with an action that is about to happen and a line of text."""
    scale = SUPERSAMPLING * width / (TABLE_SIDES[0] + 2 * MARGIN)
    height = round((TABLE_SIDES[1] + 2 * MARGIN) * scale)
    image = Image.new("RGB", (SUPERSAMPLING * width, height), GROUND)
    sheet = _Sheet(ImageDraw.Draw(image), scale)
    corners = (*sheet.at(-TABLE_SIDES[0] / 2, TABLE_SIDES[1] / 2), *sheet.at(TABLE_SIDES[0] / 2, -TABLE_SIDES[1] / 2))
    sheet.draw.rectangle(corners, fill=CLOTH, outline=EDGE, width=SUPERSAMPLING)
    for x, y, radius in table.obstacles:
        sheet.disc(x, y, radius, "#fee2e2", REFUSED_INK, 0.003)
    for pile in table.stacks:
        for level, item in enumerate(pile):
            _draw_item(sheet, item, level)
        if len(pile) > 1:
            text = f"{len(pile)}"
            u, v = sheet.at(*pile[0].position[:2])
            r = 0.016 * scale
            sheet.draw.ellipse((u - r, v - r, u + r, v + r), fill=CLOTH, outline=INK, width=SUPERSAMPLING)
            sheet.draw.text((u, v), text, fill=INK, font=_font(0.024 * scale), anchor="mm")
    if action is not None:
        for part in action.parts:
            _PAINTERS[type(part)](sheet, part)
    image = image.resize((width, round(height / SUPERSAMPLING)), Image.Resampling.LANCZOS)
    return captioned(image, caption) if caption else image


def _draw_item(sheet: _Sheet, item: Item, level: int) -> None:
    x, y, _ = item.position
    color = COLORS[item.kind]
    if item.is_dish:
        shrink = 1.0 - 0.06 * level
        radius = item.measures.rim_radius * shrink
        sheet.disc(x, y, radius, color, INK, 0.0015)
        sheet.disc(x, y, radius - max(item.measures.wall, 0.004), _lighter(color, 0.35), None, 0.0)
        sheet.disc(x, y, item.measures.foot_radius * shrink * 0.9, _lighter(color, 0.5), None, 0.0)
        return
    dx, dy = cos(item.yaw), sin(item.yaw)
    half, wide = item.measures.length / 2, item.measures.width
    neck = (x + 0.28 * half * dx, y + 0.28 * half * dy)
    end = (x + half * dx, y + half * dy)
    sheet.line((x - half * dx, y - half * dy), neck, color, wide * 0.45)
    if item.kind == "spoon":
        middle = (x + 0.72 * half * dx, y + 0.72 * half * dy)
        corners = [
            sheet.at(
                middle[0] + 0.29 * half * cos(t) * dx - wide / 2 * sin(t) * dy,
                middle[1] + 0.29 * half * cos(t) * dy + wide / 2 * sin(t) * dx,
            )
            for t in np.linspace(0.0, 2 * pi, 40)
        ]
        sheet.draw.polygon(corners, fill=color)
        sheet.line(neck, middle, color, wide * 0.45)
        return
    for offset in (-0.42, -0.14, 0.14, 0.42):
        across = (-dy * wide * offset, dx * wide * offset)
        sheet.line((neck[0] + across[0], neck[1] + across[1]), (end[0] + across[0], end[1] + across[1]), color, 0.0024)
    sheet.line(
        (neck[0] + dy * wide / 2, neck[1] - dx * wide / 2),
        (neck[0] - dy * wide / 2, neck[1] + dx * wide / 2),
        color,
        0.006,
    )


def _draw_pull(sheet: _Sheet, action: Pull) -> None:
    sheet.arrow(action.p_S[:2], action.p_E[:2], PULL_INK)


def _draw_stacking(sheet: _Sheet, action: Stack) -> None:
    sheet.arrow(action.u_G.p_G[:2], action.p_L[:2], STACK_INK)


def _draw_jaws(sheet: _Sheet, action: Grasp) -> None:
    """The two fingers, open, and the line along which they close."""
    hand = Gripper()
    x, y, _ = action.p_G
    dx, dy = cos(action.theta_G), sin(action.theta_G)
    reach = hand.opening / 2
    sheet.line((x - reach * dx, y - reach * dy), (x + reach * dx, y + reach * dy), GRASP_INK, 0.002)
    for side in (-1, 1):
        middle = (x + side * reach * dx, y + side * reach * dy)
        start = (middle[0] - hand.finger * dy, middle[1] + hand.finger * dx)
        end = (middle[0] + hand.finger * dy, middle[1] - hand.finger * dx)
        sheet.line(start, end, GRASP_INK, 0.008)


_PAINTERS: dict[type[Primitive], Callable[[_Sheet, Any], None]] = {
    Grasp: _draw_jaws,
    Pull: _draw_pull,
    Stack: _draw_stacking,
}


def _lighter(color: str, share: float) -> str:
    values = [int(color[k : k + 2], 16) for k in (1, 3, 5)]
    return "#" + "".join(f"{round(value + share * (255 - value)):02x}" for value in values)


def _font(size: float) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(max(6.0, size))


def captioned(image: Image.Image, caption: str) -> Image.Image:
    """Return a picture with lines of text below it."""
    size = max(11, round(image.width * 0.042))
    lines = _wrap_lines(caption, image.width - 8, size)
    sheet = Image.new("RGB", (image.width, image.height + round(1.3 * size) * max(2, len(lines)) + 6), "#ffffff")
    sheet.paste(image, (0, 0))
    draw = ImageDraw.Draw(sheet)
    for row, line in enumerate(lines):
        draw.text((4, image.height + 3 + row * round(1.3 * size)), line, fill=INK, font=_font(size))
    return sheet


def _wrap_lines(text: str, width: int, size: int) -> list[str]:
    font = _font(size)
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and font.getlength(longer) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines[:3]


Panel = tuple[Table, Action | None, str]


def draw_strip(panels: Sequence[Panel], width: int, columns: int = 4) -> Image.Image:
    """Return tables from above in rows of `columns`, in the order of reading; each with its action and its text."""
    columns = max(1, min(columns, len(panels)))
    gap = 8
    each = (width - gap * (columns + 1)) // columns
    pictures = [draw_table(table, each, action, caption or " ") for table, action, caption in panels]
    tallest = max((picture.height for picture in pictures), default=1)
    rows = ceil(len(pictures) / columns)
    sheet = Image.new("RGB", (width, rows * (tallest + gap) + gap), "#ffffff")
    for number, picture in enumerate(pictures):
        row, column = divmod(number, columns)
        sheet.paste(picture, (gap + column * (each + gap), gap + row * (tallest + gap)))
    return sheet


def write_animation(path: Path, steps: Sequence[tuple[Action, Table, Table, str]], width: int) -> None:
    """Write a GIF of actions (action, table before, table after, text): what is pulled or put moves, what is taken
    goes."""
    frames: list[Image.Image] = []
    times: list[int] = []
    for action, before, after, caption in steps:
        frames.append(draw_table(before, width, action, caption))
        times.append(700)
        for share in (0.25, 0.5, 0.75):
            between = _between(before, action, share)
            if between is not None:
                frames.append(draw_table(between, width, None, caption))
                times.append(90)
        frames.append(draw_table(after, width, None, caption))
        times.append(350)
    if not frames:
        frames, times = [draw_table(Table(()), width, None, "nothing to clear")], [700]
    times[-1] = 1500
    tallest = max(frame.height for frame in frames)
    even = [_pad_below(frame, tallest).quantize(96) for frame in frames]
    even[0].save(path, save_all=True, append_images=even[1:], duration=times, loop=0, optimize=False)


def _pad_below(image: Image.Image, height: int) -> Image.Image:
    sheet = Image.new("RGB", (image.width, height), "#ffffff")
    sheet.paste(image, (0, 0))
    return sheet


def _between(table: Table, action: Action, share: float) -> Table | None:
    """Return the table while something is on its way, None for a grasp."""
    moves = action.parts[0].moves
    if moves is None:
        return None
    name, end = moves
    if name not in table.by_name:
        return None
    start = table.by_name[name].position
    going = {name, *(item.name for item in table.load(name))}
    dx, dy = share * (end[0] - start[0]), share * (end[1] - start[1])
    moved = tuple(
        replace(item, position=(item.position[0] + dx, item.position[1] + dy, item.position[2]))
        for item in table.items
        if item.name in going
    )
    moved = tuple(replace(item, on=None) if item.name == name else item for item in moved)
    return Table((*(item for item in table.items if item.name not in going), *moved), table.obstacles)
