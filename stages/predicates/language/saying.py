"""Expressions as sentences that people read."""

from __future__ import annotations

from scenewright.stages.kit.predicates.expressions import Predicate, Tree

_NAMES = {
    "x": "the middle",
    "y": "the height above the table",
    "left": "the left edge",
    "right": "the right edge",
    "bottom": "the bottom",
    "top": "the top",
    "width": "the width",
    "height": "the height",
    "water": "the water",
    "category": "the category",
    "table_height": "the table's top",
    "table_left": "the table's left end",
    "table_right": "the table's right end",
    "gripper_x": "the gripper's middle",
    "gripper_left": "the left finger",
    "gripper_right": "the right finger",
    "gripper_bottom": "the fingers' tips",
    "gripper_top": "the fingers' upper ends",
    "gripper_height": "the fingers' height",
    "gripper_mass": "the mass in the gripper",
    "gripper_opening": "the gripper's opening",
    "largest_opening": "the gripper's largest opening",
}
_BETWEEN = {
    "less": "is less than",
    "at_most": "is at most",
    "near": "is near",
    "is": "is",
    "plus": "plus",
    "minus": "minus",
    "times": "times",
    "over": "over",
}


def say(predicate: Predicate) -> str:
    """Return what a predicate means, as a sentence."""
    objects = f" ({', '.join(letter[1:] for letter in predicate.variables)})" if predicate.arguments else ""
    return f"{predicate.name}{objects}: {_say_tree(predicate.means)}."


def _say_tree(tree: Tree | str | float) -> str:
    if isinstance(tree, float):
        return f"{tree:.4g}"
    if isinstance(tree, str):
        return tree.removeprefix("?")
    head, operands = str(tree[0]), tree[1:]
    if head in ("and", "or"):
        return f" {head} ".join(_say_tree(part) if _simple(part) else f"({_say_tree(part)})" for part in operands)
    if head == "not":
        return f"it is not so that {_say_tree(operands[0])}"
    if head in ("some", "every"):
        start = "there is another object" if head == "some" else "for every other object"
        return f"{start} {_say_tree(operands[0])} {'with' if head == 'some' else 'holds'}: {_say_tree(operands[1])}"
    if head in _BETWEEN:
        return f"{_say_tree(operands[0])} {_BETWEEN[head]} {_say_tree(operands[1])}"
    if head == "abs":
        return f"the size of ({_say_tree(operands[0])})"
    if head in _NAMES:
        return f"{_NAMES[head]} of {_say_tree(operands[0])}" if operands else _NAMES[head]
    return f"{head}({', '.join(_say_tree(part) for part in operands)})"


def _simple(tree: Tree | str | float) -> bool:
    return not isinstance(tree, tuple) or tree[0] not in ("and", "or", "some", "every")
