"""What is cut: closed bodies, planes, the knife and the board."""
