"""Broadcast orbits and clocks: what satellites send (`broadcast`), which set serves when (`store`), where satellites are (`states`)."""
