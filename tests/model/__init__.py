"""The trust machine, checked over every sequence of attacks, delays and reboots up to a depth: `python -m tests.model --depth 12`."""
