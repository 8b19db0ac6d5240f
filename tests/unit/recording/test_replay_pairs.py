"""A recording of a station that decides on pairs of frequencies is decided again as it was; and on one frequency."""

from functools import cache
from pathlib import Path

import pytest

from integrity.gnss.signals import is_pair
from integrity.outputs import EpochReport
from integrity.states import State
from recordings.diff import differences, recorded_reports
from recordings.reader import Contents, read_recording
from recordings.replay import decide, decide_and_record, replayable
from recordings.site_file import override_site
from recordings.summary import decisions_sha256
from tests.unit.monitored import range_fault
from tests.unit.pairs import as_sent, everything
from tests.unit.recording.replayed import SITE
from tests.unit.streams import reports

PAIRS = override_site(SITE, ["frequencies=2", "tolerance_m=100.0", "sigma_differential_m=1.5", "sigma_differential_up_m=3.0"])
FAULTY = range_fault(everything(), "ABC", 60.0, "G07")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pairs") / "pairs.mcap"
    decide_and_record(path, PAIRS, as_sent(FAULTY, "ubx"), {})
    return path


@cache
def contents(path: Path) -> Contents:
    return read_recording(path)


def again(path: Path, block_epochs: int = 1000, **settings: str) -> list[EpochReport]:
    todo = replayable(contents(path), override_site(PAIRS, [f"{key}={value}" for key, value in settings.items()]) if settings else None)
    outputs, _ = decide(todo.site, todo.events, todo.snapshot, block_epochs)
    return reports(outputs)


def used(found: list[EpochReport]) -> set[str]:
    return {s for r in found for s, is_used in zip(r.signals, r.used, strict=True) if is_used}


@pytest.mark.parametrize("block_epochs", [1, 7, 1000])
def test_it_is_decided_as_it_was(made: Path, block_epochs: int) -> None:
    assert differences(recorded_reports(contents(made), None, None), again(made, block_epochs)) == []


@pytest.mark.parametrize("block_epochs", [1, 7])
def test_every_number_is_the_same_whatever_the_blocks(made: Path, block_epochs: int) -> None:
    assert [_bits(r) for r in again(made, block_epochs)] == [_bits(r) for r in again(made)]


def _bits(report: EpochReport) -> tuple[bytes, ...]:
    return tuple(a.tobytes() for a in (report.e_enu_m, report.statistic, report.b_m, report.residual_sigmas))


def test_recorded_twice_it_is_the_same_bytes(made: Path, tmp_path: Path) -> None:
    decide_and_record(tmp_path / "again.mcap", PAIRS, as_sent(FAULTY, "ubx"), {})
    assert (tmp_path / "again.mcap").read_bytes() == made.read_bytes()


def test_the_fault_is_in_it(made: Path) -> None:
    assert {r.excluded for r in again(made)} == {(), ("G07",)}


def test_on_one_frequency_no_pair_is_used(made: Path) -> None:
    found = used(again(made, frequencies="1"))
    assert found and not any(map(is_pair, found))


def test_on_one_frequency_it_is_decided_like_one_that_began_so(made: Path) -> None:
    """What the monitor of pairs remembers of second signals does not come in."""
    single = override_site(PAIRS, ["frequencies=1"])
    todo = replayable(contents(made), single)
    whole, _ = decide(single, todo.events, None)
    assert decisions_sha256(again(made, frequencies="1")) == decisions_sha256(reports(whole))


def test_a_snapshot_of_pairs_serves_one_frequency(made: Path) -> None:
    """Signals of the second frequency that are remembered are not decided on."""
    todo = replayable(contents(made))
    half = len(todo.events) // 2
    _, monitor = decide(PAIRS, todo.events[:half])
    outputs, _ = decide(override_site(PAIRS, ["frequencies=1"]), todo.events[half:], monitor.snapshot())
    found = reports(outputs)
    assert {s for r in found for s in r.signals} and {s[4:] for r in found for s in r.signals} == {"1C"}


def test_the_sound_part_is_normal(made: Path) -> None:
    assert State.NORMAL in {r.state for r in again(made)}
