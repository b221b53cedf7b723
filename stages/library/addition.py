"""Import a folder of models into a CAD library: read each, choose its frame, write its folder, say what was found."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.cad_library import CadLibrary, CadModel, ImportedModel, ImportFile, LibraryFile
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.cad_models import model_folder
from scenewright.stages.kit.formats.model_writer import write_model_folder
from scenewright.stages.kit.geometry.file_axes import AXES, UNITS, Direction, axis_name, upright_rotation
from scenewright.stages.kit.stage import Context
from scenewright.stages.library.importing.assembly import Assembled, assembled
from scenewright.stages.library.importing.classes import class_of, usual_size
from scenewright.stages.library.importing.discovery import Unread, find_models
from scenewright.stages.library.importing.frames import Choice, choose, model_rotation
from scenewright.stages.library.importing.fronts import BACKED, front_of_back_rest, told_front
from scenewright.stages.library.importing.grouping import Group, grouped, source_corners, source_points
from scenewright.stages.library.importing.limits import few_findings, plain_text, told_refusals
from scenewright.stages.library.importing.mapping import SKIP, Entry, Mapping, read_mapping
from scenewright.stages.library.importing.mesh_units import apart, far_hinge, in_unit, names_meshes
from scenewright.stages.library.importing.placing import centered, placed_parts, plain_name, turned
from scenewright.stages.library.importing.report import table_lines
from scenewright.stages.library.importing.source_folder import SourceFolder
from scenewright.stages.library.importing.source_model import Declared, SourceModel
from scenewright.stages.library.importing.versions import uses_coacd
from scenewright.stages.library.parameters import AdditionParameters

IMPORTS_FILE = "imports.json"
Y_UP_FORMATS = ("OBJ", "ShapeNetSem")
SMALLEST, LARGEST = 0.001, 10_000.0
"""Largest extent of a model [m] that is taken."""


@dataclass(frozen=True)
class Said:
    """What the options and the mapping say about a model."""

    entry: Entry
    parameters: AdditionParameters

    def class_name(self, source: SourceModel) -> str | None:
        """Return the class: of the mapping, the option, or the names; None when nothing tells."""
        return self.entry.class_name or self.parameters.class_name or class_of(source.words)

    def unit(self, source: SourceModel) -> Declared:
        """Return the unit [m] that is said, else the declared one."""
        name = self.entry.unit or self.parameters.unit
        return source.unit if name == "declared" else Declared(UNITS[name], "option")

    def up(self, source: SourceModel) -> Declared:
        """Return the up axis that is said, else the declared one."""
        name = self.entry.up or self.parameters.up
        return source.up if name == "declared" else Declared(AXES[name], "option")

    def front(self, source: SourceModel) -> Declared:
        """Return the front that is said, else the declared one."""
        name = self.entry.front or self.parameters.front
        return source.front if name == "declared" else Declared(AXES[name], "option")


def run(
    models: Path, library: CadLibrary | None, mapping: Path | None, *, parameters: AdditionParameters, context: Context
) -> CadLibrary:
    """Import every model of the folder, beside those of `library` when it is given.

    Raises BadInput when there is no folder, or nothing in it could be imported; UsageError for an unknown class.
    """
    _check_options(models, parameters)
    decompose = uses_coacd(parameters)
    mapping_file = read_mapping(mapping) if mapping is not None else Mapping()
    all_models, records, seed = _copy_models(library, context)
    uses = {} if library is None else {entry.model: entry for entry in library.info.affordances}
    names = {model.id.lower(): 1 for model in all_models}
    folder = SourceFolder(models)
    imported = 0
    for source in context.progress.track(find_models(folder), description="importing models"):
        if isinstance(source, Unread):
            records.append(
                _record_of_left_out(source.source, source.source, "", (source.reason.replace(f"{folder.root}/", ""),))
            )
            continue
        source = replace(source, name=plain_text(source.name), source=plain_text(source.source))
        try:
            with told_refusals(source.name):
                record, result = _import(source, Said(mapping_file.entry(source), parameters), names, decompose)
        except BadInput as error:
            reason = str(error).replace(f"{folder.root}/", "")
            record, result = (
                _record_of_left_out(source.name, source.source, source.format, (reason, *source.findings)),
                None,
            )
        records.append(record)
        if result is not None:
            names.setdefault(result.model.id.lower(), 1)
            write_model_folder(context.output / "models" / result.model.id, result.model, result.parts)
            all_models.append(result.model)
            uses[result.model.id] = result.affordances
            imported += 1
    for line in table_lines(records):
        context.logger.info(line)
    if imported == 0:
        why = _why(records[-1]) if records else "it holds no model files"
        raise BadInput(f"{models}: nothing was imported: {why}", hint="see docs/LIBRARY.md")
    affordance_files = tuple(uses[model.id] for model in all_models if model.id in uses)
    LibraryFile(seed=seed, models=tuple(all_models), affordances=affordance_files).write(
        context.output / "library.json"
    )
    ImportFile(models=tuple(records)).write(context.output / IMPORTS_FILE)
    summary = {
        "models": len(all_models),
        "imported": imported,
        "left_out": sum(not record.id for record in records),
        "classes": len({model.class_name for model in all_models}),
        "articulated": sum(model.articulated for model in all_models),
        "joints": sum(len(model.joints) for model in all_models),
    }
    return CadLibrary(context.output, summary=summary)


def _why(record: ImportedModel) -> str:
    """Return why a model was left out, with its name."""
    reason = record.findings[0] if record.findings else "it was left out"
    return reason if record.name in reason or record.source in reason else f"{record.name}: {reason}"


def _check_options(models: Path, parameters: AdditionParameters) -> None:
    if not Path(models).is_dir():
        raise BadInput(f"{models}: no folder", hint="give the folder that holds the models")
    names = [entry.name for entry in load_vocabulary().classes]
    if parameters.class_name and parameters.class_name not in names:
        raise UsageError(f"no class {parameters.class_name!r}", hint=f"one of: {', '.join(names)}")


def _copy_models(library: CadLibrary | None, context: Context) -> tuple[list[CadModel], list[ImportedModel], int]:
    """Copy the models of an existing library; return them, what was said when they were imported, and its seed."""
    if library is None:
        return [], [], context.seed
    for model in context.progress.track(library.info.models, description="copying models"):
        _copy_folder(model_folder(library, model.id), context.output / "models" / model.id)
    records: list[ImportedModel] = []
    if (path := library.path(IMPORTS_FILE)).is_file():
        records = list(ImportFile.read(path).models)
    return list(library.info.models), records, library.info.seed


def _copy_folder(source: Path, target: Path) -> None:
    """Copy the files of a model; links and devices beside them are none of its. Raises BadInput."""
    for path in sorted(source.rglob("*")):
        if path.is_symlink() or not (path.is_file() or path.is_dir()):
            raise BadInput(f"{path}: a link or a device in a model's folder", hint="make the library again")
        if path.is_file():
            copied = target / path.relative_to(source)
            copied.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, copied)


def _import(
    source: SourceModel, settings: Said, names: dict[str, int], decompose: bool
) -> tuple[ImportedModel, Assembled | None]:
    """Return what was found out about a model, and the model; None in its place when it is left out."""
    parameters = settings.parameters
    class_name = settings.class_name(source)
    if class_name is None and parameters.unknown == "object":
        class_name = "object"
    if class_name == SKIP:
        return _record_of_left_out(source.name, source.source, source.format, ("left out by the mapping",)), None
    if class_name is None:
        reason = "nothing tells its class (--class-name, --mapping, --unknown object)"
        return _record_of_left_out(source.name, source.source, source.format, (reason, *source.findings)), None
    groups, findings = grouped(source)
    points = source_points(groups)
    if not np.isfinite(points).all() or float(np.abs(points).max()) > 1e9:
        raise BadInput(f"{source.source}: corners are not finite, or far away")
    unit, up = settings.unit(source), settings.up(source)
    described = names_meshes(source)

    def points_in(metres: float) -> np.ndarray:
        if not described or (unit.origin != "option" and metres == unit.value):
            return metres * points
        changed, scale, _ = in_unit(source, metres)
        return scale * source_points(grouped(changed)[0])

    told_up = _told_up(groups, class_name) if up.value is None else None
    choice = choose(unit, up, points_in, usual_size(class_name), source.format in Y_UP_FORMATS, told_up)
    extent = float(np.ptp(points_in(choice.unit), axis=0).max())
    if not SMALLEST <= extent <= LARGEST:
        raise BadInput(
            f"{source.source}: {extent:.3g} m large in units of {choice.unit:g} m", hint="--unit says otherwise"
        )
    scale = choice.unit
    if described and choice.unit_origin == "option":
        source, scale, finding = in_unit(source, choice.unit)
        findings += [finding] if finding else []
        groups, _ = grouped(source)
    if (far := apart(groups)) is not None:
        findings.append(f"{far[0]!r:.40} lies {far[1] * scale:.3g} m from everything else of it")
    if (hinge := far_hinge(groups)) is not None:
        findings.append(f"the axis of joint {hinge[0]!r:.40} passes {hinge[1] * scale:.3g} m from its part")
    front = settings.front(source)
    given_front = front.value if isinstance(front.value, tuple) else None
    placed, findings_of_parts = placed_parts(
        source,
        groups,
        model_rotation(choice.up, given_front),
        scale,
        collision_given=parameters.collision == "given",
        decompose=decompose,
    )
    front_name, front_from = axis_name(given_front) if given_front is not None else "", front.origin
    if given_front is None:
        found_front = told_front(placed, class_name)
        upright = upright_rotation(choice.up)
        direction: Direction = found_front[0] if found_front is not None else AXES["-y"]
        placed = turned(placed, direction)
        front_from = found_front[1] if found_front is not None else "assumed"
        front_name = axis_name(as_vector(upright.T @ np.asarray(direction)))
    model_id = _free_id(plain_name(source.name) or class_name, names)
    result = assembled(
        centered(placed),
        model_id,
        class_name,
        contains=settings.entry.contains if settings.entry.contains is not None else source.contains,
        density=parameters.density,
        recipe={"source": source.source, "format": source.format},
    )
    findings = [*choice.findings, *source.findings, *findings, *findings_of_parts, *result.findings]
    result = replace(result, findings=few_findings([plain_text(finding) for finding in findings]))
    return _record(source, result, choice, front_name, front_from), result


def _told_up(groups: Sequence[Group], class_name: str) -> Direction | None:
    """Return the one of +y and +z with which a chair or the like has a back rest; None when both or neither."""
    if class_name not in BACKED:
        return None
    corners = source_corners(groups)
    told = [up for up in (AXES["+y"], AXES["+z"]) if front_of_back_rest(corners @ upright_rotation(up).T) is not None]
    return told[0] if len(told) == 1 else None


def _free_id(name: str, names: dict[str, int]) -> str:
    """Return an id that is not taken: name, name_2, ...; `names` (lower case) holds the last number of each."""
    free_id, number = name, names.get(name.lower(), 1)
    while free_id.lower() in names:
        number += 1
        free_id = f"{name}_{number}"
    if number > 1:
        names[name.lower()] = number
    return free_id


def _record(source: SourceModel, result: Assembled, choice: Choice, front: str, front_from: str) -> ImportedModel:
    model, closed = result.model, result.model.states[0]
    size = np.asarray(closed.box_maximum) - np.asarray(closed.box_minimum)
    return ImportedModel(
        id=model.id,
        name=source.name,
        source=source.source,
        format=source.format,
        class_name=model.class_name,
        size=as_vector(np.round(size, 6)),
        unit=choice.unit if source.mesh_unit is None else choice.unit * source.mesh_unit,
        unit_from=choice.unit_origin if source.mesh_unit is None else "meshes",
        up=axis_name(choice.up),
        up_from=choice.up_origin,
        front=front,
        front_from=front_from,
        joints=len(model.joints),
        collision_pieces=result.collision_pieces,
        can_be_carried=model.movable,
        can_be_opened=any(joint.upper > 0 for joint in model.joints),
        can_contain=model.contains,
        can_support=any(plane.horizontal for plane in closed.planes),
        has_handle=any(joint.handle is not None for joint in model.joints),
        findings=result.findings,
    )


def _record_of_left_out(name: str, source: str, kind: str, findings: tuple[str, ...]) -> ImportedModel:
    return ImportedModel(
        id="",
        name=plain_text(name),
        source=plain_text(source),
        format=kind,
        class_name="",
        size=None,
        unit=None,
        unit_from="",
        up="",
        up_from="",
        front="",
        front_from="",
        joints=0,
        collision_pieces=0,
        can_be_carried=False,
        can_be_opened=False,
        can_contain=False,
        can_support=False,
        has_handle=False,
        findings=few_findings([plain_text(finding) for finding in findings]),
    )
