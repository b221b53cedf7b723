"""`tableware`: clear a table of cups, bowls, plates and utensils (Srinivas 2024, chapters 5 to 7)."""
