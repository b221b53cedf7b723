"""Runs in the checkout of the generator's commit. A change here makes another board."""
