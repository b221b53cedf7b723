"""Figures of merit of the masks, and of the needle's pose on spoiled true masks beside learned ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.stitch.needle_records import Estimate
from benchmarks.stitch.segmentation_records import MaskRecord
from stages.kit.measurement.proportions import wilson_interval

HOLDERS, LIGHTS = ("air", "left", "right", "both", "tissue"), ("dim", "ordinary", "bright")
CLOSE = 3.0
"""An end is close to the mask within so many pixels."""


def _share(part: list[int], whole: list[int]) -> float:
    return float(sum(part) / max(sum(whole), 1))


def _ends(records: list[MaskRecord], which: str) -> list[tuple[float, float]]:
    """Return (distance, 2 mm) [px] of every end that is seen."""
    return [(getattr(r, which), r.two_mm) for r in records if getattr(r, which) >= 0]


def _recall(ends: list[tuple[float, float]], close: bool) -> float:
    return float(np.mean([distance <= (CLOSE if close else near) for distance, near in ends])) if ends else -1.0


MEASURES: dict[str, Callable[[list[MaskRecord]], float]] = {
    "pictures": lambda records: float(len(records)),
    "needle_iou": lambda records: _share([r.needle_both for r in records], [r.needle_either for r in records]),
    "needle_iou_median": lambda records: float(np.median([r.needle_both / max(r.needle_either, 1) for r in records])),
    "thread_iou": lambda records: _share([r.thread_both for r in records], [r.thread_either for r in records]),
    "thread_iou_median": lambda records: float(np.median([r.thread_both / max(r.thread_either, 1) for r in records])),
    "thread_recall_1px": lambda records: _share(
        [r.thread_true_near for r in records], [r.thread_true for r in records]
    ),
    "thread_precision_1px": lambda records: _share(
        [r.thread_found_near for r in records], [r.thread_found for r in records]
    ),
    "tips_seen": lambda records: float(len(_ends(records, "tip"))),
    "tip_recall_2mm": lambda records: _recall(_ends(records, "tip"), False),
    "tip_recall_3px": lambda records: _recall(_ends(records, "tip"), True),
    "swages_seen": lambda records: float(len(_ends(records, "swage"))),
    "swage_recall_2mm": lambda records: _recall(_ends(records, "swage"), False),
    "swage_recall_3px": lambda records: _recall(_ends(records, "swage"), True),
    "cpu_seconds": lambda records: float(np.median([r.seconds for r in records])),
}


def groups(records: list[MaskRecord]) -> dict[str, list[MaskRecord]]:
    """Return all pictures, and those of every holder and light."""
    named = {"all": records}
    named |= {f"holder_{holder}": [r for r in records if r.holder == holder] for holder in HOLDERS}
    named |= {f"light_{light}": [r for r in records if r.light == light] for light in LIGHTS}
    return {name: found for name, found in named.items() if found}


def _views(estimates: list[Estimate]) -> dict[str, list[Estimate]]:
    return {"needle_visible": [e for e in estimates if e.visible], "needle_all": estimates}


def metrics(records: list[MaskRecord], estimates: list[Estimate]) -> dict[str, float]:
    """Return `network/<group>/<measure>` and `<arm>_<masks>/<case>/<measure>` -> number."""
    result = {
        f"network/{name}/{measure}": round(function(found), 4)
        for name, found in groups(records).items()
        for measure, function in MEASURES.items()
    }
    for case, found in _views(estimates).items():
        for masks in ("spoiled", "learned"):
            for arm in ("thesis", "ours"):
                of_arm = [e for e in found if e.arm == arm and e.case == masks]
                if of_arm:
                    name = f"{arm}_{masks}/{case}"
                    answered = [e for e in of_arm if e.answered]
                    result[f"{name}/views"] = float(len(of_arm))
                    result[f"{name}/within_tolerance"] = round(float(np.mean([e.within for e in of_arm])), 4)
                    result[f"{name}/abstained"] = round(1.0 - len(answered) / len(of_arm), 4)
                    result[f"{name}/swap_rate"] = round(float(np.mean([e.swapped for e in answered] or [-1])), 4)
                    for measure in ("normal_error_deg", "centre_error_mm", "tip_error_mm"):
                        values = [getattr(e, measure) for e in answered]
                        result[f"{name}/{measure}"] = round(float(np.median(values)) if values else -1.0, 3)
    return result


def table(records: list[MaskRecord], estimates: list[Estimate]) -> str:
    """Return the tables as Markdown."""
    numbers = metrics(records, estimates)
    lines = [
        "| pictures of | n | needle IoU (median a picture) | thread IoU (median) | thread found / right, 1 px | "
        "tip within 2 mm (3 px) | swage within 2 mm (3 px) |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in groups(records):
        of = {measure: numbers[f"network/{name}/{measure}"] for measure in MEASURES}
        lines.append(
            f"| {name.replace('_', ': ')} | {of['pictures']:.0f} "
            f"| {100 * of['needle_iou']:.1f} ({100 * of['needle_iou_median']:.1f}) "
            f"| {100 * of['thread_iou']:.1f} ({100 * of['thread_iou_median']:.1f}) "
            f"| {100 * of['thread_recall_1px']:.1f} / {100 * of['thread_precision_1px']:.1f} "
            f"| {_percent(of['tip_recall_2mm'])} ({_percent(of['tip_recall_3px'])}) of {of['tips_seen']:.0f} "
            f"| {_percent(of['swage_recall_2mm'])} ({_percent(of['swage_recall_3px'])}) of {of['swages_seen']:.0f} |"
        )
    lines += [
        "",
        "| views | masks | estimator | n | within 1 mm and 10° (95 %) | abstained | normal ° | centre mm | tip mm | "
        "tip and swage swapped |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for case, found in _views(estimates).items():
        for masks in ("spoiled", "learned"):
            for arm in ("thesis", "ours"):
                of_arm = [e for e in found if e.arm == arm and e.case == masks]
                if not of_arm:
                    continue
                name = f"{arm}_{masks}/{case}"
                low, high = wilson_interval(sum(e.within for e in of_arm), len(of_arm))
                lines.append(
                    f"| {case} | {masks} | {arm} | {len(of_arm)} | {100 * numbers[f'{name}/within_tolerance']:.1f} "
                    f"({100 * low:.0f}–{100 * high:.0f}) | {100 * numbers[f'{name}/abstained']:.1f} "
                    f"| {numbers[f'{name}/normal_error_deg']:.1f} | {numbers[f'{name}/centre_error_mm']:.2f} "
                    f"| {numbers[f'{name}/tip_error_mm']:.2f} | {100 * numbers[f'{name}/swap_rate']:.1f} |"
                )
    lines.append("")
    lines.append(f"Network: {numbers['network/all/cpu_seconds']:.2f} CPU s a 1280 x 960 picture on one thread.")
    return "\n".join(lines) + "\n"


def _percent(share: float) -> str:
    return "–" if share < 0 else f"{100 * share:.1f}"
