"""Words asked of recorded rooms."""
