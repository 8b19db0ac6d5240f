"""Bytes and files: recordings, other people's formats, site files, replay, faults, simulation, pictures."""
