"""The core that decides: pure functions and small state machines. No I/O, no clock, no thread, no random source."""
