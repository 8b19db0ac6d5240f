"""Shadow faults: nothing is silent on a sound station; each limit that has grown, and each monitor that has gone blind, is found out."""

from collections.abc import Callable, Iterable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

import integrity.carrier_watch
import integrity.checks
import integrity.monitors.clocks
import integrity.monitors.navigation
import integrity.monitors.slow
import integrity.satellites
import integrity.stream_memory
from integrity.carrier_thresholds import CARRIER_CHECKS
from integrity.gnss.gps_time import NS_PER_S
from integrity.limits import Limits
from integrity.monitors.residuals import normalised_b_values, seen_by_all
from integrity.monitors.triangles import triangle_statistics
from integrity.self_test import is_due
from tests.unit.shadowed import DecidedBlock, a_site_with_host_time, an_hour, blocks_of, sound_hour, sound_minutes
from tests.unit.streams import RECOVER_AFTER_S, START_NS

NAMES = sound_hour().monitor.limits.names
TURNS = range(20, 26)  # epochs, 30 s apart: three minutes, so that each receiver has its turn
MANY_TURNS = range(20, 120)


def found_silent(epochs: Iterable[int], limits: Limits | None = None, block: DecidedBlock | None = None) -> set[str]:
    """Everything that is silent in some epoch, of the sound hour where no other block is given."""
    block = block or sound_hour()
    return {name for e in epochs for name in block.silent(e, limits)}


def grown(name: str, times: float, block: DecidedBlock | None = None) -> Limits:
    """Limits of which one has grown; one of zero is 1 now."""
    sound = (block or sound_hour()).monitor.limits
    values: dict[str, Any] = {f.name: getattr(sound, f.name) for f in fields(Limits) if f.init}
    values["thresholds"] = tuple(replace(t, value=t.value * times or 1.0) if t.name == name else t for t in sound.thresholds)
    if name == "slow":
        values["slow"] = sound.slow._replace(threshold=sound.slow.threshold * times)
    return Limits(**values)


def test_the_hour_is_sound() -> None:
    assert all(sound_hour().decided.clean)


def test_nothing_is_silent_on_a_sound_station() -> None:
    assert found_silent(range(len(sound_hour().decided.epochs))) == set()


# The threshold of captured pairs is half their separation where that is larger: it takes more to blind it at 120 m.
@pytest.mark.parametrize(("name", "times"), [(name, 1000.0 if name == "capture" else 10.0) for name in NAMES if name != "data"])
def test_a_limit_that_has_grown_is_found_out(name: str, times: float) -> None:
    assert found_silent(TURNS, grown(name, times)) == {name}


@pytest.mark.parametrize("name", CARRIER_CHECKS)
def test_at_one_epoch_a_second_limits_of_carriers_are_found_out_too(name: str) -> None:
    block = sound_minutes()
    assert found_silent(range(300, 480, 60), grown(name, 10.0, block), block) == {name}


def test_at_one_epoch_a_second_nothing_is_silent() -> None:
    block = sound_minutes()
    assert all(block.decided.clean)
    assert found_silent(range(0, len(block.decided.epochs), 20), None, block) == set()


def test_a_limit_of_missing_satellites_is_found_out() -> None:
    assert found_silent(TURNS, grown("data", 0.0)) == set()  # one missing is passed over, two are not
    values = {f.name: getattr(grown("data", 0.0), f.name) for f in fields(Limits) if f.init}
    assert found_silent(TURNS, Limits(**values | {"min_common_satellites": 3})) == {"data"}


Blind = Callable[..., Any]


def zeros(original: Blind) -> Blind:
    """The same with nothing but zeros in what it returns: an array, or several."""

    def blind(*args: Any) -> Any:
        found = original(*args)
        if isinstance(found, np.ndarray):
            return np.zeros_like(found)
        return type(found)(*(np.zeros_like(of) for of in found))

    return blind


def zero_for(index: Any) -> Callable[[Blind], Blind]:
    """The same with zeros for one receiver, or one satellite."""

    def of(original: Blind) -> Blind:
        def blind(*args: Any) -> Any:
            found = np.array(original(*args))
            found[index] = 0.0
            return found

        return blind

    return of


