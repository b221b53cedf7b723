"""Maps of real rooms against a surface that somebody painted, beside what annotated boxes say of them."""
