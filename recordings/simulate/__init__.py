"""What nobody measured: satellites, errors and receivers from a seed, as measurements, as bytes and over TCP."""
