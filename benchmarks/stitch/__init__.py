"""The suturing experiments (STITCH, Srinivas 2024)."""
