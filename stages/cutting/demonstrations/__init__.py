"""People who cut, scripted: goals, their recipes, trials."""
