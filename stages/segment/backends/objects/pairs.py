"""What two groups of patches look like together: the features that decide whether they are one object."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.segment.backends.objects.hulls import convex_hull, hull_content, inside_hull
from scenewright.stages.segment.backends.objects.regions import HEIGHT_BIN

FEATURES = (
    "smaller_pixels",
    "larger_pixels",
    "border_share",
    "touching",
    "connected",
    "nearer",
    "jump",
    "convexity",
    "concave",
    "convex",
    "cosine",
    "border_color",
    "border_color_steps",
    "histogram",
    "chroma",
    "lightness",
    "behind",
    "behind_gain",
    "missing",
    "hidden",
    "own",
    "normal_angle",
    "joint_residual",
    "residual_gain",
    "gap",
    "bottom_difference",
    "lowest",
    "higher_bottom",
    "height_overlap",
    "rise",
    "up_most",
    "up_least",
    "enclosed",
    "extent",
    "depth",
    "top_difference",
    "cut",
    "fine_steps",
)
"""Names of the features, in order."""
COUNT = len(FEATURES)
"""Number of features of a pair."""
CONTENT_STEP = 3
"""Every so many pixels across and down, the content of a hull is looked at [px]; by eye."""
HIDING_MARGIN = 0.02
"""Nearer by this hides [1/m]: 2 cm at 1 m."""


@compiled
def inverse_plane(s: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the plane (3,) of the inverse depth over (1, column, row) from sums (POINT_SUMS,), and its residual
    (root mean square) [1/m]."""
    n = s[0]
    mu, mv, mw = s[13] / n, s[14] / n, s[18] / n
    # A little weight pulls the slopes to zero where few pixels, or pixels in a line, leave them open.
    uu, uv, vv = s[15] / n - mu * mu + 1.0, s[16] / n - mu * mv, s[17] / n - mv * mv + 1.0
    uw, vw, ww = s[19] / n - mu * mw, s[20] / n - mv * mw, s[21] / n - mw * mw
    determinant = uu * vv - uv * uv
    b = (uw * vv - vw * uv) / determinant
    c = (vw * uu - uw * uv) / determinant
    residual = max(0.0, ww - 2 * (b * uw + c * vw) + b * b * uu + 2 * b * c * uv + c * c * vv)
    plane = np.empty(3)
    plane[0], plane[1], plane[2] = mw - b * mu - c * mv, b, c
    return plane, np.sqrt(residual)


@compiled
def _quantile(histogram: np.ndarray, share: float) -> float:
    total = histogram.sum() * share
    passed = 0.0
    for k in range(len(histogram)):
        if passed + histogram[k] >= total:
            return HEIGHT_BIN * (k + (total - passed) / max(histogram[k], 1.0))
        passed += histogram[k]
    return HEIGHT_BIN * len(histogram)