BLIND: dict[str, tuple[object, str, set[str]]] = {
    "triangles": (
        integrity.checks,
        "triangle_statistics",
        {"circle_A", "circle_B", "circle_C", "common", "common_3d", "shape", "shape_3d", "collapse"},
    ),
    "residuals": (integrity.satellites, "seen_by_all", {"residual"}),
    "B-values": (integrity.satellites, "normalised_b_values", {"b_value"}),
    "constellations": (integrity.satellites, "displacements", {"constellation"}),
    "pairs": (integrity.checks, "capture", {"capture"}),
    "slow shifts": (integrity.monitors.slow, "_sums", {"slow"}),
    "changes of sets": (integrity.monitors.navigation, "compared", {"ephemeris", "reissued"}),
    "host time": (integrity.monitors.clocks, "host_disagreement_s", {"host_time"}),
    "lost signals": (integrity.stream_memory, "lost_share", {"loss"}),
    "frozen receivers": (integrity.stream_memory, "repeating_receivers", {"repeat"}),
    "missing satellites": (integrity.checks, "missing_satellites", {"data"}),
    "carriers": (integrity.carrier_watch, "seen_by_all", set(CARRIER_CHECKS)),
    "second worst": (integrity.checks, "second_worst", {"cn0", "loss"}),
}


@pytest.mark.parametrize("monitor", BLIND)
def test_a_monitor_that_sees_nothing_is_found_out(monitor: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module, function, names = BLIND[monitor]
    sound_hour()
    monkeypatch.setattr(module, function, zeros(getattr(module, function)))
    assert found_silent(TURNS) == names


def test_orbits_that_are_all_right_are_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(integrity.monitors.navigation, "off_nominal", lambda eph: 0.0)
    assert found_silent(TURNS) == {"orbit"}


@pytest.mark.parametrize("receiver", range(3))
def test_a_receiver_whose_b_values_are_passed_over_is_found_out(receiver: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("integrity.satellites.normalised_b_values", zero_for(np.s_[:, receiver])(normalised_b_values))
    assert found_silent(TURNS) == {"b_value"}


@pytest.mark.parametrize("receiver", range(3))
def test_a_circle_that_is_passed_over_is_found_out(receiver: int, monkeypatch: pytest.MonkeyPatch) -> None:
    def blind(*args: Any) -> Any:
        found = triangle_statistics(*args)
        return found._replace(circle_m=zero_for(np.s_[:, receiver])(lambda: found.circle_m)())

    monkeypatch.setattr(integrity.checks, "triangle_statistics", blind)
    assert found_silent(TURNS) == {f"circle_{'ABC'[receiver]}"}


def test_a_satellite_whose_residual_is_passed_over_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    column = int(np.flatnonzero(sound_hour().decided.full.used.all(axis=0))[2])
    monkeypatch.setattr("integrity.satellites.seen_by_all", zero_for(np.s_[:, column])(seen_by_all))
    assert found_silent(MANY_TURNS) == {"residual"}


def test_the_rule_of_the_triangle_asks_only_for_it() -> None:
    site = a_site_with_host_time()
    [block] = blocks_of(replace(site, integrity=replace(site.integrity, rule="triangle")), an_hour()[:400])
    assert block.silent(20, grown("residual", 10.0)) == ()


# As much as the fault exceeds them: some epochs are silent, some are not.
@pytest.mark.parametrize(("name", "times"), [("residual", 2.7), ("b_value", 2.7), ("shape", 6.0), ("common", 7.0)])
def test_live_and_replay_find_the_same(name: str, times: float) -> None:
    """Of one block, and of blocks as they come when events are fed in many pieces."""
    limits = grown(name, times)
    pieces = [(block, e) for block in blocks_of(a_site_with_host_time(), an_hour(), pieces=90) for e in range(len(block.decided.epochs))]
    found = {block.decided.epochs[e].epoch_ns: block.silent(e, limits) for block, e in pieces[20:80]}
    whole = sound_hour()
    assert found == {whole.decided.epochs[e].epoch_ns: whole.silent(e, limits) for e in range(20, 80)}


@pytest.mark.parametrize(("interval_s", "expected"), [(0.1, 60), (1.0, 60), (7.0, 60), (30.0, 60), (60.0, 60), (90.0, 40)])
def test_each_minute_has_one_epoch_that_is_due(interval_s: float, expected: int) -> None:
    interval_ns = round(interval_s * NS_PER_S)
    first = -(-START_NS // interval_ns)
    assert sum(is_due(k * interval_ns, interval_ns) for k in range(first, first + round(3600 / interval_s))) == pytest.approx(
        expected, abs=1
    )


def test_start_up_is_over_when_the_turns_begin() -> None:
    assert TURNS.start * 30 > RECOVER_AFTER_S
