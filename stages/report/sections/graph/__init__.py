"""Section `graph`: who carries whom."""
