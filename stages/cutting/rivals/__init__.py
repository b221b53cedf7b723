"""Behavioural cloning and offline Q-learning (Han 2024, section 6.4.2.1), and the scripted cutter."""
