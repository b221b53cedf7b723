"""Who corrects: a simulated person with ground truth, or a person in the terminal."""
