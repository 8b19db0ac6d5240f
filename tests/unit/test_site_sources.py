"""Where a site file says that receivers' bytes come from, and what they hold."""

import pytest

from recordings.site_file import parse_site
from tests.unit.sites import edited


def test_sources_are_by_receiver_and_may_be_missing() -> None:
    assert parse_site(edited(('source = "tcp://10.0.0.2:2000"\n', "")), "site.toml").sources == {
        "A": "serial:///dev/ttyACM0?baud=460800",
        "B": None,
        "C": "ntrip://user:secret@caster.example:2101/MOUNT",
    }


@pytest.mark.parametrize(
    "source",
    [
        *("udp://:5000", "udp://239.0.0.1:5000", "file:rec/a.ubx", "file:/rec/a.ubx", "tcp://[::1]:2000", "serial://COM3"),
        *("ntrip://h:2101/M", "ntrip://h:1/M?gga=-90,180.0,-12.5", "ntrips://u%3A:p%2F@[::1]:443/M?ca=/a/ca.pem&gga=35.5,139.25,60"),
    ],
)
def test_a_well_formed_source_is_taken(source: str) -> None:
    assert parse_site(edited(("tcp://10.0.0.2:2000", source)), "site.toml").sources["B"] == source


@pytest.mark.parametrize(
    ("source", "stated", "protocol"),
    [
        ("tcp://h:1", "", "ubx"),
        ("ntrip://h:1/M", "", "rtcm3"),
        ("ntrips://h:1/M", "", "rtcm3"),
        ("tcp://h:1", 'protocol = "rtcm3"', "rtcm3"),
        ("ntrip://h:1/M", 'protocol = "ubx"', "ubx"),
    ],
)
def test_a_protocol_is_as_stated_or_what_usually_comes_from_there(source: str, stated: str, protocol: str) -> None:
    site = parse_site(edited(("tcp://10.0.0.2:2000", source), ('model = "mosaic-X5"', stated)), "site.toml")
    assert site.config.protocols["B"] == protocol
