"""Tables 7.1 and 7.2 (Srinivas 2024) in the fast simulator, beside a joint planner and the exact optimum."""
