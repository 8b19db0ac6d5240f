"""Faults put into a recording: `parse_faults` reads the `[[fault]]` tables, `inject` makes the events that a station would have met.

Injection works on decoded observations and ephemerides. It is a pure function: the same events, faults and seed, the same events.
"""

from recordings.faults.injection import inject
from recordings.faults.scenario import Fault, parse_faults, read_faults

__all__ = ["Fault", "inject", "parse_faults", "read_faults"]
