"""The suturing network: views, training; the fit of its error model; drawing."""
