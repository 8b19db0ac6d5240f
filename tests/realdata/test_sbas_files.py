"""Recorded messages of MSAS: every one decodes, and the forms of a recording say the same."""

from collections import Counter
from pathlib import Path

import pytest

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.sbas.messages import PREAMBLES, SbasMessage
from integrity.gnss.sbas.reading import contents
from recordings.sbas_files import read_sbas

NOT_IN_DO_229 = {"type 8"}  # MSAS of 2008 sends some


@pytest.mark.parametrize(
    ("name", "form", "count", "problems"),
    [
        ("sbas_2025/msas137.sbs.gz", "SBS", 3600, {}),
        ("sbas_2025/msas137_046r.ems.gz", "EMS", 3600, {}),
        ("tokyo_sbas_2008/ubx_20080526.ubx", "UBX", 482, {"bytes of a frame that does not end": 18}),
        ("drive_imu/walk_gnss_1730.ubx.gz", "UBX", 307, {}),
    ],
)
def test_every_message_is_read(shared_data: Path, name: str, form: str, count: int, problems: dict[str, int]) -> None:
    file = read_sbas(shared_data / name)
    assert (file.form, len(file.messages), file.problems) == (form, count, problems)


@pytest.mark.parametrize("name", ["sbas_2025/msas137.sbs.gz", "tokyo_sbas_2008/ubx_20080526.ubx", "drive_imu/walk_gnss_1730.ubx.gz"])
def test_every_message_decodes(shared_data: Path, name: str) -> None:
    refused = Counter(said for said in map(contents, read_sbas(shared_data / name).messages) if isinstance(said, str))
    assert set(refused) <= NOT_IN_DO_229


def test_text_and_ems_of_an_hour_are_the_same(shared_data: Path) -> None:
    folder = shared_data / "sbas_2025"
    assert read_sbas(folder / "msas137.sbs.gz").messages == read_sbas(folder / "msas137_046r.ems.gz").messages


def in_step(message: SbasMessage) -> bool:
    """The three preambles follow each other, the first in every third second of GPS time: DO-229D, A.4.3.3."""
    return (message.sent_ns // NS_PER_S - PREAMBLES.index(message.bits >> 218)) % 3 == 0


@pytest.mark.parametrize("prn", [129, 137])
def test_the_log_of_a_receiver_and_what_rtklib_made_of_it_are_the_same(shared_data: Path, prn: int) -> None:
    """In time too; but for the first message of each satellite, to which RTKLIB gives a time that is out of step."""
    folder = shared_data / "tokyo_sbas_2008"
    ubx, ems = (
        {m.sent_ns: m.bits for m in read_sbas(path).messages if m.prn == prn and in_step(m)}
        for path in (folder / "ubx_20080526.ubx", folder / f"msas{prn}_20080526.ems.gz")
    )
    common = ubx.keys() & ems.keys()
    assert (len(common) >= 230, {t for t in common if ubx[t] != ems[t]}) == (True, set())


@pytest.mark.parametrize("name", ["sbas_2025/msas137.sbs.gz", "tokyo_sbas_2008/ubx_20080526.ubx", "drive_imu/walk_gnss_1730.ubx.gz"])
def test_messages_are_sent_in_step_with_gps_time(shared_data: Path, name: str) -> None:
    """So no time is a second off."""
    assert all(map(in_step, read_sbas(shared_data / name).messages))
