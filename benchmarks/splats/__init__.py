"""Rivals of the splats: other ways to pictures and to words, made small."""
