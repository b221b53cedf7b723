"""What one part of the evaluation yields."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from scenewright.stages.kit.measurement.bootstrap import bootstrap_interval
from scenewright.stages.kit.measurement.tables import Table


@dataclass
class Part:
    """Figures of one part (`map`, `graph`, ...), its tables, and what a reader must know about them."""

    name: str
    metrics: dict[str, float | None] = field(default_factory=dict)
    tables: list[Table] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def set(self, measure: str, value: float | int | None) -> None:
        """Record `<part>/<measure>`; None and non-finite values become undefined."""
        if value is not None and not math.isfinite(value):
            value = None
        self.metrics[f"{self.name}/{measure}"] = None if value is None else float(value)

    def set_mean(self, measure: str, values: list[float], random: np.random.Generator, resamples: int) -> None:
        """Record `<measure>_mean`, `_median` and the 95 % bootstrap interval of the mean (undefined without values)."""
        interval = bootstrap_interval(np.array(values), random, resamples=resamples)
        self.set(f"{measure}_mean", interval.value if interval else None)
        self.set(f"{measure}_median", float(np.median(values)) if values else None)
        # A single value has no spread to resample; an interval of width zero would claim certainty.
        has_interval = interval is not None and len(values) > 1
        self.set(f"{measure}_mean_low", interval.low if has_interval and interval else None)
        self.set(f"{measure}_mean_high", interval.high if has_interval and interval else None)
