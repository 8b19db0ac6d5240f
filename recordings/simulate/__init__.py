"""Measurements of a site that nobody made: satellites, errors and receivers from a seed, for demonstrations, tests and campaigns."""
