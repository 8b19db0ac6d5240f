"""The station at the trackside."""
