"""Errors that callers may catch. Each message says what, where, the value, what would be right, and what to do."""


class WaysideError(Exception):
    """Base of every error that Wayside raises on purpose."""


class DecodeError(WaysideError):
    """Input bytes or text that are not what their format promises."""


class ConfigError(WaysideError):
    """A site, scenario or fault file that cannot be used as it stands."""


class RecordingError(WaysideError):
    """A recording that is cut, damaged, or of an unknown schema."""


class LinkError(WaysideError):
    """A link or a device does not do what it should."""
