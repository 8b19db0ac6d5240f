"""Faults put into a recording: `parse_faults` reads the `[[fault]]` tables, `inject` makes the events that a station would have met.

Injection works on what was decoded, and on the bytes of receivers where a recording has them. It is a pure function: the same events,
faults and seed, the same events. `at_link` tells faults between receiver and station, which need what a receiver sent, from all others.
"""

from recordings.faults.injection import inject
from recordings.faults.scenario import Fault, at_link, parse_faults, read_faults

__all__ = ["Fault", "at_link", "inject", "parse_faults", "read_faults"]
