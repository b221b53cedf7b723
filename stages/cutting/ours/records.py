"""Our grammar as a record."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.cutting_model import CuttingGrammar, CuttingRule, FragmentType
from scenewright.stages.cutting.ours.grammar import Grammar, Rule


def grammar_record(grammar: Grammar) -> CuttingGrammar:
    """Return the record of a grammar."""
    return CuttingGrammar(
        types=tuple(
            FragmentType(
                mean=as_vector(grammar.means[k]),
                deviation=as_vector(grammar.deviations[k]),
                share=float(grammar.shares[k]),
                named=tuple(int(n) for n in grammar.named[k]),  # type: ignore[arg-type]
            )
            for k in range(grammar.types)
        ),
        rules=tuple(CuttingRule(parent=r.parent, axis=r.axis, children=r.children, seen=r.seen) for r in grammar.rules),
        ratios=grammar.ratios.tolist(),
        scatter=tuple(grammar.scatter.tolist()),  # type: ignore[arg-type]
        bits=grammar.bits,
    )


def grammar_of(record: CuttingGrammar) -> Grammar:
    """Return the grammar of a record."""
    return Grammar(
        means=np.array([kind.mean for kind in record.types]),
        deviations=np.array([kind.deviation for kind in record.types]),
        shares=np.array([kind.share for kind in record.types]),
        rules=tuple(Rule(r.parent, r.axis, r.children, r.seen) for r in record.rules),
        named=np.array([kind.named for kind in record.types], float),
        ratios=np.array(record.ratios),
        scatter=np.array(record.scatter),
        bits=record.bits,
    )
