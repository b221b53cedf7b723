"""Tasks that are true: goals of the true room, carried to a reconstruction, judged by the true room's end."""
