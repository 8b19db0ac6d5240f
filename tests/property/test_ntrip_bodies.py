"""Whatever a caster sends and however it is cut: bodies give the same bytes, and nothing escapes but refusals of the answer."""

from collections.abc import Sequence
from itertools import pairwise

from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.errors import DecodeError
from recordings.sources.ntrip_messages import ChunkedBody, PlainBody, body_of, mount_points, parse_answer

PAYLOADS = st.lists(st.binary(min_size=1, max_size=400), max_size=6)
PLACES = st.lists(st.integers(0, 3000), max_size=8)
LINES = st.sampled_from([b"\r\n", b"3\r\nabc\r\n", b"0\r\n", b"\n", b"\r", b"f" * 260, b"A: b\r\n", b"a", b"\xd3", b"10;ext=1\r\n", b" "])
ROUGH = st.lists(LINES | st.binary(max_size=20), max_size=12).map(b"".join)


def in_chunks(payloads: Sequence[bytes], extension: bytes = b"") -> bytes:
    return b"".join(b"%X%b\r\n%b\r\n" % (len(p), extension, p) for p in payloads)


def fed(body: ChunkedBody | PlainBody, data: bytes, places: Sequence[int] = ()) -> tuple[bytes, str | None]:
    """What a body gives of data in pieces that end at these places."""
    ends = sorted({0, len(data), *(min(place, len(data)) for place in places)})
    return b"".join(body.feed(data[a:b]) for a, b in pairwise(ends)), body.over


@given(payloads=PAYLOADS, places=PLACES, extension=st.sampled_from([b"", b";a=b", b" "]))
def test_chunks_come_back_as_they_were_put_in(payloads: list[bytes], places: list[int], extension: bytes) -> None:
    assert fed(ChunkedBody(), in_chunks(payloads, extension), places) == (b"".join(payloads), None)


@given(payloads=PAYLOADS, places=PLACES, after=st.binary(max_size=20))
def test_the_last_chunk_ends_a_body_for_good(payloads: list[bytes], places: list[int], after: bytes) -> None:
    data = in_chunks(payloads) + b"0\r\nTrailer: x\r\n\r\n" + after
    assert fed(ChunkedBody(), data, places) == (b"".join(payloads), "the caster has ended the stream")


@settings(max_examples=500)
@given(data=ROUGH, places=PLACES)
def test_cuts_change_nothing_of_a_chunked_body(data: bytes, places: list[int]) -> None:
    whole = fed(ChunkedBody(), data)
    in_pieces = fed(ChunkedBody(), data, places)
    assert (in_pieces[0], in_pieces[1] is None) == (whole[0], whole[1] is None)


@settings(max_examples=500)
@given(data=ROUGH, places=PLACES)
def test_cuts_change_nothing_of_a_body_that_may_begin_with_lines(data: bytes, places: list[int]) -> None:
    assert fed(PlainBody(True), data, places) == fed(PlainBody(True), data)


@given(data=st.binary(max_size=400) | ROUGH.map(b"HTTP/1.1 200 OK\r\n".__add__) | ROUGH.map(b"ICY 200 OK\r\n".__add__))
def test_any_answer_is_understood_refused_or_waited_for(data: bytes) -> None:
    try:
        answer = parse_answer(data)
    except DecodeError as error:
        assert str(error).isprintable()
    else:
        assert answer is None or all(name.isprintable() for name in mount_points(body_of(answer).feed(answer.rest)))
