"""MJCF (MuJoCo): bodies with their geoms, hinges and slides.

After MuJoCo's XML reference. A world body with several bodies holds several models; bodies that hang on the world by a
hinge or slide make the world body one piece of furniture. Nothing is simulated, and no plugin, texture or script runs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.library.importing.limits import (
    MOST_LINKS,
    MOST_LINKS_OF_A_FILE,
    MOST_TRIANGLES_OF_A_FILE,
    Allowance,
    few_findings,
    refuse_many,
)
from scenewright.stages.library.importing.mjcf_document import MAIN, MOST_ELEMENTS, MjcfDocument, Placed
from scenewright.stages.library.importing.mjcf_shapes import Gathered, collides, geom_surfaces, is_drawn
from scenewright.stages.library.importing.source_folder import SourceFolder, numbers
from scenewright.stages.library.importing.source_model import JointKind, SourceJoint, SourceLink, SourceModel

DEEPEST_BODIES = 60
"""Deepest nesting of bodies; a bound against damaged files."""
COUPLINGS = {"equality": "what they hold together", "tendon": "what they couple"}
"""Elements whose children tie joints and bodies to one another, and what then moves freely."""


def is_mjcf(root: ElementTree.Element) -> bool:
    """Whether the root element is that of a whole MJCF model (a `mujocoinclude` is only a part of one)."""
    return root.tag == "mujoco" and root.find("worldbody") is not None


def named_by_mjcf(root: ElementTree.Element) -> list[str]:
    """Return the files that an MJCF includes or attaches, as it names them: parts of it, no models by themselves."""
    elements = [*root.iter("include"), *(model for asset in root.iter("asset") for model in asset.findall("model"))]
    return [element.get("file", "") for element in elements]


def read_mjcf_models(folder: SourceFolder, path: Path) -> Iterator[SourceModel]:
    """Yield the models of an MJCF file. Raises BadInput."""
    yield from _Reader(MjcfDocument(folder, path)).models()


@dataclass
class _Tree:
    """Links and joints of one model while they are gathered, and the names of all elements in it."""

    document: MjcfDocument
    links: list[SourceLink] = field(default_factory=list)
    joints: list[SourceJoint] = field(default_factory=list)
    names: set[str] = field(default_factory=set)
    unknown: list[str] = field(default_factory=list)


class _Reader:
    def __init__(self, document: MjcfDocument) -> None:
        self.document, self.folder, self.path = document, document.folder, document.path
        self.findings = document.findings
        self.names: dict[str, int] = {}
        self.of_file = Allowance(
            str(self.path),
            triangles=MOST_TRIANGLES_OF_A_FILE,
            vertices=3 * MOST_TRIANGLES_OF_A_FILE,
            shapes=MOST_ELEMENTS,
        )
        self.gathered = Gathered((), self.findings)

    def models(self) -> Iterator[SourceModel]:
        """Yield the models one by one, as they may be many. Raises BadInput."""
        document = self.document
        in_world = document.in_world()
        bodies = [placed for placed in in_world if placed.tag == "body"]
        geoms = [placed for placed in in_world if placed.tag == "geom"]
        self.findings += document.unknown()
        names = (self.path.stem, document.root.get("model", ""))
        if not bodies and any(geom.attributes().get("type") not in ("plane", "hfield") for geom in geoms):
            yield self._model([_as_body(document)], self.path.stem, names)
            return
        if not bodies and self.findings:
            raise BadInput(f"{self.path}: holds no body: {'; '.join(self.findings[:3])}")
        refuse_many(str(self.path), "bodies", sum(map(_count_bodies, bodies)), MOST_LINKS_OF_A_FILE)
        if geoms:
            self.findings.append(f"{len(geoms)} geoms of the world body are left out")
        if any(_moves(body) for body in bodies):
            yield self._model(bodies, self.path.stem, names)
            return
        things = [thing for body in bodies for thing in _things(body)]
        if len(things) == 1:
            yield self._model(things, self.path.stem, (*names, *_body_names(things[0])))
            return
        for number, thing in enumerate(things):
            own_names = tuple(_body_names(thing)) or (f"{self.path.stem}_{number}",)
            yield self._model([thing], f"{self.path.stem}_{own_names[0]}", own_names)

    def _model(self, bodies: list[Placed], name: str, words: tuple[str, ...]) -> SourceModel:
        tree, self.names = _Tree(self.document), {"model": 1}
        refuse_many(str(self.path), "bodies", sum(map(_count_bodies, bodies)), MOST_LINKS)
        self.gathered = Gathered((Allowance(str(self.path)), self.of_file), self.findings)
        of_file = len(self.findings)
        tree.links.append(SourceLink("model"))
        for body in bodies:
            self._body(tree, body, "model", 0)
        self.findings += tree.unknown
        self.findings += self._couplings(tree.names)
        findings = few_findings(self.findings)
        del self.findings[of_file:]  # what was said of this model is not said of the next
        return SourceModel(
            name=name,
            source=self.folder.relative(self.path),
            format="MJCF",
            links=tuple(tree.links),
            joints=tuple(tree.joints),
            words=tuple(word for word in words if word),
            findings=findings,
        )

    def _couplings(self, names: set[str]) -> Iterator[str]:
        """Yield what is said of constraints and tendons on elements of these names."""
        for tag, consequence in COUPLINGS.items():
            couplings = [
                coupling
                for document in self.document.with_attached()
                for element in document.root.findall(tag)
                for coupling in element
                if any(not names.isdisjoint(part.attrib.values()) for part in coupling.iter())
            ]
            if couplings:
                kinds = ", ".join(dict.fromkeys(coupling.tag for coupling in couplings))
                yield f"{len(couplings)} of <{tag}> ({kinds}) left out: {consequence} moves freely"

    def _body(self, tree: _Tree, placed: Placed, parent: str, depth: int) -> None:
        if depth > DEEPEST_BODIES:
            raise BadInput(f"{self.path}: bodies are nested too deeply")
        body, inner = placed.element, placed.inner()
        name = self._unique(placed.prefix + body.get("name", "body"))
        where = f"{self.path}: body {name!r:.60}"
        tree.names.update(e.get("name", "") for e in (body, *(part.element for part in inner)) if e.get("name"))
        if depth == 0 or placed.document is not tree.document:
            tree.unknown += placed.unknown()
        tree.joints.append(self._joint(placed, inner, parent, name, where))
        visual, collision, masses, marks = [], [], [], []
        for part in inner:
            if part.tag not in ("geom", "site"):
                continue
            attributes = part.attributes()
            if part.tag == "site":
                point = numbers(attributes.get("pos", "0 0 0"), 3, where)
                marks.append((attributes.get("name", ""), apply(part.parent_from_frame, point[None])[0]))
                continue
            surfaces = geom_surfaces(part, attributes, self.gathered, where)
            visual += surfaces if is_drawn(attributes, where) else []
            collision += surfaces if collides(attributes) else []
            if "mass" in attributes:
                masses.append(float(numbers(attributes["mass"], 1, f"{where}: mass")[0]))
        inertial = next((part.element for part in inner if part.tag == "inertial"), None)
        mass = float(numbers(inertial.get("mass"), 1, where)[0]) if inertial is not None else sum(masses)
        tree.links.append(SourceLink(name, tuple(visual), tuple(collision), mass if mass > 0 else None, tuple(marks)))
        for part in inner:
            if part.tag == "body":
                self._body(tree, part, name, depth + 1)

    def _unique(self, name: str) -> str:
        unique, number = name, self.names.get(name, 0)
        while unique in self.names:
            number += 1
            unique = f"{name}_{number}"
        self.names[unique] = 1
        self.names[name] = max(number, 1)
        return unique

    def _joint(self, body: Placed, inner: Sequence[Placed], parent: str, name: str, where: str) -> SourceJoint:
        parent_from_body = body.pose(dict(body.element.attrib), where)
        fixed = SourceJoint(f"{name}_fixed", "fixed", parent, name, parent_from_body)
        moving = [(part, part.attributes()) for part in inner if part.tag == "joint"]
        if any(part.tag == "freejoint" for part in inner) or any(a.get("type") == "free" for _, a in moving):
            return replace(fixed, kind="floating")
        usable = [(part, a) for part, a in moving if a.get("type", "hinge") in ("hinge", "slide")]
        if len(usable) < len(moving):
            self.findings.append(f"body {name!r:.40}: ball joints are held fast")
        if not usable:
            return fixed
        if len(usable) > 1:
            self.findings.append(f"body {name!r:.40}: only the first of {len(usable)} joints moves")
        part, attributes = usable[0]
        hinge = attributes.get("type", "hinge") == "hinge"
        limited = attributes.get("limited", "auto")
        kind: JointKind = "revolute" if hinge else "prismatic"
        lower = upper = 0.0
        if "range" in attributes and limited != "false":
            factor = part.document.angles.unit if hinge else 1.0
            low, high = numbers(attributes["range"], 2, f"{where}: range")
            reference = float(numbers(attributes.get("ref", "0"), 1, f"{where}: ref")[0])
            lower, upper = float(low - reference) * factor, float(high - reference) * factor
        elif hinge:
            kind = "continuous"
        else:
            self.findings.append(f"slide {attributes.get('name', name)!r:.40} has no range: held fast")
            return fixed
        anchor = numbers(attributes.get("pos", "0 0 0"), 3, f"{where}: joint pos")
        return SourceJoint(
            name=part.prefix + attributes["name"] if "name" in attributes else f"{name}_joint",
            kind=kind,
            parent=parent,
            child=name,
            parent_from_child=parent_from_body,
            anchor=apply(part.parent_from_frame, anchor[None])[0],
            axis=part.parent_from_frame[:3, :3] @ numbers(attributes.get("axis", "0 0 1"), 3, f"{where}: joint axis"),
            lower=lower,
            upper=upper,
        )


def _as_body(document: MjcfDocument) -> Placed:
    """Return the world body as a body: a file may hold a thing that stands fast, and nothing else."""
    body = ElementTree.Element("body")
    for world in document.root.findall("worldbody"):
        body.extend(world)
    return Placed(body, document, np.eye(4), MAIN)


def _count_bodies(placed: Placed) -> int:
    waiting, count = [placed], 0
    while waiting:
        count += 1
        waiting += [part for part in waiting.pop().inner() if part.tag == "body"]
    return count


def _moves(body: Placed) -> bool:
    """Whether the body hangs on its parent by a hinge or slide."""
    joints = [part.attributes() for part in body.inner() if part.tag == "joint"]
    return any(joint.get("type", "hinge") in ("hinge", "slide") for joint in joints)


def _things(body: Placed) -> list[Placed]:
    """Return the body, or the bodies that an unnamed frame around several of them holds, moved into its frame."""
    parts = body.inner()
    inner = [part for part in parts if part.tag == "body"]
    holds_more = any(part.tag == "geom" for part in parts) or any(_moves(child) for child in inner)
    return [body] if body.element.get("name") or len(inner) < 2 or holds_more else inner


def _body_names(body: Placed) -> Iterator[str]:
    """Yield the names of the body and of those in it, outermost first; of the inner ones only the first."""
    while True:
        if name := body.element.get("name"):
            yield name
            return
        inner = next((part for part in body.inner() if part.tag == "body"), None)
        if inner is None:
            return
        body = inner
