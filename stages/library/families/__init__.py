"""One file per family of furniture; a generator takes a random stream and a style number and returns a Design."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scenewright.stages.library.design import Design
from scenewright.stages.library.families.appliances import fridge, microwave
from scenewright.stages.library.families.bedroom import bed, book, lamp
from scenewright.stages.library.families.carriers import board, tray
from scenewright.stages.library.families.containers import bin as waste_bin
from scenewright.stages.library.families.containers import box
from scenewright.stages.library.families.decoration import plant, utensil, vase
from scenewright.stages.library.families.drawers import drawer_unit
from scenewright.stages.library.families.electronics import keyboard, monitor
from scenewright.stages.library.families.fixtures import sink, toilet
from scenewright.stages.library.families.furniture import bench, stool, trolley, wall_shelf, wardrobe
from scenewright.stages.library.families.hanging import pendant_lamp, picture
from scenewright.stages.library.families.kitchenware import can, cooking_pot, jug, kettle, pan, plate
from scenewright.stages.library.families.lidded import chest, toolbox
from scenewright.stages.library.families.office import clock, laptop, mouse, printer, remote
from scenewright.stages.library.families.seating import chair, sofa
from scenewright.stages.library.families.storage import cabinet, shelf, wall_cabinet
from scenewright.stages.library.families.tables import desk, table
from scenewright.stages.library.families.tableware import bottle, bowl, cup
from scenewright.stages.library.families.white_goods import dishwasher, hob, oven, washing_machine

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
    "plate": plate,
    "pan": pan,
    "cooking_pot": cooking_pot,
    "jug": jug,
    "can": can,
    "kettle": kettle,
    "oven": oven,
    "hob": hob,
    "dishwasher": dishwasher,
    "washing_machine": washing_machine,
    "printer": printer,
    "laptop": laptop,
    "mouse": mouse,
    "remote": remote,
    "clock": clock,
    "stool": stool,
    "bench": bench,
    "wardrobe": wardrobe,
    "chest": chest,
    "toolbox": toolbox,
    "trolley": trolley,
    "wall_shelf": wall_shelf,
    "sink": sink,
    "toilet": toilet,
    "plant": plant,
    "vase": vase,
    "utensil": utensil,
}
"""Class name -> generator, in the order of their random streams: append only, so that seeds keep their meaning."""
