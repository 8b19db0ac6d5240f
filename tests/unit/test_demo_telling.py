"""How the demo tells what the station says: numbers of what is new, names of what is known."""

from integrity.messages import wayside_pb2 as pb
from integrity.states import Cause, State
from train_client.demo.records import HealthSeen
from train_client.demo.telling import station_words

OUT = {"G14": ("step", 3755.0, 6.966), "G07": ("residual", 26.07, 5.55)}


def words(state: State, cause: Cause, excluded: tuple[str, ...], known: tuple[str, ...], reported: bool = True) -> str:
    report = pb.EpochReport()
    for satellite in excluded:
        check, statistic, threshold = OUT[satellite]
        report.exclusions.add(satellite=satellite, check=check, statistic=statistic, threshold=threshold)
    return station_words(HealthSeen(0, 0, 1, state, cause, (), excluded), report if reported else None, known)


def test_who_is_excluded_now_is_told_with_its_numbers() -> None:
    assert words(State.NORMAL, Cause.NONE, ("G14",), ()).split(maxsplit=1) == ["NORMAL", "G14 excluded: step 3755 > 6.966"]


def test_who_is_out_already_is_named() -> None:
    assert words(State.NORMAL, Cause.NONE, ("G14",), ("G14",)).split(maxsplit=1) == ["NORMAL", "without G14"]


def test_one_more_is_told_beside_the_one_that_is_out() -> None:
    assert words(State.NORMAL, Cause.NONE, ("G07", "G14"), ("G14",)).endswith("  G07 excluded: residual 26.07 > 5.55; without G14")


def test_something_else_is_told_first() -> None:
    said = words(State.SATELLITE_ANOMALY, Cause.JAMMING, ("G14",), ("G14",))
    assert said == "SATELLITE_ANOMALY  jamming: signals sink at two or more receivers; without G14"


def test_without_a_report_who_is_out_is_named() -> None:
    assert words(State.NORMAL, Cause.NONE, ("G14",), (), reported=False).endswith("  without G14")


def test_where_nobody_is_out_the_state_says_all() -> None:
    assert words(State.NORMAL, Cause.NONE, (), ("G14",)) == "NORMAL"
