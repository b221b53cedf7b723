"""What a person puts right, applied again whenever the artifact is made anew."""
