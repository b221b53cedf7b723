"""The same table and cup, written as other tools write masks: one function a layout, each into a folder of its own."""

from __future__ import annotations

import base64
import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image
from scenewright.stages.kit.formats.run_lengths import encode_rle
from scenewright.stages.segment.backends.masks.formats.colored_png import voc_colors

HEIGHT, WIDTH = SHAPE = (48, 64)
TABLE = [[4, 20], [60, 20], [60, 44], [4, 44]]
CUP = [[10, 4], [20, 4], [20, 16], [10, 16]]
THINGS = {"table": TABLE, "cup": CUP}


def true_mask(corners: list[list[int]]) -> np.ndarray:
    mask = np.zeros(SHAPE, dtype=bool)
    (left, top), (right, bottom) = corners[0], corners[2]
    mask[top:bottom, left:right] = True
    return mask


TRUE = {name: true_mask(corners) for name, corners in THINGS.items()}
VALUES = TRUE["table"] * 1 + TRUE["cup"] * 2
STACK = np.array([TRUE["table"], TRUE["cup"]])
"""(2, H, W): both as masks of one picture."""


def flat(corners: list[list[int]]) -> list[float]:
    return [float(value) for point in corners for value in point]


def coco(root: Path, encode: Callable[[str], Any], name: str = "{:06d}.png", **size: int) -> None:
    images = [{"id": 10 + k, "file_name": name.format(k), **size} for k in (2, 3)]
    rows = [
        {"id": k, "image_id": 12, "category_id": k, "iscrowd": k, "segmentation": encode(thing)}
        for k, thing in enumerate(THINGS)
    ]
    rows.append({"id": 9, "image_id": 12, "category_id": 0, "bbox": [0, 0, 3, 3], "segmentation": []})
    categories = [{"id": k, "name": thing} for k, thing in enumerate(THINGS)]
    (root / "instances.json").write_text(json.dumps({"images": images, "annotations": rows, "categories": categories}))


def coco_polygons(root: Path) -> None:
    coco(root, lambda thing: [flat(THINGS[thing])], width=WIDTH, height=HEIGHT)


def coco_mixed(root: Path) -> None:
    coco(root, lambda thing: [flat(CUP)] if thing == "cup" else encode_rle(TRUE[thing]))


def coco_of_roboflow(root: Path) -> None:
    coco(root, lambda thing: [flat(THINGS[thing])], "rgb_{:06d}_png.rf.0a1b2c3d4e5f60718293a4b5c6d7e8f9.jpg")


def coco_in_parts(root: Path) -> None:
    """As Roboflow splits it, with ids that come twice."""
    coco_polygons(root)
    data = json.loads((root / "instances.json").read_text())
    (root / "instances.json").unlink()
    for part, (image, rows) in {
        "train": (data["images"][0], data["annotations"]),
        "valid": ({**data["images"][1], "id": 12}, []),
    }.items():
        (root / part).mkdir()
        text = json.dumps({"images": [image], "annotations": rows, "categories": data["categories"]})
        (root / part / "_annotations.coco.json").write_text(text)


def labelme(root: Path) -> None:
    _, png = cv2.imencode(".png", np.full((12, 10), 255, np.uint8))
    halves = [
        {"label": "table", "points": [TABLE[0], TABLE[2]], "shape_type": "rectangle", "group_id": 1},
        {"label": "table", "points": [[5, 21], [9, 21], [9, 30]], "shape_type": "polygon", "group_id": 1},
    ]
    crop = {
        "label": "cup",
        "points": [[10, 4], [19, 15]],
        "shape_type": "mask",
        "mask": base64.b64encode(png.tobytes()).decode(),
    }
    point = {"label": "cup", "points": [[1, 1]], "shape_type": "point"}
    for k, shapes in ((2, [*halves, crop, point]), (3, [])):
        data = {"shapes": shapes, "imagePath": f"..\\rgb\\{k:06d}.png", "imageData": None}
        (root / f"{k:06d}.json").write_text(json.dumps({**data, "imageWidth": WIDTH, "imageHeight": HEIGHT}))


