"""How right what was learned is: predicates on states near their boundaries."""
