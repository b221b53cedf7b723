"""Suturing: a needle seen by two eyes, its pose and how sure it is, the thread, and trials of whole sutures."""
