"""Step `library build`: a CAD library of parametric furniture."""
