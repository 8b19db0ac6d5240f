"""Observation and navigation files that others recorded: RINEX 2, 3 and 4, plain, gzipped, or compressed after Hatanaka."""
