"""What is said between an NTRIP client and a caster, without the sockets: request, answer, bodies, source table, position.

Sources: RTCM 10410.0 (version 1: an answer `ICY 200 OK`, then bytes), RTCM 10410.1 (version 2: HTTP/1.1), RFC 9112 (chunks), NMEA 0183
(GGA). What a caster says may be anything: it is bounded, and shown to people in printable characters only.
"""

import re
from base64 import b64encode
from collections.abc import Iterable
from difflib import get_close_matches
from time import gmtime, strftime
from typing import NamedTuple

from integrity.errors import DecodeError

MOST_HEAD_BYTES = 8192  # of an answer before its body: a dozen lines are usual
MOST_LINE_BYTES = 256  # of the size of a chunk, with extensions that nobody sends
MOST_TABLE_BYTES = 1 << 20  # of a source table: large casters have some 200 kB
SHOWN_CHARACTERS = 60
NAMES_SHOWN = 3

_STATUS = re.compile(r"(ICY|SOURCETABLE|HTTP/1\.[01]) ([0-9]{3})(?: (.*))?")
_SIZE = re.compile(rb"([0-9A-Fa-f]{1,8})[ \t]*(?:;[^\r\n]*)?")
_HEADER_LINE = re.compile(rb"[A-Za-z][A-Za-z0-9-]{0,40}:[ -~]{0,200}\r\n")


class Answer(NamedTuple):
    """The head of a caster's answer: `kind` is ICY, SOURCETABLE or HTTP; header names in small letters; `rest` came after the head."""

    kind: str
    code: int
    words: str
    headers: dict[str, str]
    rest: bytes

    @property
    def is_table(self) -> bool:
        """A source table comes instead of a stream: there is no such mount point, or none was asked for."""
        return self.kind == "SOURCETABLE" or "sourcetable" in self.headers.get("content-type", "").lower()

    @property
    def is_stream(self) -> bool:
        """The bytes that were asked for follow; a page of a web server is none."""
        return self.code == 200 and not self.is_table and not self.headers.get("content-type", "").lower().startswith("text/")


def request(host: str, port: int, mount: str, software: str, credentials: tuple[str, str] | None, gga: str) -> bytes:
    """What asks for a mount point; for the source table where `mount` is empty. A caster of version 1 knows it as well."""
    shown = f"[{host}]" if ":" in host else host
    lines = [f"GET /{mount} HTTP/1.1", f"Host: {shown}:{port}", "Ntrip-Version: Ntrip/2.0", f"User-Agent: NTRIP {software}"]
    if credentials is not None:
        lines.append(f"Authorization: Basic {b64encode(':'.join(credentials).encode()).decode()}")
    if gga:
        lines.append(f"Ntrip-GGA: {gga.strip()}")
    return "\r\n".join([*lines, "Connection: close", "", ""]).encode()


def parse_answer(data: bytes) -> Answer | None:
    """The head that these bytes begin with; None where there is more to come, DecodeError where no caster would begin so."""
    line, ended, rest = data.partition(b"\r\n")
    first = line[:MOST_LINE_BYTES].decode("latin-1")
    if len(line) > MOST_LINE_BYTES or (data and not data[:1].isalpha()):
        raise DecodeError(f"it says {printable(first)!r}")
    if not ended:
        return None
    if first.startswith("ERROR"):  # version 1: "ERROR - Bad Password"
        return Answer("ICY", 401 if "password" in first.lower() else 400, printable(first), {}, rest)
    status = _STATUS.fullmatch(first)
    if status is None:
        raise DecodeError(f"it says {printable(first)!r}")
    kind, code, words = status[1].partition("/")[0], int(status[2]), printable(status[3] or "")
    if kind == "ICY":
        return Answer(kind, code, words, {}, rest)
    head, ended, body = rest.partition(b"\r\n\r\n") if not rest.startswith(b"\r\n") else (b"", b"\r\n", rest[2:])
    if not ended:
        if len(data) > MOST_HEAD_BYTES:
            raise DecodeError(f"its answer {printable(first)!r} has no end")
        return None
    fields = (text.partition(":") for text in head.decode("latin-1").split("\r\n"))
    return Answer(kind, code, words, {name.strip().lower(): value.strip() for name, _, value in fields}, body)


