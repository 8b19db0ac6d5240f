"""Confirm, then use: each epoch that waits is handed back once at most, and only to a message that covers it."""

from typing import Any

import pytest

from integrity.messages import wayside_pb2 as pb
from train_client.localisation.coverage import MOST_REMEMBERED, MOST_WAITING, Coverage, Vouched, vouched_by

SIGNALS = {"G05.1C": 5, "E11.1C": 11}
A, B, C = "a-1", "b-1", "c-1"
ALL_NS = 10**9


def vouched(from_ns: int, to_ns: int, signals: dict[str, int] = SIGNALS) -> Vouched:
    return Vouched(from_ns, to_ns, signals)


def waiting(*epochs_ns: int, sites: tuple[str, ...] = (A,)) -> Coverage[str]:
    """Three stations that have said nothing yet, and fixes that wait for some of them."""
    coverage: Coverage[str] = Coverage({A: (), B: (), C: ()})
    for gps_ns in epochs_ns:
        coverage.wait(gps_ns, sites, f"fix {gps_ns}")
    return coverage


def fixes(*epochs_ns: int) -> list[str]:
    return [f"fix {gps_ns}" for gps_ns in epochs_ns]


@pytest.mark.parametrize("gps_ns, covered", [(9, False), (10, True), (15, True), (20, True), (21, False)])
def test_both_ends_are_covered_and_nothing_beyond(gps_ns: int, covered: bool) -> None:
    assert vouched(10, 20).covers(gps_ns) is covered


@pytest.mark.parametrize("gps_ns", [0, 15, 21])
def test_a_message_that_ends_before_it_begins_covers_nothing(gps_ns: int) -> None:
    assert not vouched(20, 10).covers(gps_ns)


def test_a_message_for_one_epoch_covers_it() -> None:
    assert vouched(10, 10).covers(10)


def health(**changes: Any) -> pb.Health:
    fields: dict[str, Any] = {
        "gps_time_ns": 20,
        "covers_from_gps_ns": 10,
        "covers_to_gps_ns": 20,
        "monitored": ["G05.1C", "G051.1C", "E11.1C"],
        "monitored_signals": [
            pb.MonitoredSignal(signal=signal, ephemeris_crc32=crc32) for signal, crc32 in (("G05.1C", 5), ("G051.1C", 0), ("E11.1C", 11))
        ],
    }
    return pb.Health(**(fields | changes))


def test_a_message_vouches_for_what_it_names() -> None:
    assert vouched_by(health()) == Vouched(10, 20, {"G05.1C": 5, "G051.1C": 0, "E11.1C": 11})


def test_a_message_cannot_cover_what_comes_after_its_own_epoch() -> None:
    assert vouched_by(health(gps_time_ns=19)) is None


def test_an_excluded_satellite_is_not_vouched_for() -> None:
    assert vouched_by(health(excluded_satellites=["G05", "G07"])) == Vouched(10, 20, {"G051.1C": 0, "E11.1C": 11})


def test_a_signal_without_its_ephemeris_is_not_vouched_for() -> None:
    of_one = [pb.MonitoredSignal(signal="G05.1C", ephemeris_crc32=5)]
    assert vouched_by(health(monitored_signals=of_one)) == Vouched(10, 20, {"G05.1C": 5})


def test_an_ephemeris_alone_monitors_nothing() -> None:
    assert vouched_by(health(monitored=["E11.1C"])) == Vouched(10, 20, {"E11.1C": 11})


@pytest.mark.parametrize("missing", [["covers_from_gps_ns"], ["covers_to_gps_ns"], ["covers_from_gps_ns", "covers_to_gps_ns"]])
def test_a_message_that_does_not_say_for_which_epochs_vouches_for_none(missing: list[str]) -> None:
    assert vouched_by(health(**dict.fromkeys(missing))) is None


def test_a_message_that_begins_with_the_beginning_of_gnss_time_does_say_so() -> None:
    assert vouched_by(health(covers_from_gps_ns=0, monitored=[])) == Vouched(0, 20, {})


def test_nothing_is_covered_at_first() -> None:
    assert (waiting().of(0, [A]), waiting().likely(0, [A])) == (None, None)


@pytest.mark.parametrize("gps_ns, expected", [(10, 0), (14, 0), (15, 1), (20, 1), (25, 1), (26, None)])
def test_of_several_messages_the_latest_counts(gps_ns: int, expected: int | None) -> None:
    messages = (vouched(10, 20, {"G05.1C": 5}), vouched(15, 25, {"G07.1C": 7}))
    coverage = waiting()
    for message in messages:
        coverage.vouch(A, message)
    assert coverage.of(gps_ns, [A]) == (None if expected is None else messages[expected].signals)


