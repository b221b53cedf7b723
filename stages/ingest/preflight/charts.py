"""Small drawings as inline SVG: they scale, follow the page's colours, and are the same bytes every time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup, escape

WIDTH, WIDE = 560, 1040
"""Width of a drawing, and of one across the page [px]."""
LEFT, RIGHT, BOTTOM, TOP = 46, 10, 24, 8
"""Margins of a drawing around its axes [px]."""


def _number(value: float) -> str:
    return f"{value + 0.0:.4g}"  # + 0.0: no minus zero


class _Plot:
    """A box with axes; x and y in data units."""

    def __init__(
        self, height: int, x_range: tuple[float, float], y_range: tuple[float, float], width: int = WIDTH
    ) -> None:
        self.height = height
        self.width = width
        self.x0, self.x1 = x_range
        self.y0, self.y1 = y_range
        self.parts: list[str] = []

    def x(self, value: float) -> float:
        share = (value - self.x0) / (self.x1 - self.x0 or 1.0)
        return LEFT + share * (self.width - LEFT - RIGHT)

    def y(self, value: float) -> float:
        share = (value - self.y0) / (self.y1 - self.y0 or 1.0)
        return self.height - BOTTOM - share * (self.height - BOTTOM - TOP)

    def text(self, x: float, y: float, words: str, anchor: str = "middle", kind: str = "tick") -> None:
        self.parts.append(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" class="{kind}">{escape(words)}</text>')

    def line(self, x0: float, y0: float, x1: float, y1: float, kind: str) -> None:
        self.parts.append(f'<line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}" class="{kind}"/>')

    def rectangle(self, x: float, y: float, width: float, height: float, kind: str, title: str = "") -> None:
        inside = f"<title>{escape(title)}</title>" if title else ""
        self.parts.append(
            f'<rect x="{x:.1f}" y="{y:.1f}" width="{max(width, 0.3):.1f}" height="{max(height, 0):.1f}" '
            f'class="{kind}">{inside}</rect>'
        )

    def path(self, points: Sequence[tuple[float, float]], kind: str) -> None:
        words = " ".join(f"{'M' if k == 0 else 'L'}{x:.1f} {y:.1f}" for k, (x, y) in enumerate(points))
        self.parts.append(f'<path d="{words}" class="{kind}"/>')

    def axes(self, x_ticks: Sequence[float], y_ticks: Sequence[float], x_label: str) -> None:
        base = self.height - BOTTOM
        self.line(LEFT, base, self.width - RIGHT, base, "axis")
        for tick in x_ticks:
            self.text(self.x(tick), base + 13, _number(tick))
        for tick in y_ticks:
            self.line(LEFT, self.y(tick), self.width - RIGHT, self.y(tick), "grid")
            self.text(LEFT - 5, self.y(tick) + 3.5, _number(tick), "end")
        self.text(self.width - RIGHT, base + 23, x_label, "end", "label")

    def svg(self, words: str) -> Markup:
        body = "".join(self.parts)
        return Markup(
            f'<svg viewBox="0 0 {self.width} {self.height}" role="img" aria-label="{escape(words)}">{body}</svg>'
        )


def ticks(low: float, high: float, count: int = 5) -> list[float]:
    """Return round numbers in [low, high], about `count` of them."""
    if not high > low:
        return [low]
    raw = (high - low) / count
    power = 10 ** np.floor(np.log10(raw))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= raw)
    first = np.ceil(low / step - 1e-9)
    return [float(k * step) for k in np.arange(first, np.floor(high / step + 1e-9) + 1)]


def histogram(shares: Sequence[float], end: float, marks: Sequence[tuple[float, str]]) -> Markup:
    """Return bars of shares over [0, end] metres, with vertical marks (place, word)."""
    top = 1.15 * max([*shares, 1e-6])
    plot = _Plot(170, (0.0, end), (0.0, top))
    plot.axes(ticks(0, end), [], "depth [m]")
    width = end / max(len(shares), 1)
    for k, share in enumerate(shares):
        left, right = plot.x(k * width), plot.x((k + 1) * width)
        title = f"{k * width:.2f} to {(k + 1) * width:.2f} m: {100 * share:.1f} %"
        plot.rectangle(left + 0.5, plot.y(share), right - left - 1, plot.y(0) - plot.y(share), "bar", title)
    for value, words in marks:
        if 0 <= value <= end:
            plot.line(plot.x(value), TOP, plot.x(value), plot.y(0), "mark")
            plot.text(plot.x(value) + 4, TOP + 9, words, "start", "label")
    return plot.svg("histogram of depth")


def timeline(streams: Sequence[tuple[str, np.ndarray]]) -> Markup | None:
    """Return a row of marks for each stream (name, stamps [ns]); empty places are gaps. None without stamps."""
    rows = [(name, np.unique(stamps)) for name, stamps in streams if len(stamps)]
    if not rows:
        return None
    start = min(int(stamps[0]) for _, stamps in rows)
    end = max(int(stamps[-1]) for _, stamps in rows)
    plot = _Plot(BOTTOM + TOP + 26 * len(rows), (0.0, max((end - start) * 1e-9, 1e-3)), (0.0, 1.0), WIDE)
    plot.axes(ticks(0, plot.x1), [], "seconds from the first stamp")
    for row, (name, stamps) in enumerate(rows):
        seconds = (stamps - start) * 1e-9
        cells = int(np.clip(len(stamps) // 2, 1, 280))
        counts, _ = np.histogram(seconds, bins=cells, range=(0, plot.x1))
        top = TOP + 26 * row
        plot.text(LEFT, top + 8, name, "start", "label")
        most = counts.max()
        for cell in np.flatnonzero(counts):
            left = plot.x(cell * plot.x1 / cells)
            shade = "busy" if counts[cell] > 0.5 * most else "thin"
            plot.rectangle(left, top + 11, (WIDE - LEFT - RIGHT) / cells + 0.2, 9, shade)
    return plot.svg("time line of the streams")


def curve(
    values: Sequence[tuple[float, float]],
    x_label: str,
    words: str,
    *,
    level: float | None = None,
    marked: Sequence[float] = (),
) -> Markup | None:
    """Return points (x, y) joined by a line, from y = 0; `level` is a dashed line, `marked` x are dots."""
    if len(values) < 2:
        return None
    points = np.array(values, dtype=float)
    top = float(max(points[:, 1].max(), level or 0.0)) * 1.05 or 1.0
    plot = _Plot(150, (float(points[:, 0].min()), float(points[:, 0].max())), (0.0, top))
    plot.axes(ticks(plot.x0, plot.x1), ticks(0, top, 3), x_label)
    if level is not None:
        plot.line(LEFT, plot.y(level), WIDTH - RIGHT, plot.y(level), "mark")
    plot.path([(plot.x(x), plot.y(y)) for x, y in points], "curve")
    for x, y in points:
        kind = "dot bad" if any(abs(x - m) < 1e-9 for m in marked) else "dot"
        plot.parts.append(f'<circle cx="{plot.x(x):.1f}" cy="{plot.y(y):.1f}" r="2.6" class="{kind}"/>')
    return plot.svg(words)


def path_from_above(positions: np.ndarray, axes: tuple[int, int]) -> Markup:
    """Return the camera path (N, 3) [m] along two of its axes, start marked, at one scale."""
    points = positions[:, list(axes)].astype(float)
    low, high = points.min(axis=0), points.max(axis=0)
    wide, tall = (float(max(side, 1e-3)) * 1.1 for side in high - low)
    center = (low + high) / 2
    height = 260
    scale = min((WIDTH - 120) / wide, (height - 60) / tall)
    size = (WIDTH - 120) / scale
    drawn_points = (points - center) * scale
    drawn = [(WIDTH / 2 + x, height / 2 - 12 - y) for x, y in drawn_points[:: max(1, len(drawn_points) // 800)]]
    plot = _Plot(height, (0, 1), (0, 1))
    plot.path(drawn, "curve")
    plot.parts.append(f'<circle cx="{drawn[0][0]:.1f}" cy="{drawn[0][1]:.1f}" r="4" class="dot"/>')
    plot.text(drawn[0][0] + 7, drawn[0][1] + 4, "start", "start", "label")
    unit = ticks(0, size, 3)[1] if len(ticks(0, size, 3)) > 1 else size
    plot.line(LEFT, height - 14, LEFT + unit * scale, height - 14, "axis")
    plot.text(LEFT, height - 19, f"{unit:g} m, axes {'xyz'[axes[0]]} and {'xyz'[axes[1]]} of the log", "start", "label")
    return plot.svg("path of the camera")