@compiled
def pair_features(
    a: int,
    b: int,
    sums: np.ndarray,
    colors: np.ndarray,
    heights: np.ndarray,
    perimeters: np.ndarray,
    border: np.ndarray,
    hull_a: np.ndarray,
    hull_b: np.ndarray,
    own_behind: np.ndarray,
    groups: np.ndarray,
    inverse: np.ndarray,
) -> np.ndarray:
    """Return the features (COUNT,) float32 of groups a and b; symmetric in a and b.

    `border` (BORDER_SUMS,) as seen from a; `hull_a`, `hull_b` corners (K, 2); `own_behind` (N,) share of a group's own
    hull that shows what lies behind it; `groups` (H, W) group of every pixel; `inverse` (H, W) [1/m].
    """
    f = np.zeros(COUNT, dtype=np.float32)
    sa, sb = sums[a], sums[b]
    na, nb = sa[0], sb[0]
    joint = sa + sb
    f[0], f[1] = np.log(min(na, nb)), np.log(max(na, nb))
    length = border[0]
    f[2] = length / max(1.0, min(perimeters[a], perimeters[b]))
    f[3] = 1.0 if length > 0 else 0.0
    if length > 0:
        f[4] = border[1] / length
        f[5] = abs(border[2]) / length
        f[6] = border[13] / max(1.0, length - border[1])
    sampled = border[3]
    if sampled > 0:
        f[7] = border[4] / sampled
        f[8] = border[5] / sampled
        f[9] = border[6] / sampled
        f[10] = border[7] / sampled
        f[29] = abs(border[10]) / sampled
        f[30] = max(border[11], border[12]) / sampled
        f[31] = min(border[11], border[12]) / sampled
    else:
        f[10] = 0.5
    if border[14] > 0:
        f[11] = border[8] / border[14]
        f[12] = border[9] / border[14]
        f[37] = border[16] / border[14]
        f[36] = border[15] / length
    shared = 0.0
    for k in range(colors.shape[1]):
        shared += min(colors[a, k] / na, colors[b, k] / nb)
    f[13] = shared
    f[14] = np.sqrt((sa[23] / na - sb[23] / nb) ** 2 + (sa[24] / na - sb[24] / nb) ** 2)
    f[15] = abs(sa[22] / na - sb[22] / nb)

    corners = np.empty((len(hull_a) + len(hull_b), 2))
    corners[: len(hull_a)] = hull_a
    corners[len(hull_a) :] = hull_b
    hull = convex_hull(corners)
    plane, residual = inverse_plane(joint)
    covered, hidden, missing, behind = hull_content(
        hull, groups, inverse, a, b, plane, HIDING_MARGIN + 2 * residual, CONTENT_STEP
    )
    total = max(1.0, covered + hidden + missing + behind)
    f[16] = behind / total
    f[17] = behind / total - (own_behind[a] * na + own_behind[b] * nb) / (na + nb)
    f[18], f[19], f[20] = missing / total, hidden / total, covered / total

    la = np.sqrt(sa[10] ** 2 + sa[11] ** 2 + sa[12] ** 2)
    lb = np.sqrt(sb[10] ** 2 + sb[11] ** 2 + sb[12] ** 2)
    if la > 0 and lb > 0:
        f[21] = (sa[10] * sb[10] + sa[11] * sb[11] + sa[12] * sb[12]) / (la * lb)
    _, residual_a = inverse_plane(sa)
    _, residual_b = inverse_plane(sb)
    f[22] = residual * 100
    f[23] = (residual - np.sqrt((na * residual_a**2 + nb * residual_b**2) / (na + nb))) * 100
    gap = 1e9
    if length > 0:
        gap = 0.0
    else:
        for i in range(len(hull_a)):
            for j in range(len(hull_b)):
                gap = min(gap, np.hypot(hull_a[i, 0] - hull_b[j, 0], hull_a[i, 1] - hull_b[j, 1]))
    f[24] = min(4.0, gap / np.sqrt(min(na, nb)))
    low_a, high_a = _quantile(heights[a], 0.04), _quantile(heights[a], 0.96)
    low_b, high_b = _quantile(heights[b], 0.04), _quantile(heights[b], 0.96)
    f[25] = abs(low_a - low_b)
    f[26] = min(low_a, low_b)
    f[27] = max(low_a, low_b)
    f[28] = (min(high_a, high_b) - max(low_a, low_b)) / max(0.01, min(high_a - low_a, high_b - low_b))
    f[28] = max(-2.0, min(2.0, f[28]))
    f[35] = abs(high_a - high_b)
    inside_a = inside_b = 0
    for i in range(len(hull_a)):
        inside_b += inside_hull(hull_b, hull_a[i, 0], hull_a[i, 1])
    for j in range(len(hull_b)):
        inside_a += inside_hull(hull_a, hull_b[j, 0], hull_b[j, 1])
    f[32] = max(inside_b / max(1, len(hull_a)), inside_a / max(1, len(hull_b)))
    n = joint[0]
    spread = 0.0
    for axis in range(3):
        square = joint[4] if axis == 0 else joint[7] if axis == 1 else joint[9]
        spread += max(0.0, square / n - (joint[1 + axis] / n) ** 2)
    f[33] = np.sqrt(spread)
    f[34] = joint[3] / n
    return f