@pytest.mark.parametrize("gps_ns, signal", [(9, "G07.1C"), (15, "G05.1C"), (21, "G07.1C")])
def test_likely_is_what_covers_an_epoch_or_else_what_came_last(gps_ns: int, signal: str) -> None:
    coverage = waiting()
    coverage.vouch(A, vouched(10, 20, {"G05.1C": 5}))
    coverage.vouch(A, vouched(5, 9, {"G07.1C": 7}))
    assert list(coverage.likely(gps_ns, [A]) or ()) == [signal]


@pytest.mark.parametrize(
    "message, handed_back, still_waiting",
    [
        (vouched(10, 12), (10, 11, 12), (13,)),
        (vouched(11, 12), (11, 12), (13,)),  # 10 is older, and no later message covers it
        (vouched(12, 12), (12,), (13,)),
        (vouched(0, 9), (), (10, 11, 12, 13)),
        (vouched(13, 99), (13,), ()),
        (vouched(14, 99), (), ()),
        (vouched(12, 11), (), (12, 13)),
    ],
)
def test_what_a_message_gives_back_and_what_goes_on_waiting(
    message: Vouched, handed_back: tuple[int, ...], still_waiting: tuple[int, ...]
) -> None:
    coverage = waiting(10, 11, 12, 13)
    found = (coverage.vouch(A, message), coverage.vouch(A, vouched(0, ALL_NS)))
    assert found == (fixes(*handed_back), fixes(*still_waiting))


def test_nothing_is_given_back_twice() -> None:
    coverage = waiting(10, 11, 12)
    coverage.vouch(A, vouched(10, 11))
    assert coverage.vouch(A, vouched(10, 12)) == fixes(12)


def test_messages_one_epoch_each_give_back_every_epoch_once_and_in_order() -> None:
    coverage = waiting(*range(10, 20))
    assert [fix for gps_ns in range(10, 20) for fix in coverage.vouch(A, vouched(gps_ns - 3, gps_ns))] == fixes(*range(10, 20))


def test_after_forgetting_nothing_waits() -> None:
    coverage = waiting(10, 11)
    coverage.forget(A)
    assert coverage.vouch(A, vouched(0, 99)) == []


def test_after_forgetting_nothing_is_covered() -> None:
    coverage = waiting()
    coverage.vouch(A, vouched(10, 20))
    coverage.forget(A)
    assert (coverage.of(15, [A]), coverage.likely(15, [A]), coverage.vouched(A)) == (None, None, ())


def test_where_too_many_wait_the_oldest_goes() -> None:
    coverage = waiting(*range(MOST_WAITING + 1))
    assert coverage.vouch(A, vouched(0, ALL_NS)) == fixes(*range(1, MOST_WAITING + 1))


def test_a_bounded_number_waits_after_a_message_too() -> None:
    coverage = waiting(*range(MOST_WAITING))
    coverage.vouch(A, vouched(0, 1))
    for gps_ns in range(MOST_WAITING, 2 * MOST_WAITING):
        coverage.wait(gps_ns, [A], f"fix {gps_ns}")
    assert coverage.vouch(A, vouched(0, ALL_NS)) == fixes(*range(MOST_WAITING, 2 * MOST_WAITING))


def test_a_bounded_number_of_messages_is_remembered() -> None:
    coverage = waiting()
    for n in range(MOST_REMEMBERED + 1):
        coverage.vouch(A, vouched(10 * n, 10 * n + 9))
    assert (coverage.of(9, [A]), coverage.of(10, [A])) == (None, SIGNALS)


# Several stations


def said(**of_sites: dict[str, int]) -> Coverage[str]:
    """Each has vouched for these signals in epochs 10 to 20."""
    return Coverage({f"{site}-1": [vouched(10, 20, signals)] for site, signals in of_sites.items()})


def test_monitored_by_all_with_one_ephemeris_and_excluded_by_none() -> None:
    coverage = said(a={"G05.1C": 5, "G07.1C": 7, "E11.1C": 11, "E12.1C": 0}, b={"G05.1C": 5, "G07.1C": 8, "E12.1C": 0, "G09.1C": 9})
    assert coverage.of(15, [A, B]) == {"G05.1C": 5, "E12.1C": 0}


