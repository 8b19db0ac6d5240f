"""The fault-injection campaign: every threat of the catalogue in every size, and what the monitor made of it."""
