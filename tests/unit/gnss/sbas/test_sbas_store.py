"""What is kept of the messages: fast corrections and IODF, alarms, masks that change, what comes before its mask, test mode."""

import math
from typing import Any

import pytest

from integrity.gnss.sbas.grid import NEVER
from integrity.gnss.sbas.store import NPA, PA, ROW_OF, SbasStore
from tests.unit.gnss.sbas import sent
from tests.unit.gnss.sbas.sent import PRN, T0_NS, at

FIRST, SECOND = ROW_OF["G01"], ROW_OF["G05"]
S = 1_000_000_000


def store_with(*messages: tuple[float, int]) -> SbasStore:
    """A store that has heard a mask of G01 and G05 and then these."""
    store = SbasStore(PRN)
    for second, bits in ((0.0, sent.mask([1, 5])), *messages):
        store.add(at(second, bits))
    return store


def row(store: SbasStore, satellite: int = FIRST) -> Any:
    return store.at(T0_NS, [satellite]).rows[0]


def test_places_are_those_of_the_mask() -> None:
    known = store_with((1, sent.fast([8, 16], [3, 4])))
    assert (row(known)["prc_m"], row(known, SECOND)["prc_m"], row(known, SECOND)["udrei"]) == (1.0, 2.0, 4)


def test_a_rate_comes_from_the_last_two_corrections() -> None:
    known = row(store_with((1, sent.fast([8], [3])), (7, sent.fast([10], [3], iodf=1)), (14, sent.fast([11], [3], iodf=2))))
    assert (known["previous_m"][PA], known["dt_s"][PA], known["in_sequence"], known["n_fast"]) == (1.25, 7.0, True, 3)


def test_a_lost_correction_is_seen_by_its_iodf() -> None:
    known = row(store_with((1, sent.fast([8], [3])), (13, sent.fast([10], [3], iodf=2))))
    assert not known["in_sequence"]


