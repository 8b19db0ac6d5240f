"""Satellites and receivers: time, observations, orbits, atmosphere, positions. Knows nothing of triangles or trains."""
