"""`wayside solve`: positions, velocities, tests and residuals of one receiver over its files."""
