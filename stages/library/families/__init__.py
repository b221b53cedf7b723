"""One file per family of furniture; a generator takes a random stream and a style number and returns a Design."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stages.library.design import Design
from stages.library.families.appliances import fridge, microwave
from stages.library.families.bedroom import bed, book, lamp
from stages.library.families.carriers import board, tray
from stages.library.families.containers import bin as waste_bin
from stages.library.families.containers import box
from stages.library.families.drawers import drawer_unit
from stages.library.families.electronics import keyboard, monitor
from stages.library.families.hanging import pendant_lamp, picture
from stages.library.families.seating import chair, sofa
from stages.library.families.storage import cabinet, shelf, wall_cabinet
from stages.library.families.tables import desk, table
from stages.library.families.tableware import bottle, bowl, cup

Generator = Callable[[np.random.Generator, int], Design]

GENERATORS: dict[str, Generator] = {
    "chair": chair,
    "table": table,
    "desk": desk,
    "cabinet": cabinet,
    "wall_cabinet": wall_cabinet,
    "shelf": shelf,
    "fridge": fridge,
    "microwave": microwave,
    "sofa": sofa,
    "bed": bed,
    "monitor": monitor,
    "keyboard": keyboard,
    "bottle": bottle,
    "cup": cup,
    "bowl": bowl,
    "box": box,
    "bin": waste_bin,
    "book": book,
    "lamp": lamp,
    "pendant_lamp": pendant_lamp,
    "picture": picture,
    "board": board,
    "tray": tray,
    "drawer_unit": drawer_unit,
}
"""Class name -> generator, in the order of their random streams: append only, so that seeds keep their meaning."""