def via(root: Path) -> None:
    table = {"name": "rect", "x": 4, "y": 20, "width": 56, "height": 24}
    cup = {"name": "polygon", "all_points_x": [x for x, _ in CUP], "all_points_y": [y for _, y in CUP]}
    regions = [
        {"shape_attributes": table, "region_attributes": {"class": "table", "colour": "brown"}},
        {"shape_attributes": cup, "region_attributes": {"type": {"cup": True, "table": False}}},
        {"shape_attributes": {"name": "point", "cx": 1, "cy": 2}, "region_attributes": {"class": "cup"}},
    ]
    rows = {
        f"{k}.png99": {"filename": f"{k:06d}.png", "size": 99, "regions": r, "file_attributes": {}}
        for k, r in ((2, regions), (3, []))
    }
    (root / "project.json").write_text(json.dumps({"_via_settings": {}, "_via_img_metadata": rows}))


def brush(mask: np.ndarray) -> list[int]:
    """Label Studio's code, written here a second time: runs of one value, counts of 16 bits."""
    values = np.repeat(mask.ravel().astype(np.uint8) * 255, 4)
    bits = f"{len(values):032b}" + f"{7:05b}" + f"{15:04b}" * 4
    ends = [*(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values)]
    for start, end in zip([0, *ends], ends, strict=False):
        bits += "1" + "00" + f"{end - start - 1:016b}" + f"{values[start]:08b}"
    bits += "0" * (-len(bits) % 8)
    return [int(bits[k : k + 8], 2) for k in range(0, len(bits), 8)]


def label_studio(root: Path) -> None:
    size = {"original_width": WIDTH, "original_height": HEIGHT, "image_rotation": 0}
    points = [[100 * x / WIDTH, 100 * y / HEIGHT] for x, y in TABLE]
    results = [
        {"type": "polygonlabels", **size, "value": {"points": points, "polygonlabels": ["table"], "closed": True}},
        {"type": "brushlabels", **size, "value": {"format": "rle", "rle": brush(TRUE["cup"]), "brushlabels": ["cup"]}},
        {"type": "choices", "value": {"choices": ["sharp"]}},
    ]
    tasks = [
        {
            "id": k,
            "data": {"image": f"/data/upload/1/0a1b2c3d-{k:06d}.png"},
            "annotations": [{"was_cancelled": True, "result": [7]}, {"result": r}],
        }
        for k, r in ((2, results), (3, []))
    ]
    (root / "project-1-at-2026.json").write_text(json.dumps(tasks))


def label_studio_in_short(root: Path) -> None:
    label_studio(root)
    (file,) = root.iterdir()
    tasks = json.loads(file.read_text())
    rows = [
        {
            "image": task["data"]["image"],
            "id": task["id"],
            "label": [
                {**row["value"], **{key: row[key] for key in ("original_width", "original_height")}}
                for row in task["annotations"][1]["result"]
                if "original_width" in row
            ],
            "annotator": 1,
        }
        for task in tasks
    ]
    file.write_text(json.dumps(rows))


def yolo(root: Path, names: str = "names: [table, cup]\n") -> None:
    (root / "labels").mkdir()
    (root / "data.yaml").write_text(f"path: .\n{names}")
    (root / "README.dataset.txt").write_text("# a data set\nProvided by somebody\n")
    lines = [
        " ".join([str(k), *(f"{v}" for x, y in c for v in (x / WIDTH, y / HEIGHT))])
        for k, c in enumerate(THINGS.values())
    ]
    (root / "labels" / "000002.txt").write_text("\n".join([*lines, "0 0.5 0.5 0.25 0.25"]) + "\n")
    (root / "labels" / "000003.txt").write_text("")


def yolo_names_by_number(root: Path) -> None:
    yolo(root, "names:\n  0: table\n  1: cup\n")


def yolo_names_in_lines(root: Path) -> None:
    yolo(root)
    (root / "data.yaml").unlink()
    (root / "labels" / "classes.txt").write_text("table\ncup\n")


def palette_png(path: Path, values: np.ndarray) -> None:
    path.parent.mkdir(exist_ok=True)
    image = Image.fromarray(values.astype(np.uint8), mode="P")
    image.putpalette([channel for c in voc_colors(256) for channel in (c & 255, c >> 8 & 255, c >> 16)])
    image.save(path)


def palettes(root: Path) -> None:
    (root / "metadata.csv").write_text("file_name,split\n000002.png,train\n")
    (root / "classes.txt").write_text("1 table\n2 cup\n")
    rim = VALUES.copy()
    rim[0, 0] = 255
    palette_png(root / "000002.png", rim)
    palette_png(root / "000003.png", np.zeros(SHAPE))


