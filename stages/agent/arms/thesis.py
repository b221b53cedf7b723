"""The calls as section 3.3.3 (Han 2024) describes them: each tries once, and answers with a boolean."""

from __future__ import annotations

from scenewright.stages.agent.arms.skills import CommonSkills
from scenewright.stages.agent.arms.stations import around, drivable, middles
from scenewright.stages.agent.language.values import ObjectMap, Observation, Outcome, SceneObject
from scenewright.stages.agent.scene_map import Item, quarter
from scenewright.stages.agent.senses import Position

GRASPS = 20
"""Grasps that are planned before it gives up, those from above first (Han 2024, section 3.3.3)."""
SHORT = 0.1
"""Sides whose middle is this much farther from the target than the nearest are no "short distance" [m]."""


class ThesisSkills(CommonSkills):
    """Arms `open_loop`, `bool_feedback` and `thesis`."""

    def explore_local(self, place: str) -> ObjectMap:
        """Build the local map of a place anew from where the robot stands."""
        piece = self.scene.furniture[place]
        look = self._body.look((*piece.centre, piece.height), close=False)
        seen_keys = set()
        items = self.scene.enter(look.detections, place, lambda _: (look.sector, False))
        for detection, item in zip(look.detections, items, strict=True):
            item.votes = {(look.sector, False): detection.label}
            seen_keys.add(item.key)
        self.scene.items = {k: item for k, item in self.scene.items.items() if item.place != place or k in seen_keys}
        return self.scene.local_map(place)

    def picture_of_hand(self) -> Observation:
        """One picture; the same view of the same state says the same. A hand that looks empty counts as empty."""
        detection = self._body.look_at_hand(0)
        if detection is None:
            self.holding = None
        return Observation("hand", (detection.label,) if detection else ())

    def picture_of(self, target: SceneObject) -> Observation:
        """A close-up of what lies where a thing is, or all on a piece of furniture."""
        if target.key in self.scene.furniture:
            piece = self.scene.furniture[target.key]
            look = self._body.look((*piece.centre, piece.height), close=False)
            return Observation(target.key, tuple(d.label for d in look.detections))
        item = self.scene.items[target.key]
        detections = self._body.look(item.position, close=True).detections
        used = next((d.used for d in detections if d.label == item.label), None)
        return Observation(target.key, tuple(d.label for d in detections), used)

    def navigate(self, target: SceneObject) -> Outcome:
        """Drive to the pose nearest to the robot of those that face furniture, or the nearest to a thing."""
        if target.key in self.scene.furniture:
            piece = self.scene.furniture[target.key]
            poses = drivable(self.scene, self._body.base, middles(piece, self._body.stand_off))
            away = [abs(p.x - piece.centre[0]) + abs(p.y - piece.centre[1]) for _, p in poses]
            poses = [pair for pair, far in zip(poses, away, strict=True) if far <= min(away) + SHORT]
        else:
            item = self.scene.items[target.key]
            poses = drivable(
                self.scene, self._body.base, around(self.scene.furniture[item.place], self._body.stand_off)
            )
            poses.sort(key=lambda pair: abs(pair[1].x - item.position[0]) + abs(pair[1].y - item.position[1]))
        return Outcome(bool(poses) and self.drive(poses[0][1], target.key))

    def grasp(self, item: Item) -> Outcome:
        """Carry out the best grasp that can be planned."""
        felt = self._body.grasp(item.position, item.label, 0, most=GRASPS)
        if felt.ok:
            self.took(item)
        return Outcome(felt.ok)

    def place(self, target: SceneObject) -> Outcome:
        """Let go over a carrier, or over the nearest free spot of furniture."""
        return self.place_at(*self.places_on(target))

    def place_at(self, place: str, label: str, at: list[Position]) -> Outcome:
        """Let go over the first of the positions."""
        if not at:
            return Outcome(False)
        felt = self._body.release(at[0], label)
        if felt.ok:
            item = self.holding
            assert item is not None
            item.votes = {(quarter(self._body.base, at[0]), False): item.label}
            self.put(place, at[0])
        return Outcome(felt.ok)

    def pull(self, key: str, *, opening: bool) -> Outcome:
        """Pull or push the door in front."""
        piece = self.scene.furniture[key]
        felt = self._body.pull((*piece.centre, piece.height), opening=opening)
        if felt.ok:
            self.scene.set_opened(key, opening, felt.furniture)
        return Outcome(felt.ok)
