"""Navigation files for tests: headers of every version, and the reading of a text."""

from pathlib import Path

from recordings.rinex.navigation import NavigationFile, read_navigation
from tests.rinex_examples import Rows, lines


def header(content: str, label: str) -> str:
    return f"{content:<60}{label}\n"


END = header("", "END OF HEADER")
HEADER_2 = (
    header("     2.10           N: GPS NAV DATA", "RINEX VERSION / TYPE")
    + header("     .1676D-07   .2235D-07  -.1192D-06  -.1192D-06", "ION ALPHA")
    + header("     .1208D+06   .1310D+06  -.1310D+06  -.1966D+06", "ION BETA")
    + header("    13", "LEAP SECONDS")
    + END
)
HEADER_2_GLONASS = header("     2.10           GLONASS NAV DATA", "RINEX VERSION / TYPE") + END
HEADER_2_GEO = header("     2.10           H: GEO NAV MSG DATA", "RINEX VERSION / TYPE") + END
HEADER_3 = (
    header("     3.04           N: GNSS NAV DATA    M: MIXED", "RINEX VERSION / TYPE")
    + header("GPSA    .1676D-07   .2235D-07  -.1192D-06  -.1192D-06", "IONOSPHERIC CORR")
    + header("GPSB    .1208D+06   .1310D+06  -.1310D+06  -.1966D+06", "IONOSPHERIC CORR")
    + header("GAL     .1248D+03   .5039D+00   .2377D-01", "IONOSPHERIC CORR")
    + header("    18    19  2185     7", "LEAP SECONDS")
    + END
)
HEADER_3_05 = HEADER_3.replace("3.04", "3.05")
HEADER_4 = header("     4.02           NAVIGATION DATA     M", "RINEX VERSION / TYPE") + header("    18", "LEAP SECONDS") + END


def read(directory: Path, text: str | bytes) -> NavigationFile:
    path = directory / "site.nav"
    path.write_bytes(text if isinstance(text, bytes) else text.encode("latin-1"))
    return read_navigation(path)


def record(head: str, rows: Rows) -> str:
    return "\n".join(lines(head, rows)) + "\n"


def record_2(number: str, head: str, rows: Rows) -> str:
    """As RINEX 2 writes it: the number of the satellite, two digits of the year, tenths of a second."""
    return record(f"{number} {head[6:]}.0", rows)


def record_4(head: str, rows: Rows, message: str) -> str:
    return f"> EPH {head[:3]} {message}\n" + record(head, rows)
