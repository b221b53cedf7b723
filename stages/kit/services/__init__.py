"""What every client of a service over HTTP shares: addresses, one patient connection, secrets that stay secret."""