def test_a_signal_that_one_of_three_does_not_monitor_is_not_used() -> None:
    assert said(a=SIGNALS, b=SIGNALS, c={"G05.1C": 5}).of(15, [A, B, C]) == {"G05.1C": 5}


@pytest.mark.parametrize("sites", [(A, B), (B, A), (A, B, C), (C, B, A)])
def test_whose_word_is_asked_first_makes_no_difference(sites: tuple[str, ...]) -> None:
    coverage = said(a={"G05.1C": 5, "G07.1C": 7}, b={"G05.1C": 5, "E11.1C": 11}, c={"G05.1C": 5, "G07.1C": 7, "E11.1C": 11})
    assert coverage.of(15, sites) == {"G05.1C": 5}


def test_stations_that_agree_on_no_signal_cover_an_epoch_with_none() -> None:
    assert said(a={"G05.1C": 5}, b={"G05.1C": 6}).of(15, [A, B]) == {}


@pytest.mark.parametrize("sites", [(), (B,), (A, B), (B, A), ("unknown",), (A, "unknown")])
def test_what_one_of_them_does_not_cover_none_covers(sites: tuple[str, ...]) -> None:
    coverage = Coverage[str]({A: [vouched(10, 20)], B: [vouched(21, 30)]})
    assert coverage.of(15, sites) is None


@pytest.mark.parametrize("sites, expected", [((), None), ((A, B), {"G05.1C": 5}), ((A, C), None), ((A, "unknown"), None)])
def test_likely_is_what_all_of_them_will_say(sites: tuple[str, ...], expected: dict[str, int] | None) -> None:
    coverage = Coverage[str]({A: [vouched(10, 20)], B: [vouched(5, 9, {"G05.1C": 5, "E11.1C": 12})], C: ()})
    assert coverage.likely(15, sites) == expected


@pytest.mark.parametrize("order", [(A, B, C), (C, B, A), (B, A, C)])
def test_a_fix_is_given_back_to_the_last_of_those_that_it_waits_for(order: tuple[str, ...]) -> None:
    coverage = waiting(15, sites=(A, B, C))
    assert [coverage.vouch(site, vouched(10, 20)) for site in order] == [[], [], fixes(15)]


@pytest.mark.parametrize("first_ns", [10, 16])
def test_a_fix_does_not_wait_for_others_and_they_do_not_take_it_away(first_ns: int) -> None:
    coverage = waiting(15, sites=(A,))
    assert (coverage.vouch(B, vouched(first_ns, 20)), coverage.vouch(A, vouched(10, 20))) == ([], fixes(15))


def test_a_station_that_is_ahead_does_not_take_away_what_waits_for_another() -> None:
    """B has gone on to later epochs before A speaks."""
    coverage = waiting(15, sites=(A, B))
    found = [coverage.vouch(site, of) for site, of in [(B, vouched(10, 20)), (B, vouched(21, 30)), (A, vouched(10, 20))]]
    assert found == [[], [], fixes(15)]


def test_what_one_of_them_has_passed_over_is_never_given_back() -> None:
    coverage = waiting(15, sites=(A, B))
    said_in_turn = [(B, vouched(16, 20)), (A, vouched(10, 20)), (B, vouched(10, 20)), (A, vouched(10, 20))]
    assert [coverage.vouch(site, of) for site, of in said_in_turn] == [[]] * 4


def test_after_forgetting_one_station_only_what_waits_for_others_waits() -> None:
    coverage = waiting(10, 11, sites=(A, B))
    coverage.wait(12, [A], "fix 12")
    coverage.forget(B)
    coverage.vouch(B, vouched(0, 99))
    assert coverage.vouch(A, vouched(0, 99)) == fixes(12)


def test_after_forgetting_one_station_the_others_still_vouch() -> None:
    coverage = said(a=SIGNALS, b=SIGNALS)
    coverage.forget(B)
    assert (coverage.of(15, [A]), coverage.of(15, [A, B])) == (SIGNALS, None)


def test_a_bounded_number_waits_where_another_station_has_forgotten() -> None:
    coverage = waiting(*range(MOST_WAITING))
    coverage.forget(B)
    coverage.wait(MOST_WAITING, [A], f"fix {MOST_WAITING}")
    assert coverage.vouch(A, vouched(0, ALL_NS)) == fixes(*range(1, MOST_WAITING + 1))


def test_what_is_let_go_is_never_given_back() -> None:
    coverage = waiting(10, 11)
    coverage.let_go()
    assert coverage.vouch(A, vouched(0, 99)) == []
