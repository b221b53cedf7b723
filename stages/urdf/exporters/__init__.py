"""What is written beside scene.urdf: each file is an exporter, found because it lies here."""
