"""The `rules` brain: no language model. It takes the words apart by patterns, lets the task planner order the steps,
and writes one of them at a time, by what came back of the last.

It believes what calls return and nothing else. How far it looks at what was done is the arm's `Style`.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

from scenewright.stages.agent.brains.brain import Reply
from scenewright.stages.agent.brains.slips import Slips
from scenewright.stages.agent.brains.steps import Step, steps_to, steps_to_door
from scenewright.stages.agent.brains.words import NotUnderstood, understood
from scenewright.stages.agent.goals import CARRIERS, FURNITURE, Among, Description, Gather, Goal, Move, Shut
from scenewright.stages.agent.language.interpreter import Called, Ran
from scenewright.stages.agent.language.values import ObjectMap, Observation, Outcome, SceneObject

MOST_FAILURES = 3
"""Of one step of one thing before it is left alone."""
SEVERAL = 2
"""Of the things that a middle is of: of one alone, the middle is where it stands."""
MOST_TROUBLES = 30
"""Of a session before it is given up."""


@dataclass(frozen=True)
class Style:
    """What the arm lets its brain do."""

    pictures: bool = False
    """Look at what will be grasped, what is held and what was placed, by a picture each (`thesis`)."""
    skilled: bool = False
    """Calls find base poses, repair and re-check by themselves and say why they failed (`ours`)."""
    rounds: int = 1
    """How often every place is looked at, from another side each, before something counts as not there."""
    thorough: int = 1
    """How often the places are looked at that all things of a kind are to be brought from."""


class _GiveUp(Exception):
    word = "give_up"


class _Ask(_GiveUp):
    word = "ask"


class RulesBrain:
    """Pursues goals in their order, one step a program."""

    label = "rules"

    def __init__(self, words: str, style: Style, slips: Slips) -> None:
        self._words, self._style, self._slips = words, style, slips
        self._goals: tuple[Goal, ...] = ()
        self._rooms: dict[str, SceneObject] = {}
        self._things: dict[str, SceneObject] = {}
        self._written: dict[str, str] = {}
        """Key of a thing -> the expression that a program names it by."""
        self._looked: Counter[str] = Counter()
        self._failed: Counter[tuple[str, str]] = Counter()
        self._rejected: set[str] = set()
        self._unmoved: set[str] = set()
        """Those of them that the arm did not get."""
        self._doubted: dict[str, str] = {}
        """Key of what looked like something else in the hand -> as what."""
        self._disputed: dict[str, str] = {}
        """Key of what does not look like what is sought from everywhere -> like what else."""
        self._checked: set[str] = set()
        self._moved: set[str] = set()
        self._handled: set[str] = set()
        """Classes of things that were taken, which may be anywhere since."""
        self._at, self._turn, self._troubles = "", 0, 0
        self._began = ""
        """What the robot stood before at first: what is said of no furniture is meant of this."""
        self._lost: list[SceneObject] = []
        """Things that left the hand and were not seen again: nothing is done as long as one is missing."""
        self._known: set[tuple[str, str]] = set()
        """Keys of all things that were ever on a map, with what they looked like."""
        self._held: SceneObject | None = None
        self._gathered = ""
        """Where things are being gathered."""
        self._asked: tuple[str, str] = ("", "")
        """Call and key of what the last program was about."""
        self._put_back = self._look_again = self._step_back = self._explored = False
        self._check: tuple[str, SceneObject, SceneObject] | None = None
        """`hand`, `spot` or `middle`, the thing, and the target: what a picture has to show."""

    def reply(self, last: Ran | None) -> Reply:
        """Return the next step as a program."""
        self._turn += 1
        try:
            goals = understood(self._words)
        except NotUnderstood as error:
            return Reply(str(error), f"ask({str(error)!r})")
        self._goals = goals
        if last is not None:
            self._learn(last)
        try:
            if self._troubles > MOST_TROUBLES:
                raise _GiveUp(f"{self._troubles} things went wrong")
            while True:
                try:
                    return self._next(goals)
                except _Again:  # each marks a place as looked at
                    continue
        except _GiveUp as reason:
            return Reply(str(reason), f"{reason.word}({str(reason)!r})")

    # ---- what came back ----

    def _learn(self, last: Ran) -> None:
        for called in last.calls:
            self._heard(called)
        if last.error is not None:
            self._troubles += 1
            if last.error.kind == "nothing_in_hand" and self._asked[0].startswith("place"):
                self._held, self._look_again = None, True
            if last.error.kind == "unknown_object":
                self._things.pop(self._asked[1], None)
                self._look_again = True
            if self._asked[0] == "navigate":
                self._asked = ("", "")  # it did not drive: what is in front is not what was asked for

    def _heard(self, called: Called) -> None:
        key, value = self._asked[1], called.value
        match called.name, value:
            case "explore_global", ObjectMap():
                self._rooms, self._explored = {item.key: item for item in value}, True
                self._at = ""  # exploring ends anywhere
            case "explore_local", ObjectMap():
                self._mapped(value)
            case "report_observation", Observation():
                self._seen(value)
            case "navigate", Outcome(ok=ok):
                if ok:
                    self._at = self._things[key].place if key in self._things else key
                else:
                    self._trouble("navigate", key)
            case (("open" | "close"), Outcome(ok=ok)):
                if ok:
                    self._rooms[key] = replace(self._rooms[key], opened=called.name == "open")
                    self._at = key
                else:
                    self._trouble("door", key)
            case "grasp", Outcome():
                self._grasped(self._things[key], value)
            case (("place" | "place_among"), Outcome()):
                self._placed(value)

    def _mapped(self, found: ObjectMap) -> None:
        place = self._at or next((item.place for item in found), "")
        self._at, self._began = place, self._began or place
        self._things = {k: t for k, t in self._things.items() if t.place != place}
        for item in found:
            again = [
                lost for lost in self._lost if lost.label == item.label and (item.key, item.label) not in self._known
            ]
            if again:
                self._lost.remove(again[0])
            self._known.add((item.key, item.label))
            self._things[item.key] = item
            self._written[item.key] = f"{self._map_name(place)}[{item.key!r}]"
        self._looked[place] += 1
        self._look_again = False

    def _map_name(self, place: str) -> str:
        return f"on_{place}" if place in self._rooms else "here"

    def _trouble(self, what: str, key: str) -> int:
        self._troubles += 1
        self._failed[what, key] += 1
        return self._failed[what, key]

    def _grasped(self, thing: SceneObject, outcome: Outcome) -> None:
        self._handled.add(thing.label)
        if outcome.ok:
            self._held = self._things.pop(thing.key)
            self._at = thing.place
            self._check = ("hand", thing, thing) if self._style.pictures else None
            return
        if outcome.kind == "disputed":
            self._disputed[thing.key] = outcome.label
            return
        tries = self._trouble("grasp", thing.key)
        if outcome.kind == "lost":
            self._lost.append(thing)
        if outcome.kind == "wrong_in_hand":
            self._held = replace(self._things.pop(thing.key), label=outcome.label)
        elif outcome.kind == "doubtful_in_hand":
            self._held = replace(self._things.pop(thing.key), doubt=outcome.label)
            self._doubted[thing.key] = outcome.label
            self._put_back = not any(self._either_way(self._held, goal) for goal in self._goals)
        elif outcome.kind == "doubtful":
            self._things[thing.key] = replace(thing, doubt=outcome.label)
        elif outcome.kind == "unreachable" or tries >= MOST_FAILURES:
            self._rejected.add(thing.key)
            self._unmoved.add(thing.key)
        else:
            if outcome.kind == "wrong_object":  # the views agree now
                self._doubted.pop(thing.key, None)
            self._at = thing.place
            self._look_again = True
            self._step_back = tries == MOST_FAILURES - 1 and not self._style.skilled

    def _placed(self, outcome: Outcome) -> None:
        thing, target = self._held, self._target
        assert thing is not None
        place = target.place or target.key
        if outcome.ok:
            on = target.key if target.label in CARRIERS else ""
            self._held = None
            self._things[thing.key] = replace(thing, place=place, on=on, label=outcome.label or thing.label)
            self._at = place
            if self._put_back:
                self._put_back = False
                if not self._style.skilled or self._failed["grasp", thing.key] >= MOST_FAILURES:
                    self._rejected.add(thing.key)
                self._look_again = self._style.skilled
                return
            self._moved.add(thing.key)
            where = "middle" if self._asked[0] == "place_among" else "spot"
            self._check = (where, thing, target) if self._style.pictures else None
            return
        tries = self._trouble("place", target.key)
        if outcome.kind == "lost":
            self._lost.append(replace(thing, place=place))
        if outcome.kind in ("not_there", "lost"):
            self._held, self._at, self._look_again = None, place, True
        elif outcome.kind == "unreachable" or tries >= MOST_FAILURES:
            self._rejected.add(target.key)
        else:
            self._step_back = tries == MOST_FAILURES - 1 and not self._style.skilled

    def _seen(self, seen: Observation) -> None:
        if self._check is None:
            self._looked_at(self._asked[1], seen)
            return
        what, thing, _ = self._check
        self._check = None
        if thing.label in seen.labels:
            return
        self._trouble("grasp" if what == "hand" else "place", thing.key)
        if what == "hand" and seen.labels:
            self._put_back = True
            return
        self._held = None
        self._things.pop(thing.key, None)
        self._moved.discard(thing.key)
        self._look_again = True

    def _looked_at(self, key: str, seen: Observation) -> None:
        """A picture of something that may be grasped: is it that, and is it clean?"""
        self._checked.add(key)
        thing = self._things.get(key)
        if thing is not None and thing.label not in seen.labels:
            self._rejected.add(key)
            self._troubles += 1
        elif thing is not None:
            self._things[key] = replace(thing, used=seen.used)

    # ---- what to do next ----

    def _next(self, goals: tuple[Goal, ...]) -> Reply:
        if not self._looked and not self._explored:
            return self._write("See what is here.", "explore_local", "", "here = explore_local()")
        if self._check is not None:
            what, _, target = self._check
            if what == "middle":
                return self._write("Does it lie there?", "report_observation", "", 'report_observation("rest")')
            if what == "hand":
                return self._write("Is it in the hand?", "report_observation", "", 'report_observation("stay")')
            return self._call("Does it lie there?", "report_observation", target)
        if self._step_back:
            return self._step_aside()
        if self._look_again:
            return self._look("Something is not as expected: look again.")
        if self._put_back and self._held is not None:
            return self._return_it(self._held)
        if self._held is not None:
            held = self._held
            labels = {held.label, held.doubt}
            goals = tuple(g for g in goals if any(self._moves(g).fits(c, held.color, held.used) for c in labels))
            if not goals:
                self._put_back = True
                return self._return_it(held)
        for goal in goals:
            step = self._pursue(goal)
            if step is not None:
                return step
        missing = [t for t in self._lost for g in goals if self._is_missed(t, g)]
        where = self._where_is(missing)
        if where is not None:
            return where
        if missing:
            raise _GiveUp(f"{missing[0].key} got lost on the way")
        for goal in goals:
            left = self._left_over(goal)
            if left:
                raise _GiveUp(left)
        return self._write("Everything is where it belongs.", "done", "", "done()")

    def _left_over(self, goal: Goal) -> str:
        """Say why a goal about all things of a kind is not known to be met: one was left alone, or may be of it."""
        what = goal.around if isinstance(goal, Among) else goal.what
        if not isinstance(goal, Among | Gather) and not (isinstance(goal, Move) and goal.every):
            return ""
        for thing in self._things.values():
            started = (
                not isinstance(goal, Move)
                or not goal.start
                or thing.place in self._furniture(Description((goal.start,)))
            )
            if not started or (isinstance(goal, Move) and self._is_on(thing, goal.onto, "place")):
                continue
            doubt = thing.doubt or self._doubted.get(thing.key, thing.label)
            if (thing.label in what.labels) != (doubt in what.labels):
                return f"{thing.key} may be a {thing.label} or a {doubt}"
            if (
                not isinstance(goal, Among)
                and thing.key in self._unmoved
                and what.fits(thing.label, thing.color, thing.used)
            ):
                return f"{thing.key} could not be moved"
        return ""

    def _is_missed(self, thing: SceneObject, goal: Goal) -> bool:
        every = isinstance(goal, Gather) or (isinstance(goal, Move) and goal.every)
        return every and self._moves(goal).fits(thing.label, thing.color, thing.used)

    def _where_is(self, missing: list[SceneObject]) -> Reply | None:
        """Look once more where the first of some things got lost; None where that was done often enough."""
        if not missing or self._failed["lost", missing[0].key] >= MOST_FAILURES:
            return None
        self._failed["lost", missing[0].key] += 1
        place = missing[0].place
        if self._at != place and place in self._rooms:
            return self._step(Step("navigate", place))
        return self._look(f"Where is {missing[0].key}?")

    @staticmethod
    def _moves(goal: Goal) -> Description:
        """What a goal has the robot carry; nothing for doors."""
        return Description(()) if isinstance(goal, Shut) else goal.what

    def _pursue(self, goal: Goal) -> Reply | None:
        match goal:
            case Shut(what=what, opened=opened):
                return self._shut(what, opened)
            case Gather(what=what, onto=onto):
                return self._gather(what, onto)
            case Among(what=what, around=around):
                return self._bring(what, around, Move(what, around), "place_among")
            case Move():
                return self._bring(goal.what, goal.onto, goal, "place")

    def _bring(self, what: Description, onto: Description, goal: Move, how: str) -> Reply | None:
        starts = self._furniture(Description((goal.start,))) if goal.start else []
        if goal.start or onto.labels[0] in FURNITURE:
            if not self._explored:
                return self._explore()
            if goal.start and not starts:
                raise _GiveUp(f"there is no {goal.start}")
        if not self._held:
            all_of_them = goal.every or how == "place_among"
            needed = starts if goal.start else [self._began] if all_of_them and self._began else []
            unseen = [p for p in needed if self._looked[p] < (self._style.thorough if all_of_them else 1)]
            if unseen:
                return self._go_and_look(unseen[0])
        fitting = [t for t in self._things.values() if t.key not in self._rejected]
        fitting = [t for t in fitting if t in self._fitting(what) or self._anyway(t, goal)]
        there = [t for t in fitting if self._is_on(t, onto, how)]
        away = [
            t for t in fitting if t not in there and (not goal.start or t.place in starts or t.label in self._handled)
        ]
        if self._held is None and ((there and not goal.every) or (goal.every and not away and there)):
            return None
        if not goal.every:  # one is enough: rather another one, and nobody has to be brought a wrong one
            away = [t for t in away if not self._may_be_other(t, what)]
        away.sort(key=lambda t: (t.place != self._at, -t.ahead, t.key))
        thing = self._held or next(iter(away), None)
        if thing is None:
            return self._search(what, starts)
        target = self._carrier(onto)
        alone = how == "place_among" and len(self._fitting(onto)) < SEVERAL
        if target is not None and alone and self._style.skilled and self._held is None:
            raise _GiveUp(f"one {onto.text} is all that was surely seen: it has no middle")
        if target is None:
            return self._search(onto, []) if onto.labels[0] not in FURNITURE else self._no_way(onto)
        return self._deliver(thing, what, target, how)

    def _gather(self, what: Description, onto: Description) -> Reply | None:
        if not self._explored:
            return self._explore()
        places = self._furniture(onto)
        unseen = [place for place in places if self._looked[place] < self._style.thorough]
        if unseen and self._held is None:
            return self._go_and_look(unseen[0])
        things = self._fitting(what)
        counts = Counter(thing.place for thing in things)
        able = [place for place in places if place not in self._rejected]
        if not able:
            return self._no_way(onto)
        if self._gathered not in able:
            self._gathered = max(able, key=lambda place: (counts[place], place == self._at))
        best = self._gathered
        thing = self._held or next((t for t in things if t.place != best), None)
        if thing is None:
            return None if things else self._search(what, [])
        return self._deliver(thing, what, self._rooms[best], "place")

    def _shut(self, what: Description, opened: bool) -> Reply | None:
        if not self._explored:
            return self._explore()
        for place in self._furniture(what):
            if self._rooms[place].opened != opened and place not in self._rejected:
                if self._failed["door", place] >= MOST_FAILURES:
                    raise _GiveUp(f"the door of {place} does not move")
                return self._step(steps_to_door(self._at, place, opened=opened)[0])
        if not self._furniture(what):
            raise _GiveUp(f"there is no {what.text}")
        return None

    def _deliver(self, thing: SceneObject, what: Description, target: SceneObject, how: str) -> Reply:
        """The next step that brings a thing to a target."""
        self._target = target
        holding = self._held is not None
        if not holding and thing.place == self._at and self._needs_picture(thing, what):
            return self._call("Is it what it looks like?", "report_observation", thing)
        source, place = "" if holding else thing.place, target.place or target.key
        doors = frozenset(key for key, item in self._rooms.items() if item.door)
        shut = frozenset(key for key in doors if not self._rooms[key].opened)
        steps = steps_to(self._at, source, place, shut, doors)
        if self._style.skilled:
            steps = tuple(step for step in steps if step.name != "navigate") or steps
        if not steps:
            raise _GiveUp(f"no steps bring {thing.key} to {target.key}")
        if steps[0].name in ("grasp", "place"):
            if steps[0].name == "grasp":
                return self._call(f"Take {thing.key}.", "grasp", thing)
            return self._call(f"Put it on {target.key}.", how, target)
        return self._step(steps[0])

    def _needs_picture(self, thing: SceneObject, what: Description) -> bool:
        clean = what.clean and thing.used is None and (self._style.pictures or self._style.skilled)
        return thing.key not in self._checked and (self._style.pictures or clean)

    def _return_it(self, held: SceneObject) -> Reply:
        """Put back what turned out to be something else, near something where the furniture is not known yet."""
        near = [t for t in self._things.values() if t.place == held.place and t.label not in CARRIERS]
        if held.place not in self._rooms and not near:
            return self._explore()
        self._target = self._rooms[held.place] if held.place in self._rooms else near[0]
        if self._at != held.place and not self._style.skilled:
            return self._step(Step("navigate", held.place))
        return self._call("That is not it: put it back.", "place", self._target)

    def _search(self, what: Description, places: list[str]) -> Reply:
        """Look where nobody looked yet, tables first, what has doors last; from other sides after that."""
        if self._held is not None and self._explored:
            raise _GiveUp(f"no {what.text} was found to put it on")
        where = self._where_is([t for t in self._lost if what.fits(t.label, t.color, t.used)])
        if where is not None:
            return where
        for thing in self._things.values():
            doubtful = self._style.skilled and what.clean and thing.label in what.labels and thing.used
            if doubtful and self._failed["picture", thing.key] < MOST_FAILURES - 1:
                self._failed["picture", thing.key] += 1
                return self._call("Is it really used?", "report_observation", thing)
        if not self._explored:
            return self._explore()
        order = places or sorted(
            self._rooms, key=lambda k: (self._rooms[k].door, self._rooms[k].label != "table", k != self._at)
        )
        for rounds in range(self._style.rounds):
            for place in order:
                if self._looked[place] <= rounds and place not in self._rejected:
                    return self._go_and_look(place)
        seen = sum(1 for place in order if self._looked[place])
        for thing in self._fitting(what):
            if self._may_be_other(thing, what):
                raise _Ask(f"is {thing.key} a {thing.label}, or a {self._disputed[thing.key]}?")
        for thing in self._things.values():
            if thing.key in self._unmoved and what.fits(thing.label, thing.color, thing.used):
                raise _GiveUp(f"{thing.key} could not be moved, and no other {what.text} was found in {seen} places")
        raise _GiveUp(f"no {what.text} was found in {seen} places")

    def _no_way(self, onto: Description) -> Reply:
        kept = [place for place in self._furniture(onto) if place in self._rejected]
        raise _GiveUp(f"the {onto.text} cannot be reached" if kept else f"there is no {onto.text}")

    def _go_and_look(self, place: str) -> Reply:
        """Go before furniture, open it where it has a door, and look; each in its turn."""
        if self._failed["navigate", place] >= MOST_FAILURES or self._failed["door", place] >= MOST_FAILURES:
            self._rejected.add(place)
            self._looked[place] += self._style.rounds
            raise _Again
        item = self._rooms.get(place)
        again = self._looked[place] > 0 and self._style.skilled and self._asked != ("navigate", place)
        if item is not None and (self._at != place or again):
            return self._step(Step("navigate", place))
        if item is not None and item.door and not item.opened:
            return self._step(Step("open", place))
        return self._look("What is here?")

    def _step_aside(self) -> Reply:
        """Drive before the thing itself, or before the furniture anew: another base pose, perhaps."""
        self._step_back = False
        verb, key = self._asked
        target = self._things.get(key) or self._rooms.get(key)
        if target is None:
            return self._look("Look again.") if self._look_again else self._write("Think again.", "", "", "print()")
        return self._call("Try from elsewhere.", "navigate", target)

    def _look(self, why: str) -> Reply:
        return self._write(why, "explore_local", self._at, f"{self._map_name(self._at)} = explore_local()")

    def _explore(self) -> Reply:
        return self._write("See what there is.", "explore_global", "", "rooms = explore_global()")

    def _step(self, step: Step) -> Reply:
        return self._call(f"{step.name} {step.furniture}", step.name, self._rooms[step.furniture])

    def _call(self, why: str, name: str, target: SceneObject) -> Reply:
        written = f"rooms[{target.key!r}]" if target.key in self._rooms else self._written[target.key]
        return self._write(why, name, target.key, f"{name}({written})")

    def _write(self, why: str, name: str, key: str, line: str) -> Reply:
        self._asked = (name, key)
        return Reply(why, self._slips.written(line, self._turn))

    # ---- what is believed ----

    def _furniture(self, what: Description) -> list[str]:
        return [key for key, item in self._rooms.items() if item.label in what.labels]

    def _fitting(self, what: Description) -> list[SceneObject]:
        fitting = [t for t in self._things.values() if what.fits(t.label, t.color, t.used)]
        return [t for t in fitting if t.key not in self._rejected and t.doubt in ("", *what.labels)]

    def _may_be_other(self, thing: SceneObject, what: Description) -> bool:
        """Whether some view said that a thing is none of what is sought."""
        return self._disputed.get(thing.key, thing.label) not in what.labels

    def _anyway(self, thing: SceneObject, goal: Goal) -> bool:
        """Whether what may as well be of a kind as not is brought: where all are to be, unless another goal is about
        what else it may be."""
        if not (isinstance(goal, Move) and goal.every and thing.doubt):
            return False
        classes = {thing.label, thing.doubt}
        others = {label for g in self._goals if g is not goal for label in self._moves(g).labels}
        return bool(classes & set(goal.what.labels)) and not classes & others

    def _either_way(self, thing: SceneObject, goal: Goal) -> bool:
        """Whether a goal has something brought that may be of one class or of another: it moves both, or all there are
        of the one."""
        labels = self._moves(goal).labels
        return (thing.label in labels and thing.doubt in labels) or self._anyway(thing, goal)

    def _is_on(self, thing: SceneObject, onto: Description, how: str) -> bool:
        if how == "place_among":
            return thing.key in self._moved
        if onto.labels[0] in FURNITURE:
            room = self._rooms.get(thing.place)
            return room is not None and room.label in onto.labels
        carrier = self._things.get(thing.on)
        return carrier is not None and onto.fits(carrier.label, carrier.color, carrier.used)

    def _carrier(self, onto: Description) -> SceneObject | None:
        if onto.labels[0] in FURNITURE:
            able = [key for key in self._furniture(onto) if key not in self._rejected]
            return self._rooms[able[0]] if able else None
        return next((t for t in self._fitting(onto)), None)


class _Again(Exception):
    """The beliefs have changed: think again."""
