"""The step `pack`: boxes into a basket, by proposals and what motion planning says to them (LLM3)."""
