"""The core that decides: pure functions and small state machines. No I/O, no clock, no thread, no random source."""

SOFTWARE = "wayside 0.1.0"  # recorded with every decision
