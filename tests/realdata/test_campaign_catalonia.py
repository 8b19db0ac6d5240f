"""Faults on real recordings, as a user plays them: `wayside campaign --recording`, and `wayside inject` with `wayside replay`."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.e2e.commands import Ran, replay_object, wayside, written
from tests.realdata.catalonia import FILES, NAVIGATION, TRIPLES, site_text, utc

ROOF = TRIPLES["roof"]

# Threats, and the size from which each trial names it: of a satellite in use at any elevation, an orbit wherever it flies.
NAMED = {"SV-STEP": (30.0, "satellite"), "RX-BIAS": (20.0, "receiver"), "MEAC": (30.0, "spoofing"), "SPF-3": (0.0, "spoofing")}
HARMLESS = ("RX-CLOCK", "CONST-CLOCK")
OTHERS = ("EPH-B-ALONG", "MP-NLOS", "RX2-SAME", "JAM-1")

# One fault each on the roof, its cause in `replay`, and who is named: everything else must not be.
FAULTS = {
    "satellite": ('kind = "satellite_step"\nsatellite = "G16"\nsize_m = 60.0', "satellite", ["G16"]),
    "orbit": ('kind = "wrong_ephemeris"\nsatellite = "G16"\noffset_m = 2500.0\ndirection = "along"', "satellite", ["G16"]),
    "clock sent": ('kind = "wrong_ephemeris"\nsatellite = "G16"\noffset_m = 60.0\ndirection = "clock"', "satellite", ["G16"]),
    "receiver": ('kind = "receiver_bias"\nreceiver = "B"\noffset_enu_m = [30.0, -20.0, 0.0]', "receiver", ["B"]),
    "spoofing": ('kind = "spoofing"\nreceivers = ["A", "B", "C"]', "spoofing", ["A", "B", "C"]),
    "silence": ('kind = "receiver_drop"\nreceiver = "C"', "data", ["C"]),
}
WHEN = 'start = "2010-03-18T05:20:15Z"\nduration_s = 300\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("catalonia")


@pytest.fixture(scope="module")
def recording(shared_data: Path, folder: Path) -> Path:
    site = written(folder / "site.toml", site_text(shared_data, ROOF))
    data = shared_data / "catalonia_2010"
    receivers = [word for r, s in zip("ABC", ROOF.stations, strict=True) for word in ("--receiver", f"{r}={data / FILES[s]}")]
    span = ("--start", utc(ROOF.start_ns), "--end", utc(ROOF.end_ns))
    ran = wayside("import", "--site", site, *receivers, "--nav", data / NAVIGATION, *span, "-o", folder / "roof.mcap")
    assert ran.code == 0, ran.err
    return folder / "roof.mcap"


@pytest.fixture(scope="module")
def ran(recording: Path) -> Ran:
    threats = [word for threat in (*NAMED, *HARMLESS, *OTHERS) for word in ("--threat", threat)]
    return wayside("campaign", "--recording", recording, *threats, "--json")


@pytest.fixture(scope="module")
def found(ran: Ran) -> dict[str, Any]:
    assert ran.code == 0, ran.err
    result: dict[str, Any] = json.loads(ran.out)
    return result


def sizes(found: dict[str, Any], threat: str) -> list[dict[str, Any]]:
    return next(of["sizes"] for of in found["threats"] if of["id"] == threat)


def test_nobody_is_named_wrongly_on_real_measurements(found: dict[str, Any]) -> None:
    assert {of["id"]: wrong for of in found["threats"] if (wrong := sum(size["named_wrongly"] for size in of["sizes"]))} == {}


def test_nothing_beyond_the_tolerance_is_normal_on_real_measurements(found: dict[str, Any]) -> None:
    assert found["hazards"]["count"] == 0


@pytest.mark.parametrize("threat", NAMED)
def test_what_was_put_into_real_measurements_is_named_in_its_first_epoch(found: dict[str, Any], threat: str) -> None:
    least, cause = NAMED[threat]
    large = [of for of in sizes(found, threat) if of["size"] >= least]
    assert [(of["causes"], of["in_first_epoch"]["count"]) for of in large] == [({cause: of["trials"]}, of["trials"]) for of in large]


@pytest.mark.parametrize("threat", HARMLESS)
def test_what_moves_no_position_stops_nothing_on_real_measurements(found: dict[str, Any], threat: str) -> None:
    assert [of["detected"]["count"] for of in sizes(found, threat)] == [0] * len(sizes(found, threat))


@pytest.fixture(scope="module", params=FAULTS)
def replayed(request: pytest.FixtureRequest, recording: Path, folder: Path) -> tuple[str, dict[str, Any]]:
    table, _, _ = FAULTS[request.param]
    faults = written(folder / f"{request.param}.toml", f"[[fault]]\n{table}\n{WHEN}")
    faulty = folder / f"{request.param}.mcap"
    ran = wayside("inject", recording, "--faults", faults, "-o", faulty)
    assert ran.code == 0, ran.err
    return request.param, replay_object(faulty)


def of_fault(replay: dict[str, Any]) -> list[dict[str, Any]]:
    """Episodes but for start-up."""
    return [episode for episode in replay["episodes"] if episode["cause"] != "not_ready"]


def test_replay_names_what_was_injected(replayed: tuple[str, dict[str, Any]]) -> None:
    name, replay = replayed
    _, cause, subjects = FAULTS[name]
    first = of_fault(replay)[0]
    assert (first["cause"], first["subjects"]) == (cause, subjects)


def test_replay_names_nobody_else(replayed: tuple[str, dict[str, Any]]) -> None:
    name, replay = replayed
    named = {s for episode in of_fault(replay) for s in episode["subjects"]} | {x["satellite"] for x in replay["exclusions"]}
    assert named <= set(FAULTS[name][2])


def test_replay_says_so_when_the_fault_begins(replayed: tuple[str, dict[str, Any]]) -> None:
    """Silence is one after two intervals, the first of which is sound."""
    name, replay = replayed
    begins = "2010-03-18T05:20:45.000000001Z" if name == "silence" else "2010-03-18T05:20:15Z"
    assert of_fault(replay)[0]["start"] == begins
