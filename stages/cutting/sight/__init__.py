"""What two depth cameras see of the board, and a policy that knows no more."""
