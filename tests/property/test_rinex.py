"""However a RINEX file is damaged: it is refused with a DecodeError, or it gives finite numbers that an orbit can have.

Where bytes were lost or one was added (rather than changed), every pseudorange is within a metre of the one that stood there for
that signal at that time: a digit added among the decimals looks like any other.
"""

import gzip
import itertools
import tempfile
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.errors import DecodeError
from integrity.gnss.observations import ObservationRow
from recordings.rinex.navigation import NavigationFile, read_navigation
from recordings.rinex.observation import ObservationFile, read_observations


def header(content: str, label: str) -> str:
    return f"{content:<60}{label}\n"


def observations_2() -> str:
    text = header("     2.11           OBSERVATION DATA    G (GPS)", "RINEX VERSION / TYPE")
    text += header("     6    C1    L1    D1    S1    P2    L2", "# / TYPES OF OBSERV")
    text += header("  2010     3    18     0     0    0.0000000     GPS", "TIME OF FIRST OBS") + header("", "END OF HEADER")
    for k in range(3):
        text += f" 10  3 18  0  0 {10 * k:2d}.0000000  0  3G12G 9G 6\n"
        for s in range(3):
            numbers = (20_607_600.189 + 1.1e6 * s + 91.7 * k, -1.43e7 + 482.0 * k, -1517.476, 47.5 - s, 20_607_605.848 + 1.1e6 * s)
            text += "".join(f"{number:14.3f} 7" for number in numbers) + f"\n{-1.1e7 + 375.0 * k:14.3f} 4\n"
    return text


def observations_3() -> str:
    text = header("     3.05           OBSERVATION DATA    M", "RINEX VERSION / TYPE")
    text += header("G    5 C1C L1C D1C S1C C5Q", "SYS / # / OBS TYPES") + header("E    3 C5Q C1X S1X", "SYS / # / OBS TYPES")
    text += header("  2010     3    18     0     0    0.0000000     GPS", "TIME OF FIRST OBS") + header("", "END OF HEADER")
    for k in range(3):
        text += f"> 2010 03 18 00 00 {10 * k:2d}.0000000  0  3\n"
        for s, name in enumerate(("G12", "G09", "E11")):
            numbers = (20_607_600.189 + 1.1e6 * s + 91.7 * k, 24_430_000.75 - 1.3e5 * s, 47.5 - s)[: 3 if name == "E11" else 2]
            text += name + "".join(f"{number:14.3f} 7" for number in numbers) + "\n"
    return text


RECORD = """\
 -.839701388031D-03 -.165982783074D-10  .000000000000D+00
     .910000000000D+02  .934062500000D+02  .116040547840D-08  .162092304801D+00
     .484101474285D-05  .626740418375D-02  .652112066746D-05  .515365489006D+04
     .409904000000D+06 -.242143869400D-07  .329237003460D+00 -.596046447754D-07
     .111541663136D+01  .326593750000D+03  .206958726335D+01 -.638312302555D-08
     .307155651409D-09  .517000000000D+03  .102500000000D+04  .000000000000D+00
     .200000000000D+01  .000000000000D+00 -.990000000000D-08  .910000000000D+02
     .406800000000D+06  .000000000000D+00
"""
NAVIGATION_2 = (
    header("     2.10           N: GPS NAV DATA", "RINEX VERSION / TYPE")
    + header("     .1676D-07   .2235D-07  -.1192D-06  -.1192D-06", "ION ALPHA")
    + header("     .1208D+06   .1310D+06  -.1310D+06  -.1966D+06", "ION BETA")
    + header("", "END OF HEADER")
    + (" 6 99  9  2 17 51 44.0" + RECORD) * 2
)
NAVIGATION_3 = (
    header("     3.05           N: GNSS NAV DATA    M: MIXED", "RINEX VERSION / TYPE")
    + header("    18    19  2185     7", "LEAP SECONDS")
    + header("", "END OF HEADER")
    + ("G06 1999 09 02 17 51 44" + RECORD.replace("     ", "      "))
    + ("E06 1999 09 02 17 51 44" + RECORD.replace("     ", "      ").replace(" .910000000000D+02\n", "-.770000000000D-08\n"))
)
OBSERVATIONS = [observations_2().encode(), observations_3().encode()]
NAVIGATION = [NAVIGATION_2.encode(), NAVIGATION_3.encode()]

