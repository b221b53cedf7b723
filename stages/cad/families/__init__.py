"""Parametric families of furniture: each is read part by part off the surface that was seen of a thing."""