def test_in_an_alarm_the_rate_spans_half_a_time_out() -> None:
    """Factor 13: 18 s for PA and 27 s for NPA; of corrections 6, 12 and 18 s old, those of 6 (as near to 9 s as 12) and of 12 s."""
    corrections = [(float(k), sent.fast([k], [3], iodf=3 if k == 19 else k // 6 % 3)) for k in (1, 7, 13, 19)]
    known = row(store_with((0.5, sent.factors(13)), *corrections))
    assert (known["alarm"], known["dt_s"][PA], known["dt_s"][NPA]) == (True, 12.0, 12.0)


def test_a_new_factor_chooses_the_pair_of_an_alarm_anew() -> None:
    corrections = [(float(k), sent.fast([k], [3], iodf=3 if k == 19 else k // 6 % 3)) for k in (1, 7, 13, 19)]
    known = row(store_with((0.5, sent.factors(14)), *corrections, (20, sent.factors(10))))
    assert (known["dt_s"][PA], known["dt_s"][NPA]) == (18.0, 18.0)


@pytest.mark.parametrize("udrei", [14, 15])
def test_what_is_not_to_be_used_begins_anew(udrei: int) -> None:
    known = row(store_with((1, sent.fast([8], [3])), (7, sent.fast([8], [udrei], iodf=1)), (13, sent.fast([8], [3], iodf=2))))
    assert (known["n_fast"], math.isnan(known["dt_s"][PA])) == (1, True)


def test_type_6_counts_with_the_iodf_of_the_corrections() -> None:
    known = row(store_with((1, sent.fast([8], [3], iodf=1)), (5, sent.integrity([9], (1, 0, 0, 0)))))
    assert (known["udrei"], known["udre_ns"], known["u_ns"]) == (9, T0_NS + 5 * S, T0_NS + 5 * S)


def test_type_6_of_other_corrections_changes_nothing() -> None:
    known = row(store_with((1, sent.fast([8], [3], iodf=1)), (5, sent.integrity([9], (2, 1, 1, 1)))))
    assert (known["udrei"], known["udre_ns"]) == (3, T0_NS + 1 * S)


def test_type_6_in_an_alarm_counts_always_but_confirms_no_correction() -> None:
    known = row(store_with((1, sent.fast([8], [3], iodf=1)), (5, sent.integrity([12], (3, 3, 3, 3)))))
    assert (known["udrei"], known["udre_ns"], known["u_ns"]) == (12, T0_NS + 5 * S, T0_NS + 1 * S)


def test_type_6_that_forbids_a_satellite_ends_its_series() -> None:
    known = row(store_with((1, sent.fast([8], [3])), (7, sent.fast([8], [3], iodf=1)), (9, sent.integrity([15], (3, 3, 3, 3)))))
    assert (known["udrei"], known["n_fast"]) == (15, 0)


def test_type_24_begins_at_its_block() -> None:
    store = SbasStore(PRN)
    store.add(at(0, sent.mask(range(1, 21))))
    store.add(at(1, sent.mixed([80, 0, 0, 0, 0, 0], [7] * 6, block=1, iodf=0, half=0)))
    assert row(store, ROW_OF["G14"])["prc_m"] == 10.0


def test_the_correction_before_is_kept_while_the_issue_is_new() -> None:
    known = row(store_with((1, sent.still(1, 20, dx_m=1.0)), (9, sent.still(1, 20, dx_m=2.0)), (19, sent.still(1, 21, dx_m=3.0))))
    assert (known["iod"].tolist(), known["d_pos"][:, 0].tolist()) == ([21, 20], [3.0, 2.0])


def test_what_comes_before_its_mask_waits_for_it() -> None:
    store = SbasStore(PRN)
    for second, bits in (
        (0, sent.still(1, 20, dx_m=1.0)),
        (1, sent.fast([8], [3])),
        (2, sent.covariance(1, 5, E11=2)),
        (3, sent.mask([1])),
    ):
        store.add(at(second, bits))
    known = row(store)
    assert (known["lt_ns"][0], known["of_ns"], known["cov_ns"]) == (T0_NS, T0_NS + S, T0_NS + 2 * S)


def test_messages_under_the_old_mask_still_serve() -> None:
    """G05 moves from the second place to the first: each message goes by its own mask."""
    store = store_with((1, sent.mask([5, 9], iodp=1)), (2, sent.fast([8, 16], [3, 3], iodp=0)), (3, sent.fast([24, 32], [3, 3], iodp=1)))
    assert [row(store, ROW_OF[s])["prc_m"] for s in ("G01", "G05", "G09")] == [1.0, 3.0, 4.0]


def test_the_mask_before_the_last_two_is_forgotten() -> None:
    masks = [(1.0, sent.mask([5], iodp=1)), (2.0, sent.mask([9], iodp=2)), (3.0, sent.fast([8, 16], [3, 3], iodp=0))]
    assert row(store_with(*masks))["of_ns"] == NEVER


def test_type_0_forgets_everything_and_blocks_for_a_minute() -> None:
    store = store_with((1, sent.fast([8], [3])), (2, sent.degradation()), (3, sent.fast([8], [3], kind=0)))
    head = store.at(T0_NS, []).head
    assert (row(store)["of_ns"], head.degradation, head.blocked_until_ns) == (NEVER, None, T0_NS + 64_100_000_000)


@pytest.mark.parametrize(("second", "kept"), [(5.0, True), (6.0, False)])
def test_four_messages_missed_in_a_row_take_the_udres_along(second: float, kept: bool) -> None:
    """After one sent at 1 s, one at 5 s leaves three out, one at 6 s four: an alarm may have been among them."""
    known = row(store_with((1, sent.fast([8], [3])), (second, sent.degradation())))
    assert bool(known["udre_ns"] != NEVER) is kept


def test_a_message_that_was_here_before_is_refused() -> None:
    store = store_with((1, sent.fast([8], [3])))
    store.add(at(1, sent.fast([80], [3])))
    assert (row(store)["prc_m"], store.refused.total()) == (1.0, 1)


def test_messages_of_another_satellite_are_refused() -> None:
    store = store_with()
    store.add(at(1, sent.fast([80], [3]), prn=129))
    assert row(store)["of_ns"] == NEVER


def test_what_a_message_must_not_say_is_counted() -> None:
    store = store_with((1, sent.mask(range(1, 53))))
    assert store.refused == {"type 1 with more than 51 satellites": 1}


def test_the_shortest_time_out_is_that_of_the_satellites_in_the_mask() -> None:
    head = store_with((1, sent.factors(14))).at(T0_NS, []).head
    assert head.I_fc_s == (12.0, 18.0)
