"""The site of a recording: decided again under other promises, refused with other receivers, and recorded without its secrets."""

from dataclasses import replace
from pathlib import Path

import pytest

from integrity.errors import ConfigError
from integrity.health import Health
from integrity.states import Cause, State
from recordings.reader import read_recording
from recordings.replay import decide, recorded_site, replayable
from recordings.site_file import override_site, parse_site
from tests.unit.recording.replayed import SITE, SLOW_SITE, Recorded, minutes, recorded
from tests.unit.sites import SITE as SITE_TEXT
from tests.unit.sites import edited
from tests.unit.streams import reports, stream

# Other promises, other receivers


def test_other_promises_begin_anew_with_what_was_decided(slow: Recorded) -> None:
    other = override_site(SLOW_SITE, ["false_stops_per_year=2.0"])
    snapshot = replayable(slow.contents, other, minutes(61)).snapshot
    assert snapshot is not None
    assert (snapshot.health, snapshot.exclusions, snapshot.last_clean) == (Health(), (), None)


def test_other_promises_keep_what_was_received(slow: Recorded) -> None:
    other = override_site(SLOW_SITE, ["false_stops_per_year=2.0"])
    anew, own = replayable(slow.contents, other, minutes(61)).snapshot, replayable(slow.contents, None, minutes(61)).snapshot
    assert anew is not None
    assert own is not None
    assert anew.ephemerides == own.ephemerides != ()
    assert replace(anew.assembler, last_rows=()) == replace(own.assembler, last_rows=())  # rows hold arrays, which have no truth value


def test_other_promises_are_not_ready_at_first(slow: Recorded) -> None:
    todo = replayable(slow.contents, override_site(SLOW_SITE, ["false_stops_per_year=2.0"]), minutes(121))
    outputs, _ = decide(todo.site, todo.events, todo.snapshot)
    assert reports(outputs)[0].cause is Cause.NOT_READY


def test_other_promises_reach_normal_with_the_ephemerides_of_before(slow: Recorded) -> None:
    todo = replayable(slow.contents, override_site(SLOW_SITE, ["false_stops_per_year=2.0"]), minutes(121))
    outputs, _ = decide(todo.site, todo.events, todo.snapshot)
    assert reports(outputs)[-1].state is State.NORMAL


def test_other_names_of_receivers_are_refused(fast: Recorded) -> None:
    renamed = parse_site(edited(("[receivers.C]", "[receivers.D]")), "other.toml")
    with pytest.raises(ConfigError, match="the site file has receivers A, B, D, the recording A, B, C: name them as recorded"):
        replayable(fast.contents, renamed)


def test_another_protocol_is_refused(fast: Recorded) -> None:
    other = parse_site(edited(('model = "mosaic-X5"', 'protocol = "rtcm3"')), "other.toml")
    with pytest.raises(
        ConfigError, match=r"has receiver B send rtcm3, the recording holds ubx: write protocol = \"ubx\" below \[receivers.B\]"
    ):
        replayable(fast.contents, other)


# Secrets

SOURCES = {
    "plain": "ntrip://user:hunter2@caster.example:2101/MOUNT",
    "password with @": "ntrip://user:x@hunter2@caster.example:2101/MOUNT",
    "password with quote": "ntrip://user:it's-hunter2@caster.example:2101/MOUNT",
    "no user": "ntrip://:hunter2@caster.example:2101/MOUNT",
    "TLS": "ntrips://user:hunter2@caster.example:2101/MOUNT",
    "capitals": "NTRIP://user:hunter2@caster.example:2101/MOUNT",
    "percent": "ntrip://user:hunter2%40@caster.example:2101/MOUNT",
}


@pytest.mark.parametrize("kind", SOURCES)
def test_no_password_is_in_a_recording(kind: str, tmp_path: Path) -> None:
    try:
        site = parse_site(SITE_TEXT.replace("ntrip://user:secret@caster.example:2101/MOUNT", SOURCES[kind]), "site.toml")
    except ConfigError:
        return  # refused: then there is nothing to leak
    recorded(tmp_path / "x.mcap", site, stream(2.0))
    everything = b"".join(e.data for e in read_recording(tmp_path / "x.mcap").entries)
    assert b"hunter2" not in everything


def test_the_user_and_the_caster_are_in_a_recording(fast: Recorded) -> None:
    assert recorded_site(fast.contents).sources["C"] == "ntrip://user:***@caster.example:2101/MOUNT"


def test_a_site_without_its_password_decides_as_with_it(fast: Recorded) -> None:
    assert recorded_site(fast.contents).config == SITE.config
