"""What receivers were told of satellites is judged by the last sets alone: in whatever order they came, whoever asks, and made again at
any time. And one receiver that is told whatever one likes changes nothing of what two others make the station use.
"""

from collections.abc import Sequence
from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.monitors.told import dispute
from integrity.reception.told import ToldSets
from recordings.faults.orbits import displaced
from tests.rinex_examples import EVERY_KIND

MOST_CHANGE = 5.5
RECEIVERS = "ABC"
OF_SATELLITES = (EVERY_KIND["GPS"], EVERY_KIND["Galileo I/NAV"], EVERY_KIND["GLONASS"])

Telling = tuple[str, Ephemeris]


@st.composite
def sets(draw: st.DrawFn, of: Sequence[Ephemeris] = OF_SATELLITES) -> Ephemeris:
    """One of a few of each satellite: true or displaced, of this issue or the next, sent sooner or later, healthy or not."""
    true = draw(st.sampled_from(of))
    off = displaced(true, draw(st.sampled_from([0.001, 300.0, -300.0, 5000.0])), "along", true.toe_ns)
    return replace(
        draw(st.sampled_from([true, off])),
        issue=draw(st.sampled_from([true.issue, true.issue + 1])),
        transmission_ns=true.toe_ns + draw(st.sampled_from([-900, 0, 30, 600])) * NS_PER_S,
        toe_ns=true.toe_ns + draw(st.sampled_from([0, 0, 0, 600])) * NS_PER_S,
        healthy=draw(st.sampled_from([True, True, True, False])),
    )


tellings = st.lists(st.tuples(st.sampled_from(RECEIVERS), sets()), max_size=12)


def after(told: Sequence[Telling], before: Sequence[Telling] = ()) -> tuple[ToldSets, list[list[Telling]]]:
    """What is remembered, and what each telling let serve."""
    memory = ToldSets(before, MOST_CHANGE)
    return memory, [memory.tell(receiver, eph) for receiver, eph in told]


def last_told(told: Sequence[Telling]) -> list[Telling]:
    """As receivers remember it: the last one of each satellite."""
    return [(receiver, eph) for (receiver, _), eph in {(receiver, eph.satellite): eph for receiver, eph in told}.items()]


@settings(deadline=None)
@given(tellings, st.data())
def test_the_order_in_which_receivers_are_told_is_no_matter(told: list[Telling], data: st.DataObject) -> None:
    rest = {receiver: [telling for telling in told if telling[0] == receiver] for receiver in RECEIVERS}
    other = [rest[receiver].pop(0) for receiver in data.draw(st.permutations([receiver for receiver, _ in told]))]
    assert after(other)[0].disputes == after(told)[0].disputes


@settings(deadline=None)
@given(tellings, st.integers(0, 12))
def test_made_again_from_the_last_sets_it_goes_on_as_if_never_stopped(told: list[Telling], at: int) -> None:
    whole, served = after(told)
    again, served_again = after(told[at:], last_told(told[:at]))
    assert (again.disputes, served_again) == (whole.disputes, served[at:])


@settings(deadline=None)
@given(st.lists(sets(OF_SATELLITES[:1]), min_size=3, max_size=3), st.permutations(RECEIVERS))
def test_other_names_change_nothing_but_names(told: list[Ephemeris], names: list[str]) -> None:
    found = dispute(dict(zip(RECEIVERS, told, strict=True)), MOST_CHANGE)
    renamed = dispute(dict(zip(names, told, strict=True)), MOST_CHANGE)
    name_of: dict[str | None, str | None] = {None: None} | dict(zip(RECEIVERS, names, strict=True))
    assert (found and (name_of[found.odd], found.from_ns, found.until_ns, found.size_m)) == (
        renamed and (renamed.odd, renamed.from_ns, renamed.until_ns, renamed.size_m)
    )


@settings(deadline=None)
@given(st.lists(st.tuples(st.just("C"), sets()).filter(lambda telling: telling[1].healthy), max_size=8))
def test_whatever_one_is_told_only_what_agrees_with_two_others_serves(told: list[Telling]) -> None:
    sound = [(receiver, true) for receiver in "AB" for true in OF_SATELLITES]
    for receiver, eph in (telling for served in after([*sound, *told])[1][len(sound) :] for telling in served):
        true = next(of for of in OF_SATELLITES if of.satellite == eph.satellite)
        assert receiver == "C" and dispute({"A": true, "C": eph}, MOST_CHANGE) is None
