"""What the thesis printed of its trials (Srinivas 2024, table 4.1), and who is compared with whom."""

from __future__ import annotations

from stages.suture.evaluation.trial_figures import PAIRS as PAIRS_OF_ARMS

PAIRS = (PAIRS_OF_ARMS[0], ("ours_one_at_a_time", "thesis"), *PAIRS_OF_ARMS[1:])
THESIS: dict[str, tuple[float, float, float, float, float, tuple[int, int, int, int], float | None]] = {
    "sensing_only": (1.40, 51.6, 0.0, 0.0, 106.8, (9, 6, 0, 0), None),
    "thread_handling": (1.80, 55.9, 20.0, 0.0, 117.9, (6, 5, 2, 2), None),
    "thesis": (2.93, 69.4, 73.3, 0.0, 159.3, (8, 5, 0, 2), None),
    "thesis_supervised": (4.47, 83.3, 100.0, 20.0, 141.9, (16, 10, 0, 2), 2.25),
}
"""Mean sutures to failure, single-suture rate, three throws, full wound [%], seconds a suture, errors of 15 trials,
sutures to intervention, as printed."""


def printed_rows() -> dict[str, str]:
    """Return arm -> the printed row in the columns of `trial_figures.table`."""
    return {
        arm: f"| *printed* | 15 | {mean:.2f} | {single} % | {three} % | {full} % | {seconds} "
        f"| {' '.join(map(str, counts))} | {'–' if between is None else between} | – |"
        for arm, (mean, single, three, full, seconds, counts, between) in THESIS.items()
    }
