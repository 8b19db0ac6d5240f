"""Observation and navigation files that others recorded, RINEX 2 and 3, plain or gzipped."""
