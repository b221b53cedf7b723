"""From a question to answers in words: things, places on them, counts, and near misses."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scenewright.cli.asking.asked_scene import AskedScene, AskedThing
from scenewright.cli.asking.best_image import best_image
from scenewright.cli.asking.free_places import FreePlace, free_places
from scenewright.schemas.errors import UsageError
from scenewright.schemas.vocabulary import UNNAMED
from scenewright.stages.kit.class_extents import LARGEST_EXTENT, SMALLEST_EXTENT
from scenewright.stages.kit.labels import plain
from scenewright.stages.kit.open_words.reading.matching import Match, is_layout, matches
from scenewright.stages.kit.open_words.reading.meaning import Meanings
from scenewright.stages.kit.open_words.reading.names import class_named
from scenewright.stages.kit.open_words.reading.phrase import Phrase

LEAST = 0.5
"""Probability from which on a thing is an answer."""
MOST = 5
"""Most answers that are told, and most near misses."""
FAINT = 0.02
"""What is less likely than this is no near miss."""
USUAL_FOOT = 0.1
"""Radius of the foot of a thing of which no size is known [m]."""
SLIM = 0.35
"""Radius of a foot over the diagonal of its thing; by eye."""
LEAST_SAID = 0.1
"""Posterior from which on a name is listed as one that a thing may have."""
SHORT = 0.6
"""Height of a thing over its diagonal; by eye."""


@dataclass
class Answer:
    """What is told of a question."""

    understood: str
    lines: list[str] = field(default_factory=list)
    things: list[dict[str, Any]] = field(default_factory=list)
    places: list[dict[str, Any]] = field(default_factory=list)
    near: list[dict[str, Any]] = field(default_factory=list)
    count: int | None = None


def answer(scene: AskedScene, phrase: Phrase, meanings: Meanings, robot: str = "") -> Answer:
    """Return what a scene answers to a phrase. Raises UsageError for a robot that is not there."""
    told = Answer(phrase.said())
    if phrase.relation and scene.graph is None:
        told.lines.append("a map alone does not say what stands on what: ask its contact graph or scene")
    if phrase.asks == "place":
        _tell_places(scene, phrase, meanings, robot, told)
        return told
    found = ranked(scene, phrase, meanings)
    likely = [(each, match) for each, match in found if match.probability >= LEAST]
    if phrase.asks == "count":
        told.count = len(likely)
        told.lines.append(f"{len(likely)}: {phrase.thing()}" if likely else f"none: {phrase.thing()}")
    for each, match in likely[:MOST]:
        told.things.append(_thing(scene, each, match))
        told.lines.append(_sentence(scene, told.things[-1]))
    if not likely:
        _tell_near(scene, phrase, meanings, found, told)
    elif len(likely) > MOST:
        told.lines.append(f"and {len(likely) - MOST} more")
    return told


def ranked(scene: AskedScene, phrase: Phrase, meanings: Meanings) -> list[tuple[AskedThing, Match]]:
    """Return the things of a scene with how well they answer, the likeliest first."""
    found = matches(phrase, [each.thing for each in scene.things], meanings, scene.graph)
    order = np.argsort([-match.probability for match in found], kind="stable")
    return [(scene.things[k], found[k]) for k in order]


def _thing(scene: AskedScene, each: AskedThing, match: Match) -> dict[str, Any]:
    mesh = scene.meshes[each.thing.instance]
    image = None if scene.sequence is None else best_image(scene.sequence, mesh.vertices)
    names = each.thing.names
    doubt = ""
    if match.name and names.is_doubtful():
        seen = f" in {names.looks:.0f} images" if names.looks else ""
        doubt = f"rests on one doubtful name: {match.name} ({names.shares[match.name]:.2f}{seen})"
    return {
        "name": each.name,
        "probability": round(match.probability, 3),
        "center": [round(float(value), 3) for value in each.box.center],
        "size": [round(float(value), 3) for value in each.box.size],
        "carrier": scene.carrier(each.name),
        "other": scene.names.get(match.other, ""),
        "by": match.meaning.layer,
        "how": match.meaning.how,
        "doubt": doubt,
        "image": None if image is None else vars(image),
    }


def _sentence(scene: AskedScene, row: dict[str, Any]) -> str:
    x, y, z = row["center"]
    on = f" on {row['carrier']}" if row["carrier"] else ""
    shown = f", best in frame {row['image']['frame']} ({row['image']['time']:g} s)" if row["image"] else ""
    how = f" ({row['how']})" if row["how"] and row["how"] != "named so" else ""
    doubt = f"; {row['doubt']}" if row["doubt"] else ""
    return f"{row['name']}{on} at {x:.2f} {y:.2f} {z:.2f}, {row['probability']:.2f} sure{how}{shown}{doubt}"


def _tell_near(
    scene: AskedScene, phrase: Phrase, meanings: Meanings, found: list[tuple[AskedThing, Match]], told: Answer
) -> None:
    """Say that there is none, and what comes near: what may be it, and what is of a like kind."""
    none = f"no {phrase.thing()}" + (f" {phrase.relation} {phrase.other.thing()}" if phrase.other is not None else "")
    near = [(each, match) for each, match in found if match.probability >= FAINT][:MOST]
    told.near = [{"name": each.name, "probability": round(match.probability, 3)} for each, match in near]
    unknown = [noun for noun in phrase.nouns if not meanings.knows(noun)]
    if unknown:
        told.lines.append(f"whether there is {phrase.thing()} is unknown: no layer knows {', '.join(unknown)}")
    words = [f"{_a(scene, each)} ({match.probability:.2f})" for each, match in near]
    told.lines.append(f"{none}; {'nearest: ' + ', '.join(words) if words else 'nothing comes near'}")


def _a(scene: AskedScene, each: AskedThing) -> str:
    on = scene.carrier(each.name)
    return f"{each.name} on {on}" if on else each.name


def _tell_places(scene: AskedScene, phrase: Phrase, meanings: Meanings, robot: str, told: Answer) -> None:
    if scene.graph is None:
        raise UsageError(
            "places are of a contact graph or scene, and this is a map", hint="scenewright graph; ask that"
        )
    own = [each for each, match in ranked(scene, _alone(phrase), meanings) if match.probability >= LEAST]
    radius, height = foot(own, phrase)
    said = "as large as " + own[0].name if own else "of a usual size"
    told.lines.append(f"a foot of {200 * radius:.0f} cm across, {100 * height:.0f} cm high: {said}")
    places = free_places(scene, radius, height, frozenset(each.name for each in own))
    if phrase.other is not None:
        wanted = {
            each.name: m.probability for each, m in ranked(scene, phrase.other, meanings) if m.probability >= LEAST
        }
        places = [place for place in places if place.on in wanted]
    else:
        places = [place for place in places if not place.on.startswith("floor")] or places
    reaching = _reaching(scene, robot)
    for place in places:
        row, line = _place(place), _place_sentence(place)
        if reaching is not None:
            reach = reaching.to(place.center)
            row |= {"reached": reach.reached, "base": reach.base}
            line += f"; {robot} gets there from {reach.base[0]:.2f} {reach.base[1]:.2f}" if reach.base else ""
            line += "" if reach.reached else f"; {robot} does not get there"
        told.places.append(row)
        told.lines.append(line)
        if sum(each.get("reached", True) for each in told.places) == MOST:
            break
    if not places:
        where = f" {phrase.relation} {phrase.other.thing()}" if phrase.other is not None else ""
        told.lines.append(f"no free level place of that size{where}")


def _alone(phrase: Phrase) -> Phrase:
    return Phrase(phrase.text, phrase.nouns, colors=phrase.colors, sizes=phrase.sizes)


def foot(own: list[AskedThing], phrase: Phrase) -> tuple[float, float]:
    """Return radius and height [m] of what is put down: as the scene has it, else as is usual of its class."""
    if own:
        x, y, z = own[0].box.size
        return float(np.hypot(x, y) / 2), float(z)
    name = next((name for noun in phrase.nouns if (name := class_named(noun))), "")
    low, high = SMALLEST_EXTENT.get(name), LARGEST_EXTENT.get(name)
    if high is None:
        return USUAL_FOOT, 2 * USUAL_FOOT
    extent = float(np.sqrt(low * high)) if low is not None else 0.6 * high
    return SLIM * extent, SHORT * extent


def _reaching(scene: AskedScene, robot: str) -> Any:
    if not robot:
        return None
    from scenewright.cli.asking.reaching import Reaching

    return Reaching(scene, robot)


def _place(place: FreePlace) -> dict[str, Any]:
    return {"on": place.on, "center": list(place.center), "radius": place.radius, "free_area": place.area}


def _place_sentence(place: FreePlace) -> str:
    x, y, z = place.center
    return (
        f"on {place.on} at {x:.2f} {y:.2f} {z:.2f}: free within {100 * place.radius:.0f} cm, {place.area:.2f} m2 in all"
    )


def can_be_asked(scene: AskedScene, meanings: Meanings) -> list[str]:
    """Return what a scene can be asked for, a line each."""
    classes: dict[str, list[AskedThing]] = {}
    for each in scene.things:
        if each.class_name != UNNAMED and not each.thing.is_layout:
            classes.setdefault(each.class_name, []).append(each)
    counted = [f"{plain(name)} ({len(of)})" for name, of in sorted(classes.items())]
    maybe = {name for each in scene.things for name, p in each.thing.names.shares.items() if p >= LEAST_SAID}
    lines = [f"things: {', '.join(counted)}"]
    if doubtful := sorted(plain(name) for name in maybe - set(classes) if not is_layout(name)):
        lines.append(f"perhaps: {', '.join(doubtful)}")
    lines.append('attributes: colours and sizes ("red cup", "large box")')
    if scene.graph is not None:
        lines.append('relations: on, in, under, beside ("cup on the table")')
        lines.append('places: "where can I put the cup?"')
    lines.append('wants: "something to drink from", "where can I sit?"')
    lines.append(f"words are understood by: {', '.join(meanings.layers())}")
    return lines
