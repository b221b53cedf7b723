"""What things of a class are made of: friction of their surfaces, and how heavy their convex hull is.

Hull densities are the medians of mass over volume of the convex hull over the models of the parametric library, for
classes that it has; the others are set beside the class that is most alike. Frictions are middles of the ranges that
handbooks give for a dry surface on its like.
"""

from __future__ import annotations

from dataclasses import dataclass

FRICTION_OF_LIKE = {
    "stone": 0.60,
    "fabric": 0.60,
    "wood": 0.45,
    "cardboard": 0.45,
    "paper": 0.40,
    "ceramic": 0.40,
    "glass": 0.40,
    "plastic": 0.35,
    "metal": 0.35,
}
"""Coefficient of sliding friction of a surface on one of its kind."""
ROLLING_FRICTION, SPINNING_FRICTION = 0.0005, 0.005
"""Resistance to rolling and to turning on the spot [m], as Bullet and MuJoCo mean them."""


@dataclass(frozen=True)
class Substance:
    """What a class is made of, outside."""

    surface: str
    hull_density: float
    """Mass over the volume of the convex hull [kg/m^3]."""

    @property
    def friction(self) -> float:
        """Sliding friction of this surface on its like."""
        return FRICTION_OF_LIKE[self.surface]


SUBSTANCES = {
    "floor": Substance("stone", 1000.0),
    "wall": Substance("stone", 1000.0),
    "ceiling": Substance("stone", 1000.0),
    "bench": Substance("wood", 45.0),
    "chair": Substance("wood", 40.0),
    "stool": Substance("wood", 60.0),
    "table": Substance("wood", 70.0),
    "desk": Substance("wood", 50.0),
    "cabinet": Substance("wood", 160.0),
    "drawer_unit": Substance("wood", 160.0),
    "wall_cabinet": Substance("wood", 135.0),
    "wardrobe": Substance("wood", 120.0),
    "chest": Substance("wood", 160.0),
    "shelf": Substance("wood", 95.0),
    "wall_shelf": Substance("wood", 300.0),
    "trolley": Substance("metal", 60.0),
    "sofa": Substance("fabric", 45.0),
    "bed": Substance("fabric", 65.0),
    "person": Substance("fabric", 800.0),
    "backpack": Substance("fabric", 120.0),
    "curtain": Substance("fabric", 100.0),
    "fridge": Substance("metal", 100.0),
    "microwave": Substance("metal", 210.0),
    "oven": Substance("metal", 200.0),
    "dishwasher": Substance("metal", 150.0),
    "washing_machine": Substance("metal", 250.0),
    "hob": Substance("glass", 400.0),
    "sink": Substance("metal", 150.0),
    "toilet": Substance("ceramic", 300.0),
    "monitor": Substance("plastic", 330.0),
    "laptop": Substance("plastic", 400.0),
    "printer": Substance("plastic", 250.0),
    "keyboard": Substance("plastic", 475.0),
    "mouse": Substance("plastic", 600.0),
    "remote": Substance("plastic", 700.0),
    "clock": Substance("plastic", 400.0),
    "lamp": Substance("metal", 60.0),
    "pendant_lamp": Substance("metal", 60.0),
    "kettle": Substance("plastic", 350.0),
    "toolbox": Substance("plastic", 250.0),
    "bin": Substance("plastic", 75.0),
    "bottle": Substance("plastic", 850.0),
    "can": Substance("metal", 900.0),
    "cup": Substance("ceramic", 375.0),
    "bowl": Substance("ceramic", 375.0),
    "plate": Substance("ceramic", 700.0),
    "jug": Substance("ceramic", 375.0),
    "vase": Substance("ceramic", 400.0),
    "pan": Substance("metal", 350.0),
    "cooking_pot": Substance("metal", 250.0),
    "utensil": Substance("metal", 600.0),
    "tray": Substance("wood", 300.0),
    "box": Substance("cardboard", 180.0),
    "book": Substance("paper", 680.0),
    "picture": Substance("wood", 400.0),
    "board": Substance("wood", 400.0),
    "food": Substance("paper", 700.0),
    "plant": Substance("ceramic", 150.0),
    "door": Substance("wood", 500.0),
    "window": Substance("glass", 600.0),
    "object": Substance("plastic", 200.0),
}
"""Material and density [kg/m^3] by class; by eye."""


def substance_of(class_name: str) -> Substance:
    """Return what a class is made of; that of `object` for a class without an entry."""
    return SUBSTANCES.get(class_name, SUBSTANCES["object"])
