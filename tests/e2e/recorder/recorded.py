"""What a recorder of these tests is given, and what is found in its files."""

from pathlib import Path

from integrity.events import RawBytes
from integrity.gnss.gps_time import NS_PER_S, parse_utc
from integrity.messages.snapshots import encode_snapshot
from recordings.reader import Contents
from recordings.site_file import parse_site
from tests.unit.sites import ALL_UBX, edited
from tests.unit.streams import new_monitor

SITE = parse_site(edited(ALL_UBX, ("recover_after_s = 30.0", "recover_after_s = 5.0")), "site.toml")
GPS_NS = parse_utc("2026-03-02T03:59:49.9Z")
FIRST, SECOND = "kokubunji-1-20260302T035949Z", "kokubunji-1-20260302T040000Z"
BOOT_ID = bytes(range(16))
MONO_NS = 55 * NS_PER_S
MOST_LOST_S = 1.5
SNAPSHOT = encode_snapshot(new_monitor(SITE.config).snapshot(), SITE.config.receiver_names, 0)


def piece(number: int, mono_ns: int = MONO_NS, size: int = 8) -> RawBytes:
    return RawBytes(mono_ns, "A", number.to_bytes(8, "big") + bytes(size - 8))


def numbers(contents: Contents) -> list[int]:
    return [int.from_bytes(e.message[:8], "big") for e in contents.entries if isinstance(e.message, bytes)]


def files(directory: Path) -> list[str]:
    return sorted(path.name for path in directory.iterdir())
