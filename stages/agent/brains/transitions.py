"""What each call's outcome makes of the beliefs of the `rules` brain: a transition by call, and by kind of failure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from scenewright.stages.agent.brains.beliefs import MOST_FAILURES, Asked, Beliefs, Check, Duty
from scenewright.stages.agent.goals import CARRIERS
from scenewright.stages.agent.language.interpreter import Ran
from scenewright.stages.agent.language.values import ObjectMap, Observation, Outcome, SceneObject


def learn(beliefs: Beliefs, last: Ran) -> None:
    """Take in what came of the last program."""
    for called in last.calls:
        heard = HEARD.get(called.name)
        if heard is not None and isinstance(called.value, heard[0]):
            heard[1](beliefs, called.value)
    if last.error is None:
        return
    beliefs.troubles += 1
    call, key = beliefs.asked
    if last.error.kind == "nothing_in_hand" and call.startswith("place"):
        beliefs.held = None
        beliefs.demand(Duty.LOOK_AGAIN)
    if last.error.kind == "unknown_object":
        beliefs.things.pop(key, None)
        beliefs.demand(Duty.LOOK_AGAIN)
    if call == "navigate":
        beliefs.asked = Asked()  # it did not drive: what is in front is not what was asked for


def _explored(beliefs: Beliefs, found: ObjectMap) -> None:
    beliefs.rooms = {item.key: item for item in found}
    beliefs.explored = True
    beliefs.at = ""  # exploring ends anywhere


def _mapped(beliefs: Beliefs, found: ObjectMap) -> None:
    place = beliefs.at or next((item.place for item in found), "")
    beliefs.at, beliefs.began = place, beliefs.began or place
    beliefs.things = {k: t for k, t in beliefs.things.items() if t.place != place}
    for item in found:
        note = beliefs.notes[item.key]
        if item.label not in note.classes:
            again = next((lost for lost in beliefs.lost if lost.label == item.label), None)
            if again is not None:
                beliefs.lost.remove(again)
        note.classes.add(item.label)
        note.written = f"{beliefs.map_name(place)}[{item.key!r}]"
        beliefs.things[item.key] = item
    if place not in beliefs.rooms or not beliefs.rooms[place].more:  # it is not looked at before all doors were open
        beliefs.notes[place].looked += 1
    beliefs.demand(Duty.LOOK_AGAIN, False)


def _drove(beliefs: Beliefs, outcome: Outcome) -> None:
    key = beliefs.asked.key
    if outcome.ok:
        beliefs.at = beliefs.things[key].place if key in beliefs.things else key
    else:
        beliefs.trouble("navigate", key)


def _turned(beliefs: Beliefs, outcome: Outcome, *, opened: bool) -> None:
    key = beliefs.asked.key
    if outcome.ok:
        more = bool(outcome.numbers.get("more"))
        beliefs.rooms[key] = replace(beliefs.rooms[key], opened=opened, more=more)
        beliefs.notes[key].several |= more
        beliefs.at = key
    else:
        beliefs.trouble("door", key)


def _grasped(beliefs: Beliefs, outcome: Outcome) -> None:
    thing, note = beliefs.things[beliefs.asked.key], beliefs.notes[beliefs.asked.key]
    beliefs.handled.add(thing.label)
    if outcome.ok:
        beliefs.held = beliefs.things.pop(thing.key)
        beliefs.at = thing.place
        beliefs.check = Check("hand", thing, thing) if beliefs.style.pictures else None
        return
    if outcome.kind == "disputed":
        note.disputed = outcome.label
        return
    tries = beliefs.trouble("grasp", thing.key)
    match outcome.kind:
        case "wrong_in_hand":
            beliefs.held = replace(beliefs.things.pop(thing.key), label=outcome.label)
        case "doubtful_in_hand":
            held = beliefs.held = replace(beliefs.things.pop(thing.key), doubt=outcome.label)
            note.doubted = outcome.label
            beliefs.demand(Duty.PUT_BACK, not any(beliefs.either_way(held, goal) for goal in beliefs.goals))
        case "doubtful":
            beliefs.things[thing.key] = replace(thing, doubt=outcome.label)
        case kind:
            if kind == "lost":
                beliefs.lost.append(thing)
            if kind == "unreachable" or tries >= MOST_FAILURES:
                note.rejected = note.unmoved = True
                return
            if kind == "wrong_object":  # the views agree now
                note.doubted = None
            beliefs.at = thing.place
            beliefs.demand(Duty.LOOK_AGAIN)
            _step_aside(beliefs, tries)


def _step_aside(beliefs: Beliefs, tries: int) -> None:
    beliefs.demand(Duty.STEP_ASIDE, tries == MOST_FAILURES - 1 and not beliefs.style.skilled)


def _placed(beliefs: Beliefs, outcome: Outcome) -> None:
    thing, key = beliefs.held, beliefs.asked.key
    assert thing is not None
    target = beliefs.rooms[key] if key in beliefs.rooms else beliefs.things[key]
    place = target.place or target.key
    if outcome.ok:
        on = target.key if target.label in CARRIERS else ""
        put = replace(thing, place=place, on=on, label=outcome.label or thing.label)
        beliefs.held, beliefs.at, beliefs.things[thing.key] = None, place, put
        (_put_back if Duty.PUT_BACK in beliefs.duties else _brought)(beliefs, thing, target)
        return
    tries = beliefs.trouble("place", target.key)
    if outcome.kind == "lost":
        beliefs.lost.append(replace(thing, place=place))
    if outcome.kind in ("not_there", "lost"):
        beliefs.held, beliefs.at = None, place
        beliefs.demand(Duty.LOOK_AGAIN)
    elif outcome.kind == "unreachable" or tries >= MOST_FAILURES:
        beliefs.notes[target.key].rejected = True
    else:
        _step_aside(beliefs, tries)


def _put_back(beliefs: Beliefs, thing: SceneObject, _: SceneObject) -> None:
    skilled = beliefs.style.skilled
    beliefs.demand(Duty.PUT_BACK, False)
    if not skilled or beliefs.gave_up(thing.key, "grasp"):
        beliefs.notes[thing.key].rejected = True
    beliefs.demand(Duty.LOOK_AGAIN, skilled)


def _brought(beliefs: Beliefs, thing: SceneObject, target: SceneObject) -> None:
    beliefs.notes[thing.key].moved = True
    where = "middle" if beliefs.asked.call == "place_among" else "spot"
    beliefs.check = Check(where, thing, target) if beliefs.style.pictures else None


def _seen(beliefs: Beliefs, seen: Observation) -> None:
    if beliefs.check is None:
        _looked_at(beliefs, seen)
        return
    where, thing, _ = beliefs.check
    beliefs.check = None
    if thing.label in seen.labels:
        return
    beliefs.trouble("grasp" if where == "hand" else "place", thing.key)
    if where == "hand" and seen.labels:
        beliefs.demand(Duty.PUT_BACK)
        return
    beliefs.held = None
    beliefs.things.pop(thing.key, None)
    beliefs.notes[thing.key].moved = False
    beliefs.demand(Duty.LOOK_AGAIN)


def _looked_at(beliefs: Beliefs, seen: Observation) -> None:
    """A picture of something that may be grasped: is it that, and is it clean?"""
    key = beliefs.asked.key
    beliefs.notes[key].checked = True
    thing = beliefs.things.get(key)
    if thing is not None and thing.label not in seen.labels:
        beliefs.notes[key].rejected = True
        beliefs.troubles += 1
    elif thing is not None:
        beliefs.things[key] = replace(thing, used=seen.used)


HEARD: Mapping[str, tuple[type, Callable[[Beliefs, Any], None]]] = {
    "explore_global": (ObjectMap, _explored),
    "explore_local": (ObjectMap, _mapped),
    "report_observation": (Observation, _seen),
    "navigate": (Outcome, _drove),
    "open": (Outcome, partial(_turned, opened=True)),
    "close": (Outcome, partial(_turned, opened=False)),
    "grasp": (Outcome, _grasped),
    "place": (Outcome, _placed),
    "place_among": (Outcome, _placed),
}
"""Call -> what it returns where it could be made, and what that changes."""