class ChunkedBody:
    """Takes the chunks' frames off a body, however it is cut. Source: RFC 9112, 7.1; a bare line feed ends a line as well.

    `over` says in words why nothing more will come; None while it goes on.
    """

    def __init__(self) -> None:
        self.over: str | None = None
        self._left = 0  # bytes of the chunk in hand
        self._line = b""  # the beginning of a line
        self._awaits = "size"  # what the next line is: "size", "end" of a chunk, "trailer"

    def feed(self, data: bytes) -> bytes:
        """What the chunks hold in these bytes. After the last chunk, and after what is none, nothing."""
        found = bytearray()
        at = 0
        while at < len(data) and self.over is None:
            if self._left:
                piece = data[at : at + self._left]
                found += piece
                self._left -= len(piece)
                at += len(piece)
                continue
            line_end = data.find(b"\n", at, at + MOST_LINE_BYTES)
            until = line_end + 1 if line_end >= 0 else min(len(data), at + MOST_LINE_BYTES)
            self._line += data[at:until]
            at = until
            if line_end >= 0:
                line, self._line = self._line[:-1].removesuffix(b"\r"), b""
                self._take(line)
            elif len(self._line) > MOST_LINE_BYTES + 1:  # a carriage return may be among them
                self._take(self._line)
        return bytes(found)

    def _take(self, line: bytes) -> None:
        size = _SIZE.fullmatch(line) if len(line) <= MOST_LINE_BYTES else None
        match self._awaits:
            case "size" if size is not None:
                self._left = int(size[1], 16)
                self._awaits = "end" if self._left else "trailer"
            case "end" if not line:
                self._awaits = "size"
            case "trailer" if not line:
                self.over = "the caster has ended the stream"
            case "trailer" if len(line) <= MOST_LINE_BYTES:
                pass
            case _:
                self.over = f"what came is no chunk: {printable(line.decode('latin-1'))!r}"


class PlainBody:
    """A body without frames. Of an answer ICY the lines are left out that some casters put before their bytes: headers, an empty line."""

    def __init__(self, begins_with_lines: bool) -> None:
        self.over: str | None = None
        self._begun = b"" if begins_with_lines else None

    def feed(self, data: bytes) -> bytes:
        """What is there; the beginning waits until it is clear whether it is a line."""
        if self._begun is None:
            return data
        self._begun += data
        while header := _HEADER_LINE.match(self._begun):
            self._begun = self._begun[header.end() :]
        if self._may_be_a_line(self._begun):
            return b""
        rest, self._begun = self._begun.removeprefix(b"\r\n"), None
        return rest

    def _may_be_a_line(self, begun: bytes) -> bool:
        return begun in (b"", b"\r") or (len(begun) <= MOST_LINE_BYTES and re.fullmatch(rb"[A-Za-z][ -~]*\r?", begun) is not None)


def body_of(answer: Answer) -> ChunkedBody | PlainBody:
    """Reads what follows an answer, beginning with its `rest`."""
    if answer.headers.get("transfer-encoding", "").lower() == "chunked":
        return ChunkedBody()
    return PlainBody(begins_with_lines=answer.kind == "ICY")


def mount_points(table: bytes) -> list[str]:
    """The names in a source table, in its order. Source: RTCM 10410.1, 5: `STR;` and the name."""
    lines = (line.split(b";") for line in table.splitlines())
    return [printable(fields[1].decode("latin-1")) for fields in lines if fields[0] == b"STR" and len(fields) > 1 and fields[1]]


def nearest(mount: str, names: Iterable[str]) -> str:
    """What to write instead of a mount point that does not exist, in words; nothing where there are no names."""
    known = list(dict.fromkeys(names))
    by_small = {name.lower(): name for name in known}
    close = [by_small[small] for small in get_close_matches(mount.lower(), by_small, n=NAMES_SHOWN, cutoff=0.5)]
    if close:
        return f"did you mean {' or '.join(close)}?"
    return f"it has {', '.join(known[:NAMES_SHOWN])}{' and others' * (len(known) > NAMES_SHOWN)}" if known else ""


def gga_sentence(lat_deg: float, lon_deg: float, height_m: float, utc_s: float) -> str:
    """A NMEA GGA sentence with its line end: geodetic degrees, ellipsoidal metres, Unix seconds. Source: NMEA 0183, GGA.

    The height is written as altitude over a geoid at 0 m: their sum is what the ellipsoid is meant to have.
    """
    lat, lon = (divmod(round(abs(angle) * 6e7), 60_000_000) for angle in (lat_deg, lon_deg))  # degrees, millionths of a minute
    north, east = "NS"[lat_deg < 0], "EW"[lon_deg < 0]
    place = f"{lat[0]:02d}{lat[1] / 1e6:09.6f},{north},{lon[0]:03d}{lon[1] / 1e6:09.6f},{east}"
    content = f"GPGGA,{strftime('%H%M%S', gmtime(utc_s))}.00,{place},1,12,1.0,{height_m:.3f},M,0.000,M,,"
    checksum = 0
    for character in content.encode():
        checksum ^= character
    return f"${content}*{checksum:02X}\r\n"


def printable(text: str) -> str:
    """Words from the network, for people: shortened, nothing in them that moves a terminal."""
    shown = "".join(c if c.isascii() and c.isprintable() else "." for c in text[:SHOWN_CHARACTERS])
    return shown + "…" * (len(text) > SHOWN_CHARACTERS)
