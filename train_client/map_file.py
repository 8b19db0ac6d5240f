"""A track map from its file."""

from pathlib import Path

from recordings.toml_file import ConfigProblems, Problem


def read_map_text(path: Path) -> str:
    """The text of a map file. Raises ConfigProblems where it cannot be read or is not UTF-8."""
    try:
        return path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        message = f"cannot be read ({error.strerror}): give the path of a readable track map"
        raise ConfigProblems([Problem(str(path), None, "", "", message)]) from error
    except UnicodeDecodeError as error:
        message = f"byte 0x{error.object[error.start]:02x} at {error.start} is not UTF-8: a track map is JSON text in UTF-8"
        raise ConfigProblems([Problem(str(path), None, "", "", message)]) from error
