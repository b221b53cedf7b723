"""Section `words`: what words mean to a robot that was corrected, and what it planned with them."""
