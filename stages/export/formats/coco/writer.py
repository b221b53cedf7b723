"""Writing pictures with masks as COCO has them: panoptic.json with PNGs, and the things again in instances.json."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.vocabulary import SemanticClass, load_vocabulary
from scenewright.stages.export.frames import ExportJob, FrameMasks
from scenewright.stages.export.pictures import picture_suffix
from scenewright.stages.kit.formats.masks import encode_panoptic_png, panoptic_name
from scenewright.stages.kit.formats.run_lengths import encode_rle


def write(job: ExportJob) -> None:
    """Write the frames that have masks; those without are counted.

    `images/frame_<frame>` is the sequence's own picture where there is one, `panoptic/<frame>.png` has ids
    R + 256 G + 65536 B, categories are the classes of data/vocabulary.toml by their ids. `score` (where it is below 1),
    `timestamp` [s] and `camera_name` are ours; other readers pass over them.
    """
    root, tally = job.root, job.tally
    for name in ("images", "panoptic"):
        (root / name).mkdir()
    images: list[dict[str, Any]] = []
    panoptic: list[dict[str, Any]] = []
    instances: list[dict[str, Any]] = []
    for frame in job.frames:
        if frame.masks is None:
            tally.left_out["missing_masks"] += 1
            continue
        name = panoptic_name(frame.index)
        picture = f"frame_{frame.index:06d}{picture_suffix(frame.color) if frame.color else '.jpg'}"
        if frame.color is not None:
            (root / "images" / picture).write_bytes(frame.color)
            tally.streams.add("color")
        (root / "panoptic" / name).write_bytes(encode_panoptic_png(frame.masks.ids))
        camera = job.cameras[frame.camera_name]
        images.append(
            {
                "id": frame.index,
                "file_name": picture,
                "width": camera.width,
                "height": camera.height,
                "timestamp": frame.stamp * 1e-9,
                "camera_name": frame.camera_name,
            }
        )
        rows = _rows(frame.masks, frame.index, first_id=len(instances) + 1)
        panoptic.append({"image_id": frame.index, "file_name": name, "segments_info": [row for row, _ in rows]})
        instances += [annotation for _, annotation in rows if annotation is not None]
        tally.streams.add("labels")
        tally.masks += len(rows)
        tally.frames += 1
    shared = {
        "info": {"description": "written by scenewright export --layout coco", "version": "1"},
        "licenses": [],
        "images": images,
    }
    classes = load_vocabulary().classes
    _write(root / "panoptic.json", shared | {"annotations": panoptic, "categories": _categories(classes, True)})
    thing_classes = [entry for entry in classes if entry.kind == "thing"]
    _write(
        root / "instances.json", shared | {"annotations": instances, "categories": _categories(thing_classes, False)}
    )


def _rows(masks: FrameMasks, image_id: int, first_id: int) -> list[tuple[dict[str, Any], dict[str, Any] | None]]:
    """Return of every mask its row of segments_info and, of a thing, its annotation of an instance."""
    rows: list[tuple[dict[str, Any], dict[str, Any] | None]] = []
    number = first_id
    for mask_id in sorted(masks.masks):
        mask, pixels = masks.masks[mask_id], masks.ids == mask_id
        lines, columns = np.flatnonzero(pixels.any(axis=1)), np.flatnonzero(pixels.any(axis=0))
        if not len(lines):
            continue
        shared = {
            "category_id": mask.class_id,
            "area": int(pixels.sum()),
            "bbox": [int(columns[0]), int(lines[0]), int(columns[-1] - columns[0]) + 1, int(lines[-1] - lines[0]) + 1],
            "iscrowd": 0,
        } | ({} if mask.score >= 1 else {"score": mask.score})
        annotation = None
        if mask.is_thing:
            annotation = {"id": number, "image_id": image_id, "segmentation": encode_rle(pixels), **shared}
            number += 1
        rows.append(({"id": mask_id, **shared}, annotation))
    return rows


def _categories(classes: Iterable[SemanticClass], panoptic: bool) -> list[dict[str, Any]]:
    rows = []
    for entry in classes:
        row: dict[str, Any] = {"id": entry.id, "name": entry.name, "supercategory": entry.node}
        if panoptic:
            row["isthing"] = int(entry.kind == "thing")
        rows.append(row)
    return rows


def _write(path: Path, document: dict[str, Any]) -> None:
    path.write_text(json.dumps(document, allow_nan=False) + "\n", encoding="utf-8")