def palettes_of_roboflow(root: Path) -> None:
    (root / "_classes.csv").write_text("Pixel Value, Class\n0, background\n1, table\n2, cup\n")
    for k, values in ((2, VALUES), (3, VALUES * 0)):
        cv2.imwrite(str(root / f"{k:06d}_jpg.rf.0a1b2c3d4e5f60718293a4b5c6d7e8f9_mask.png"), values.astype(np.uint8))


def colors(root: Path) -> None:
    (root / "labelmap.txt").write_text(
        "# label:color_rgb:parts:actions\nbackground:0,0,0::\ncup:0,128,0::\ntable:250,50,83::\n"
    )
    (root / "SegmentationClass").mkdir()
    for k, values in ((2, VALUES), (3, VALUES * 0)):
        image = np.array([[0, 0, 0], [250, 50, 83], [0, 128, 0]], np.uint8)[values]
        Image.fromarray(image).save(root / "SegmentationClass" / f"{k:06d}.png")


def colors_beside_a_label_map(root: Path) -> None:
    """Without folders, and black is no label: what the refusal of colours tells to do."""
    colors(root)
    (root / "labelmap.txt").write_text("table:250,50,83\ncup:0,128,0\n")
    for file in (root / "SegmentationClass").iterdir():
        file.rename(root / file.name)


def colors_in_a_palette(root: Path) -> None:
    colors(root)
    for file in (root / "SegmentationClass").iterdir():
        Image.open(file).convert("P", palette=Image.Palette.ADAPTIVE, colors=8).save(file)


def voc(root: Path) -> None:
    """Classes and instances as PASCAL VOC has them, table and cup by other names."""
    for k, values in ((2, VALUES), (3, VALUES * 0)):
        palette_png(root / "SegmentationClass" / f"{k:06d}.png", np.array([0, 11, 5])[values])
        palette_png(root / "SegmentationObject" / f"{k:06d}.png", values)


def class_folders(root: Path) -> None:
    for thing, true in TRUE.items():
        (root / thing).mkdir()
        for k, mask in ((2, true), (3, true * 0)):
            cv2.imwrite(str(root / thing / f"{k:06d}.png"), mask.astype(np.uint8) * 255)


LAYOUTS: dict[str, tuple[Callable[[Path], None], str]] = {
    "polygons": (coco_polygons, "COCO instances"),
    "polygons and RLE": (coco_mixed, "COCO instances"),
    "names of Roboflow": (coco_of_roboflow, "COCO instances"),
    "parts": (coco_in_parts, "COCO instances"),
    "LabelMe": (labelme, "LabelMe"),
    "VIA": (via, "VIA"),
    "Label Studio": (label_studio, "Label Studio"),
    "Label Studio, in short": (label_studio_in_short, "Label Studio"),
    "YOLO": (yolo, "YOLO outlines"),
    "YOLO, numbered names": (yolo_names_by_number, "YOLO outlines"),
    "YOLO, names in lines": (yolo_names_in_lines, "YOLO outlines"),
    "palettes": (palettes, "instance PNG"),
    "masks of Roboflow": (palettes_of_roboflow, "instance PNG"),
    "colours": (colors, "coloured PNG"),
    "colours without folders": (colors_beside_a_label_map, "coloured PNG"),
    "colours in a palette": (colors_in_a_palette, "coloured PNG"),
    "a folder a class": (class_folders, "mask PNGs"),
}


def amg(root: Path, name: str, masks: list[np.ndarray], scores: list[float]) -> None:
    """As Segment Anything's amg.py writes it when it isn't asked for RLE."""
    (root / name).mkdir(parents=True)
    columns = (
        "id,area,bbox_x0,bbox_y0,bbox_w,bbox_h,point_input_x,point_input_y,predicted_iou,stability_score,crop_box_x0"
    )
    with open(root / name / "metadata.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns.split(","))
        for k, (mask, score) in enumerate(zip(masks, scores, strict=True)):
            cv2.imwrite(str(root / name / f"{k}.png"), mask.astype(np.uint8) * 255)
            writer.writerow([k, mask.sum(), 0, 0, 9, 9, 1.5, 2.5, score, 0.99, 0])
