"""Carrier phase: where it is continuous (`slips`), and ranges smoothed with it (`smoothing`)."""
