"""What is said with a caster, without one: answers of both versions, source tables, the sentence that tells a position."""

import pytest

from integrity.errors import DecodeError
from recordings.sources.ntrip_messages import (
    MOST_LINE_BYTES,
    Answer,
    ChunkedBody,
    body_of,
    gga_sentence,
    mount_points,
    nearest,
    parse_answer,
    request,
)

V2 = b"HTTP/1.1 200 OK\r\nServer: x\r\nTransfer-Encoding: Chunked\r\nContent-Type: gnss/data\r\n\r\n"
TABLE = b"CAS;a;1\r\nSTR;TOKYO;x\r\nNET;b\r\nSTR;Kyoto;y\r\nSTR;\r\nSTR\r\nENDSOURCETABLE\r\n"


def answered(data: bytes) -> Answer:
    answer = parse_answer(data)
    assert answer is not None
    return answer


def through(data: bytes) -> bytes:
    """What is left of an answer for the receiver."""
    answer = answered(data)
    return body_of(answer).feed(answer.rest)


@pytest.mark.parametrize(
    ("data", "left"),
    [
        (V2 + b"3\r\nabc\r\nA;x=y\r\n0123456789\r\n", b"abc0123456789"),
        (b"HTTP/1.0 200 OK\r\nContent-Type: gnss/data\r\n\r\n\r\n\xd3", b"\r\n\xd3"),
        (b"HTTP/1.1 200 OK\r\n\r\nabc", b"abc"),
        (b"ICY 200 OK\r\n\r\n\xd3\x00", b"\xd3\x00"),
        (b"ICY 200 OK\r\n\xd3\x00", b"\xd3\x00"),
        (b"ICY 200 OK\r\nServer: a b\r\nDate: today 12:00\r\n\r\n\xd3\x00", b"\xd3\x00"),
        (b"ICY 200 OK\r\n$GPGGA,,\r\n", b"$GPGGA,,\r\n"),
        (b"ICY 200 OK\r\nabc\xd3", b"abc\xd3"),
    ],
)
def test_a_stream_is_what_follows_its_head(data: bytes, left: bytes) -> None:
    assert (answered(data).is_stream, through(data)) == (True, left)


@pytest.mark.parametrize(("length", "left"), [(MOST_LINE_BYTES, b"abc"), (MOST_LINE_BYTES + 1, b"")])
@pytest.mark.parametrize("piece", [1, 1000])
def test_the_size_of_a_chunk_has_a_longest_line(length: int, left: bytes, piece: int) -> None:
    body, data = ChunkedBody(), b"3;".ljust(length, b"x") + b"\r\nabc\r\n"
    assert b"".join(body.feed(data[at : at + piece]) for at in range(0, len(data), piece)) == left


@pytest.mark.parametrize("answer", [V2, b"ICY 200 OK\r\n", b"SOURCETABLE 200 OK\r\na: b\r\n\r\n", b"ERROR - Bad Password\r\n"])
def test_a_head_that_is_not_whole_waits_for_the_rest(answer: bytes) -> None:
    assert [parse_answer(answer[:n]) is None for n in (0, 1, len(answer) - 1, len(answer))] == [True, True, True, False]


@pytest.mark.parametrize("first", [b"RTSP/1.0 200 OK\r\n", b"HTTP/1.1 abc\r\n", b"\x00", b"a" * (MOST_LINE_BYTES + 1), b"ICY\r\n", b"\r\n"])
def test_what_no_caster_says_is_refused(first: bytes) -> None:
    with pytest.raises(DecodeError, match="it says"):
        parse_answer(first)


@pytest.mark.parametrize(
    "data",
    [
        b"SOURCETABLE 200 OK\r\nContent-Type: text/plain\r\n\r\n" + TABLE,
        b"HTTP/1.1 200 OK\r\nContent-Type: gnss/sourcetable\r\n\r\n" + TABLE,
    ],
)
def test_a_source_table_is_no_stream(data: bytes) -> None:
    answer = answered(data)
    assert (answer.is_stream, mount_points(through(data))) == (False, ["TOKYO", "Kyoto"])


@pytest.mark.parametrize(
    ("mount", "names", "said"),
    [
        ("tokio2", ["KYOTO", "TOKYO1", "TOKYO2"], "did you mean TOKYO2 or TOKYO1?"),
        ("zzz", ["A", "B"], "it has A, B"),
        ("zzz", ["A", "B", "C", "D"], "it has A, B, C and others"),
        ("zzz", [], ""),
    ],
)
def test_the_nearest_names_are_said(mount: str, names: list[str], said: str) -> None:
    assert nearest(mount, names) == said


def test_a_request_has_no_line_of_its_users_making() -> None:
    asked = request("::1", 2101, "M", "x 1", ("a\r\nb", "c\r\n"), "")
    assert asked.decode().split("\r\n") == [
        "GET /M HTTP/1.1",
        "Host: [::1]:2101",
        "Ntrip-Version: Ntrip/2.0",
        "User-Agent: NTRIP x 1",
        "Authorization: Basic YQ0KYjpjDQo=",  # by coreutils' base64
        "Connection: close",
        "",
        "",
    ]


@pytest.mark.parametrize(
    ("lat_deg", "lon_deg", "height_m"),
    [(35.5, 139.75, 65.712), (-0.000001, -179.9999999999, -12.5), (90.0, 180.0, 0.0), (0.999999999, -0.5, 1.0)],
)
def test_a_position_is_read_back_by_others(lat_deg: float, lon_deg: float, height_m: float) -> None:
    """By pynmeagps, which pyubx2 brings, to 1e-6 minutes: 2 mm."""
    pynmeagps = pytest.importorskip("pynmeagps")
    read = pynmeagps.NMEAReader.parse(gga_sentence(lat_deg, lon_deg, height_m, 1772421007.9), validate=pynmeagps.VALCKSUM)
    found = (float(read.lat), float(read.lon), read.alt + read.sep)
    assert found == pytest.approx((lat_deg, lon_deg, height_m), abs=2e-8)


def test_a_position_carries_the_time_of_day() -> None:
    assert gga_sentence(0.0, 0.0, 0.0, 1772421007.9).startswith("$GPGGA,031007.00,")  # 2026-03-02T03:10:07Z
