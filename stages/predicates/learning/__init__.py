"""Learners of predicates and operators."""
