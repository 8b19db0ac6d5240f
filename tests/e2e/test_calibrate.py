"""`wayside replay --calibrate`: from a recording to a site file that `station check` accepts."""

from pathlib import Path

import pytest

from recordings.replay import decide_and_record
from recordings.simulate.observations import simulate
from recordings.site_file import parse_site
from tests.e2e.commands import SITE, Ran, wayside, written
from tests.unit.streams import START_NS

EVERY_30_S = ("epoch_interval_s = 1.0", "epoch_interval_s = 30.0")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of half a day and one of a minute, of observations: decoding half a day of bytes takes a minute."""
    folder = tmp_path_factory.mktemp("calibrate")
    for name, text, interval_s, duration_s in (("long", SITE.replace(*EVERY_30_S), 30.0, 43_200.0), ("short", SITE, 1.0, 60.0)):
        site = parse_site(text, f"{name}.toml")
        decide_and_record(folder / f"{name}.mcap", site, simulate(site.config, START_NS, duration_s, 1.0 / interval_s, 1), {})
    return folder


@pytest.fixture(scope="module")
def calibrated(folder: Path) -> Ran:
    return wayside("replay", folder / "long.mcap", "--calibrate", folder / "measured.toml", "--json")


def test_it_measures(calibrated: Ran) -> None:
    assert calibrated.code == 0, calibrated.err
    assert "sigmas measured on 1439 epochs, 12.0 h" in calibrated.err


def test_station_check_accepts_what_it_writes(folder: Path, calibrated: Ran) -> None:
    before, _, rest = SITE.replace(*EVERY_30_S).partition("[integrity]")
    site = before + (folder / "measured.toml").read_text() + rest[rest.index("[publish]") :]
    ran = wayside("station", "check", written(folder / "site.toml", site))
    assert ran.code == 0, ran.out + ran.err


def test_a_short_recording_is_refused_and_nothing_written(folder: Path) -> None:
    ran = wayside("replay", folder / "short.mcap", "--calibrate", folder / "none.toml")
    assert (ran.code, (folder / "none.toml").exists()) == (2, False)
    assert "too little to calibrate with" in ran.err
