"""Links, joints and frames of an SDF model with the models in it, and where each of them is.

After the SDF specification 1.0 to 1.12 (Pose frame semantics): a pose is relative to the model around it, that of a
joint to its child link, that of a frame to what it is attached to; `relative_to` names a link, joint, frame or model in
the same scope. What is in a model `inner` is called `inner::name` from outside; an include with `merge` adds no scope.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.geometry.transforms import inverse, transform_from
from scenewright.stages.library.importing.limits import MOST_LINKS, refuse_many
from scenewright.stages.library.importing.source_folder import SourceFolder, numbers
from scipy.spatial.transform import Rotation

DEEPEST_MODELS = 10
"""Deepest nesting of models; a bound against circles."""
MODEL = "__model__"
SCOPES = "::"


@dataclass(frozen=True, eq=False)
class Scope:
    """A model: names in it begin with `prefix` from outside."""

    prefix: str
    path: Path
    version: tuple[int, ...]
    element: ElementTree.Element
    frame: Frame | None = None
    """Where it is in the model around it; None for the outermost."""


@dataclass(frozen=True, eq=False)
class Frame:
    """Something with a pose: a link, joint, frame or model, in the scope that its names are looked up in."""

    element: ElementTree.Element
    scope: Scope
    base: str = ""
    """Name of what its pose is relative to when the pose does not say."""
    inside: Scope | None = None
    """What is in it, of a model."""

    @property
    def name(self) -> str:
        """Return its name as the outermost model has it."""
        return self.scope.prefix + self.element.get("name", "")

    @property
    def where(self) -> str:
        """Return file, kind and name, for messages."""
        return f"{self.scope.path}: {self.element.tag} {self.name!r:.60}"


@dataclass
class SdfTree:
    """What is in a model."""

    folder: SourceFolder
    findings: list[str]
    links: list[Frame] = field(default_factory=list)
    joints: list[Frame] = field(default_factory=list)
    scopes: list[Scope] = field(default_factory=list)
    _named: dict[str, Frame] = field(default_factory=dict)
    _poses: dict[Frame, np.ndarray] = field(default_factory=dict)

    def add(self, scope: Scope, depth: int = 0) -> None:
        """Add the content of a model. Raises BadInput."""
        refuse_many(str(scope.path), "links and models", len(self.links) + len(self.scopes), MOST_LINKS)
        if depth > DEEPEST_MODELS:
            raise BadInput(f"{scope.path}: models are nested too deeply, or include one another in a circle")
        self.scopes.append(scope)
        links = [Frame(link, scope) for link in scope.element.findall("link")]
        joints = [
            Frame(joint, scope, (joint.findtext("child") or "").strip()) for joint in scope.element.findall("joint")
        ]
        frames = [Frame(frame, scope, frame.get("attached_to", "")) for frame in scope.element.findall("frame")]
        self.links += links
        self.joints += joints
        for frame in (*links, *frames, *joints):  # before 1.7 a joint may have the name of a link
            self._named.setdefault(frame.name, frame)
        for model in scope.element.findall("model"):
            self._add_model(model, model, scope, scope.path, scope.version, depth)
        for include in scope.element.findall("include"):
            self._include(include, scope, depth)

    def _include(self, include: ElementTree.Element, scope: Scope, depth: int) -> None:
        uri = (include.findtext("uri") or "").strip()
        file = included_file(self.folder, uri, scope.path.parent)
        root = None if file is None else self.folder.read_xml(file)
        model = None if root is None else root.find("model")
        if file is None or root is None or model is None:
            self.findings.append(f"included model {uri!r:.80} is not in the folder, or is not an SDF: left out")
            return
        placed = ElementTree.Element("include", dict(include.attrib))
        own_pose = include.find("pose") is not None
        placed.extend((include if own_pose else model).findall("pose"))
        frame = include.findtext("placement_frame") if own_pose else model.get("placement_frame")
        placed.set("placement_frame", (frame or "").strip())
        placed.extend(include.findall("static"))
        placed.set("name", (include.findtext("name") or model.get("name") or "").strip())
        self._add_model(placed, model, scope, file, sdf_version(root), depth)

    def _add_model(
        self,
        placed: ElementTree.Element,
        model: ElementTree.Element,
        outer: Scope,
        path: Path,
        version: tuple[int, ...],
        depth: int,
    ) -> None:
        merged = placed.tag == "include" and placed.get("merge") in ("true", "1")
        prefix = outer.prefix if merged else f"{outer.prefix}{placed.get('name', '')}{SCOPES}"
        own_place = Frame(placed, outer)
        inside = Scope(prefix, path, version, model, own_place)
        frame = Frame(placed, outer, inside=inside)
        if not merged:
            self._named.setdefault(frame.name, frame)
        self.add(inside, depth + 1)

    def pose(self, frame: Frame) -> np.ndarray:
        """Return model_from_frame (4, 4) in the outermost model. Raises BadInput for names that lead nowhere."""
        return self._pose_up_to(frame, None)

    def pose_of_scope(self, scope: Scope) -> np.ndarray:
        """Return outermost_from_model (4, 4)."""
        return np.eye(4) if scope.frame is None else self.pose(scope.frame)

    def named(self, name: str, scope: Scope, where: str) -> Frame | None:
        """Return what a name means in a scope, None for the model itself. Raises BadInput, beginning with `where`."""
        if name == MODEL:
            return scope.frame
        key = scope.prefix + name.removesuffix(SCOPES + MODEL)
        if key not in self._named:
            raise BadInput(f"{where}: {name!r:.60} does not exist in the model")
        return self._named[key]

    def link(self, name: str, scope: Scope, where: str) -> Frame | None:
        """Return the link that a name stands for, through frames, joints and models; None for the world.

        Raises BadInput, beginning with `where`.
        """
        passed: set[Frame] = set()
        while name != "world":
            frame = self._first_link(scope) if name == MODEL else self.named(name, scope, where)
            if frame is None or frame in passed:
                break
            passed.add(frame)
            if frame.element.tag == "link":
                return frame
            if frame.inside is not None:
                name, scope = frame.inside.element.get("canonical_link", MODEL), frame.inside
            else:
                name, scope = frame.base or MODEL, frame.scope
        if name != "world":
            raise BadInput(f"{where}: {name!r:.60} is attached to no link")
        return None

    def _first_link(self, scope: Scope) -> Frame | None:
        return next((link for link in self.links if link.scope.prefix.startswith(scope.prefix)), None)

    def _pose_up_to(self, frame: Frame, top: Scope | None) -> np.ndarray:
        """Return the pose of a frame in a model around it; in the outermost one when `top` is None."""
        chain: dict[Frame, None] = {}
        at: Frame | None = frame
        known = self._poses if top is None else {}
        stop = None if top is None else top.frame
        while at is not None and at is not stop and at not in known:
            if at in chain:
                raise BadInput(f"{at.where}: poses are relative to one another in a circle")
            chain[at] = None
            at = self._base(at)
        pose = np.eye(4) if at is None or at is stop else known[at]
        for passed in reversed(chain):
            pose = pose @ self._local(passed)
            known[passed] = pose
        return pose

    def _base(self, frame: Frame) -> Frame | None:
        pose = frame.element.find("pose")
        name = "" if pose is None else pose.get("relative_to") or pose.get("frame") or ""
        return self.named(name or frame.base or MODEL, frame.scope, frame.where)

    def _local(self, frame: Frame) -> np.ndarray:
        pose = pose_element(frame.element, frame.where)
        placement = frame.element.get("placement_frame", "")
        if not placement:
            return pose
        inside = next(s for s in self.scopes if s.frame is not None and s.frame.element is frame.element)
        named = self.named(placement, inside, frame.where)
        return pose if named is None else pose @ inverse(self._pose_up_to(named, inside))


def sdf_version(root: ElementTree.Element) -> tuple[int, ...]:
    """Return the version that a file declares as (1, 4); that of the newest for one that declares none."""
    found = re.match(r"\s*(\d{1,3})\.(\d{1,3})", root.get("version", ""))
    return (99,) if found is None else tuple(int(part) for part in found.groups())


def pose_element(element: ElementTree.Element, where: str) -> np.ndarray:
    """Return what the `<pose>` of an element says (4, 4). Raises BadInput, beginning with `where`."""
    pose = element.find("pose")
    if pose is None or not (pose.text or "").strip():
        return np.eye(4)
    if pose.get("rotation_format") == "quat_xyzw":
        values = numbers(pose.text, 7, f"{where}: pose")
        if np.linalg.norm(values[3:]) < 1e-10:
            raise BadInput(f"{where}: pose with a quaternion of length 0")
        return transform_from(Rotation.from_quat(values[3:]).as_matrix(), values[:3])
    values = numbers(pose.text, 6, f"{where}: pose")
    angles = np.radians(values[3:]) if pose.get("degrees") in ("true", "1") else values[3:]
    return transform_from(Rotation.from_euler("xyz", angles).as_matrix(), values[:3])


def included_file(folder: SourceFolder, uri: str, base: Path) -> Path | None:
    """Return the SDF file that an include names: the file itself, or that of the newest version in its folder."""
    if uri.lower().endswith((".sdf", ".world", ".xml")):
        return folder.find(uri, base)
    config = folder.find(f"{uri}/model.config", base)
    versions = [] if config is None else files_of_config(folder, config)
    return versions[0] if versions else folder.find(f"{uri}/model.sdf", base)


def files_of_config(folder: SourceFolder, config: Path) -> list[Path]:
    """Return the SDF files of a `model.config`, the newest version first: they all say the same. Raises BadInput."""
    entries = [(sdf_version(e), (e.text or "").strip()) for e in folder.read_xml(config).findall("sdf")]
    files = [folder.find(name, config.parent) for _, name in sorted(entries, reverse=True)]
    return list(dict.fromkeys(f for f in files if f is not None and f.is_relative_to(config.parent)))


def named_by_sdf(folder: SourceFolder, path: Path, root: ElementTree.Element) -> Iterator[Path]:
    """Yield the files that models of an SDF include: parts of them, no models by themselves. Raises BadInput."""
    for model in root.iter("model"):
        for include in model.findall("include"):
            file = included_file(folder, (include.findtext("uri") or "").strip(), path.parent)
            if file is not None:
                yield file
