"""Every real log through every backend that runs here."""