LIKELY = st.sampled_from(b" 0123456789.-+DEGnaifd_*\n\r>\x00\xff")  # what does most harm in such a file
PLACE = st.floats(0.0, 1.0)


@st.composite
def damaged(draw: st.DrawFn, files: list[bytes]) -> bytes:
    """A file with bytes changed, lost, added, repeated or cut off, perhaps packed and damaged again."""
    data = bytearray(draw(st.sampled_from(files)))
    packed = draw(st.booleans()) and draw(st.booleans())
    for _ in range(draw(st.integers(1, 6))):
        at = int(draw(PLACE) * len(data))
        match draw(st.sampled_from(("change", "lose", "add", "repeat", "cut"))):
            case "change":
                data[at : at + 1] = bytes([draw(LIKELY)])
            case "lose":
                del data[at : at + draw(st.integers(1, 200))]
            case "add":
                data[at:at] = bytes(draw(st.lists(LIKELY, min_size=1, max_size=20)))
            case "repeat":
                data[at:at] = data[at : at + draw(st.integers(1, 200))]
            case _:
                del data[max(at, len(data) // 3) :]
    if packed:
        data = bytearray(gzip.compress(bytes(data)))
        del data[int(draw(PLACE) * len(data)) :]
    return bytes(data)


@st.composite
def shifted(draw: st.DrawFn, files: list[bytes]) -> tuple[bytes, bytes]:
    """A file, and the same with one run of bytes lost or one byte added."""
    data = draw(st.sampled_from(files))
    at = int(draw(PLACE) * len(data))
    if draw(st.booleans()):
        return data, data[:at] + data[at + draw(st.integers(1, 12)) :]
    return data, data[:at] + bytes([draw(LIKELY)]) + data[at:]


def observations_of(data: bytes) -> ObservationFile | None:
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "damaged"
        path.write_bytes(data)
        try:
            return read_observations(path, "A")
        except DecodeError:
            return None


def navigation_of(data: bytes) -> NavigationFile | None:
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "damaged"
        path.write_bytes(data)
        try:
            return read_navigation(path)
        except DecodeError:
            return None


def pseudoranges(rows: tuple[ObservationRow, ...]) -> dict[tuple[int, str], float]:
    return {(row.receive_time_ns, signal): row.pseudorange_m[k] for row in rows for k, signal in enumerate(row.signals)}


@settings(deadline=None)  # it writes and reads a file
@given(damaged(OBSERVATIONS))
def test_damaged_observations_are_refused_or_possible(data: bytes) -> None:
    file = observations_of(data)
    for row in file.rows if file else ():
        assert 0 <= row.receive_time_ns < 2**63
        assert ((row.pseudorange_m >= 1e7) & (row.pseudorange_m <= 1e8)).all()
        assert not np.isinf([row.carrier_cycles, row.doppler_hz]).any()
        assert (np.isnan(row.cn0_dbhz) | ((row.cn0_dbhz > 0.0) & (row.cn0_dbhz <= 70.0))).all()


@settings(deadline=None)  # it writes and reads a file
@given(shifted(OBSERVATIONS))
def test_lost_or_added_bytes_never_make_a_pseudorange(pair: tuple[bytes, bytes]) -> None:
    whole, file = (observations_of(data) for data in pair)
    assert whole is not None
    expected = pseudoranges(whole.rows)
    for key, pseudorange_m in pseudoranges(file.rows).items() if file else ():
        assert abs(pseudorange_m - expected[key]) < 1.0


@settings(deadline=None)  # it writes and reads a file
@given(damaged(NAVIGATION))
def test_damaged_navigation_is_refused_or_possible(data: bytes) -> None:
    file = navigation_of(data)
    for eph in file.ephemerides if file else ():
        assert eph.implausibility() is None
        assert 0 <= eph.toe_ns < 2**63
        assert eph.accuracy_m is None or 0.0 <= eph.accuracy_m <= 6144.0 or eph.satellite[0] == "E"
    if file and file.klobuchar:
        assert np.isfinite(list(itertools.chain(file.klobuchar.alpha, file.klobuchar.beta))).all()


def test_the_files_are_whole_before_they_are_damaged() -> None:
    whole = [observations_of(data) for data in OBSERVATIONS] + [navigation_of(data) for data in NAVIGATION]
    assert [file.problems for file in whole if file] == [{}, {}, {}, {}]
