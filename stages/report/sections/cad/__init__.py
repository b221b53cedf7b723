"""Section `cad`: what stands for which object."""
