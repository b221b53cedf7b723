"""Why two things cannot be taken together: the rule that forbids it, in words and with what is in the way."""

from __future__ import annotations

from scenewright.schemas.tableware_plan import ImpossiblePair
from scenewright.stages.tableware.planning.rules import (
    Rules,
    can_hold,
    can_hold_two,
    can_stack,
    in_the_way,
    jaws,
    letters,
    lips,
    obstructed,
    pull_end,
    sweep,
    why_not_pulled,
    within_jaws,
)
from scenewright.stages.tableware.world.footprints import Footprint, footprint, gap
from scenewright.stages.tableware.world.items import Item, Table

NOT_PULLED = {
    "loaded": "carries others and loaded pulls are off",
    "no_room": "leaves the fingers no room beside what it carries",
    "tips": "would tip over with what it carries",
}


def impossible_pairs(table: Table, rules: Rules) -> tuple[ImpossiblePair, ...]:
    """Return for every two piles of a table which primitive is not possible as they stand, and why. A pull and a
    stacking are named for the pile that would move first; a multi-object grasp once."""
    reasons = []
    for row, pile in enumerate(table.stacks):
        for column, second_pile in enumerate(table.stacks):
            if pile is second_pile:
                continue
            if row < column:
                reasons.append(_multi_grasp(table, pile, second_pile, rules))
            reasons.append(_pull(table, pile, second_pile, rules))
            reasons.append(_stack(pile, second_pile, rules))
    return tuple(reason for reason in reasons if reason is not None)


def _two_piles(pile: tuple[Item, ...], other: tuple[Item, ...], rules: Rules) -> tuple[str, str] | None:
    """Return kind and words of why one grasp does not hold two piles that stand side by side."""
    first, second = letters(pile), letters(other)
    if pile[0].is_dish != other[0].is_dish:
        return "unlike", "a dish and a utensil are not grasped side by side"
    if not (can_hold(first, rules) and can_hold(second, rules)):
        return "too_tall", f"a pile of them is higher than jaws of {1e3 * rules.setting.gripper.jaw_height:.0f} mm hold"
    if can_hold_two(first, second, rules):
        return None
    alike = rules.setting.alike
    if alike is not None and not alike.issuperset(first + second):
        return "sizes_estimated", "dishes of a kind here measure differently, by estimate"
    apart = abs(lips(first, rules)[0] - lips(second, rules)[0])
    if apart > rules.similar:
        return "heights_differ", f"their grasp heights differ by {1e3 * apart:.0f} mm, over {1e3 * rules.similar:.0f}"
    return "too_tall", f"their lips are more than {1e3 * rules.setting.gripper.jaw_height:.0f} mm apart in height"


def _blocking_reason(
    covers: tuple[Footprint, ...], table: Table, names: set[str]
) -> tuple[str, str, tuple[str, ...]] | None:
    blockers = tuple(item.name for item in in_the_way(covers, table, names))
    if blockers:
        return "in_the_way", f"{', '.join(blockers)} in the way", blockers
    if obstructed(covers, table):
        return "in_the_way", "something that is not understood is in the way", ()
    return None


def _multi_grasp(table: Table, pile: tuple[Item, ...], other: tuple[Item, ...], rules: Rules) -> ImpossiblePair | None:
    first, second = pile[0], other[0]
    why: tuple[str, str] | tuple[str, str, tuple[str, ...]] | None = _two_piles(pile, other, rules)
    if why is None and not within_jaws(first, second, rules):
        between = 1e3 * gap(footprint(first), footprint(second))
        why = (
            "too_far_apart",
            f"{between:.0f} mm between them do not fit between jaws {1e3 * rules.setting.gripper.opening:.0f} mm open",
        )
        if not first.is_dish and between < 1e3 * rules.setting.gripper.opening / 2:
            why = "turned", "two utensils that lie at too great an angle for one grasp"
    if why is None:
        why = _blocking_reason((jaws(first, second, rules),), table, {first.name, second.name})
    return _pair("multi_grasp", first, second, why)


def _pull(table: Table, pile: tuple[Item, ...], other: tuple[Item, ...], rules: Rules) -> ImpossiblePair | None:
    first, second = pile[0], other[0]
    why: tuple[str, str] | tuple[str, str, tuple[str, ...]] | None = _two_piles(pile, other, rules)
    unborne = why_not_pulled(letters(pile), rules)
    if why is None and unborne is not None:
        why = unborne, f"{first.name} {NOT_PULLED[unborne]}"
    if why is None and not footprint(first, *pull_end(first, second, rules)).on_table:
        why = "off_table", f"beside {second.name} it would hang over the table's edge"
    if why is None:
        why = _blocking_reason(sweep(first, second, rules), table, {first.name, second.name})
    return _pair("pull", first, second, why)


def _stack(pile: tuple[Item, ...], other: tuple[Item, ...], rules: Rules) -> ImpossiblePair | None:
    first, top = pile[0], other[-1]
    upper, lower = letters(pile), letters(other)
    if can_stack(upper, lower, rules):
        return None
    why = "too_tall", f"the pile would be higher than jaws of {1e3 * rules.setting.gripper.jaw_height:.0f} mm hold"
    if not rules.setting.stacking:
        why = "sizes_estimated", "nothing is stacked whose wall and foot are guessed"
    elif first.is_dish and not top.is_dish:
        why = "on_utensil", f"a dish does not stand on {top.name}"
    elif first.is_dish and first.measures.rim_radius > top.measures.rim_radius:
        why = "wider", f"it is wider than {top.name}"
    elif not first.is_dish and top.kind == "cup" and not rules.utensils_in_cups:
        why = "unlike", "utensils are not put on cups"
    elif (upper + lower).count("u") > rules.most_utensils:
        why = "too_many_utensils", f"more than {rules.most_utensils} utensils in one pile"
    return _pair("stack", first, other[0], why)


def _pair(
    primitive: str, first: Item, second: Item, why: tuple[str, str] | tuple[str, str, tuple[str, ...]] | None
) -> ImpossiblePair | None:
    if why is None:
        return None
    objects = why[2] if len(why) == 3 else ()
    return ImpossiblePair(
        primitive=primitive,  # type: ignore[arg-type]
        first=first.name,
        second=second.name,
        kind=why[0],
        objects=objects,
        message=f"{first.name} and {second.name}: {why[1]}",
    )
