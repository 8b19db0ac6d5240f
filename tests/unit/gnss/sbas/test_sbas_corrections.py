"""What SBAS makes of satellites: who is accepted and why others are not, and the sum of sigmas, each with numbers worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest

from integrity.gnss.sbas.airborne import NoiseModel
from integrity.gnss.sbas.corrections import Reason, rows_of
from integrity.gnss.sbas.degradation import Terms, epsilon_ltc_m
from integrity.gnss.sbas.messages import SbasMessage
from integrity.gnss.sbas.store import NPA, PA
from tests.unit.gnss.sbas import sent
from tests.unit.gnss.sbas.sent import T0_NS, at
from tests.unit.gnss.sbas.service import HOUR_NS, START_S, corrected, fast_round, gps, number, reasons, service

A, T_LAT_S = 0.0046, 1.0  # factor 14
UDRE, GIVE = 0.4678, 0.0749  # UDREI 4, GIVEI 2


def service_without(kind: int) -> list[SbasMessage]:
    return [message for message in service() if message.kind != kind]


def test_with_everything_each_satellite_in_view_is_used() -> None:
    assert reasons(corrected(service())) == {Reason.USED}


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        (1, Reason.NO_MASK),
        (2, Reason.NO_FAST),
        (7, Reason.NO_FACTOR),
        (10, Reason.NO_DEGRADATION),
        (18, Reason.NO_IONO_MASK),
        (25, Reason.NO_LONG_TERM),
        (26, Reason.NO_IONO_MASK),
    ],
)
def test_in_pa_every_kind_of_message_is_needed(kind: int, reason: Reason) -> None:
    assert reason in reasons(corrected(service_without(kind)))


@pytest.mark.parametrize("kind", [7, 10, 18, 25, 26])
def test_in_npa_a_mask_and_what_udre_there_is_suffice(kind: int) -> None:
    assert reasons(corrected(service_without(kind), mode=NPA)) == {Reason.USED}


@pytest.mark.parametrize(("mode", "alive", "dead"), [(PA, 12.0, 13.0), (NPA, 18.0, 19.0)])
def test_a_udre_times_out(mode: int, alive: float, dead: float) -> None:
    """The last round of fast corrections is sent 2, 1 and 0 s before, and is received 1.1 s later. Others keep the link alive."""
    more = [(float(k), 63 << 212 | 0x53 << 218) for k in range(1, 20)]
    c = corrected(service(*more), (alive - 1.0, dead + 1.2), mode)
    late = Reason.UDREI_TIMED_OUT if mode == PA else Reason.USED
    assert (reasons(c, 0), reasons(c, 1)) == ({Reason.USED}, {late})


@pytest.mark.parametrize(("udrei", "pa", "npa"), [(11, 0, 0), (12, 13, 0), (13, 13, 0), (14, 11, 11), (15, 12, 12)])
def test_udre_indicators_decide_who_may_be_used(udrei: int, pa: int, npa: int) -> None:
    messages = service() + fast_round(START_S + 4, 2, udrei)
    assert [reasons(corrected(messages, (8.0,), mode)) for mode in (PA, NPA)] == [{Reason(pa)}, {Reason(npa)}]


def test_after_do_not_use_two_corrections_are_needed_again() -> None:
    messages = service() + fast_round(START_S + 4, 2, 15) + fast_round(START_S + 10, 0)
    assert reasons(corrected(messages, (13.0,))) == {Reason.ONE_FAST}


def test_type_0_rules_out_the_whole_system() -> None:
    assert reasons(corrected(service((1.0, sent.fast([1], [1], kind=0))), (3.0,))) == {Reason.TEST_MODE}


@pytest.mark.parametrize(("second", "reason"), [(5.0, Reason.USED), (5.1, Reason.MESSAGES_MISSED)])
def test_four_messages_missed_are_too_many(second: float, reason: Reason) -> None:
    assert reasons(corrected(service(), (second,))) == {reason}


def test_an_ephemeris_that_is_not_here_rules_out_its_satellite() -> None:
    """The long-term corrections name an issue; another set of the same satellite does not do."""
    others = [replace(e, issue=e.issue ^ 1) for e in gps()]
    assert reasons(corrected(service(), ephemerides=others)) == {Reason.NO_SUCH_EPHEMERIS}


def test_the_corrections_before_serve_while_a_new_ephemeris_is_not_here() -> None:
    new = [(1.0 + k, sent.still(k, 255, dx_m=9.0)) for k in range(1, 33)]
    messages = service(*new) + fast_round(START_S + 34, 2) + fast_round(START_S + 40, 0)
    c = corrected(messages, (43.0,))
    assert (reasons(c), set(c.d_pos_ecef_m[0][c.used])) == ({Reason.USED}, {1.0})


def test_a_satellite_that_calls_itself_unhealthy_is_not_used() -> None:
    assert reasons(corrected(service(), ephemerides=[replace(e, healthy=False) for e in gps()])) == {Reason.UNHEALTHY}


def test_of_two_sets_of_a_satellite_the_one_named_serves() -> None:
    moved = [replace(e, issue=200, m0=e.m0 + 1e-3, transmission_ns=e.transmission_ns + HOUR_NS // 4) for e in gps()]
    assert np.array_equal(corrected(service(), ephemerides=[*gps(), *moved]).el_rad, corrected(service()).el_rad)


def test_sigma_flt_adds_the_squares_of_its_terms() -> None:
    """2 s after the last type 4, 3 s after type 3, 4 s after type 2: a (t - t_u + t_lat)^2 / 2, factor in sequence, no other term."""
    c = corrected(service())
    expected = {k: UDRE + (A * (4.0 - k + T_LAT_S) ** 2 / 2.0) ** 2 for k in range(3)}
    found = {(number(s) - 1) // 13: c.flt_variance_m2[0, i] for i, s in enumerate(c.satellites) if c.used[0, i]}
    assert found == pytest.approx({k: expected[k] for k in found})


def test_sigma_flt_can_add_the_terms_themselves() -> None:
    c = corrected(service((1.0, sent.degradation(RSS_UDRE=0, C_ltc_v0=0.0))))
    expected = {k: (UDRE**0.5 + A * (4.0 - k + T_LAT_S) ** 2 / 2.0) ** 2 for k in range(3)}
    found = {(number(s) - 1) // 13: c.flt_variance_m2[0, i] for i, s in enumerate(c.satellites) if c.used[0, i]}
    assert found == pytest.approx({k: expected[k] for k in found})


def test_a_lost_fast_correction_costs_what_its_rate_may_be_wrong() -> None:
    """IODF out of sequence: (a I_fc / 4 + B_rrc / dt) (t - t_of), I_fc 12 s, dt 6 s. A.4.5.1.2."""
    messages = [m for m in service() if m.kind not in (2, 3, 4)] + fast_round(START_S - 8, 0) + fast_round(START_S - 2, 2)
    c = corrected(sorted(messages, key=lambda m: m.sent_ns))
    k = next(i for i, s in enumerate(c.satellites) if c.used[0, i] and number(s) <= 13)
    epsilon_rrc = (A * 12.0 / 4.0 + 0.054 / 6.0) * 4.0
    assert c.flt_variance_m2[0, k] == pytest.approx(UDRE + (A * 5.0**2 / 2.0) ** 2 + epsilon_rrc**2)


def test_a_fast_correction_moves_with_its_rate() -> None:
    more = [at(START_S + s, sent.fast([v] * 13, [4] * 13, iodf=iodf)) for s, v, iodf in ((1, 8, 2), (7, 20, 0))]
    messages = service_without(2) + more
    c = corrected(messages, (9.0,), NPA)
    k = next(i for i, s in enumerate(c.satellites) if c.used[0, i] and number(s) <= 13)
    assert c.range_m[0, k] == pytest.approx(2.5 + 1.5 / 6.0 * 2.0)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({10}, (UDRE**0.5 + 8.0) ** 2),  # without degradation parameters: J.2.2
        ({25}, 3600.0),  # without long-term or fast corrections
        ({7}, 3600.0),
    ],
)
def test_in_npa_sigma_flt_tells_what_is_missing(change: set[int], expected: float) -> None:
    c = corrected([m for m in service() if m.kind not in change], mode=NPA)
    assert np.unique(c.flt_variance_m2[c.used]) == pytest.approx([expected])


def test_in_npa_corrections_too_old_for_pa_cost_c_er() -> None:
    """Fast corrections are 13 s old and UDREs in time for NPA: factor 14 has time-outs of 12 and 18 s. 31.5 m squared is added."""
    more = [(float(k), 63 << 212 | 0x53 << 218) for k in range(1, 20)]
    c = corrected(service(*more), (12.0, 14.5), NPA)
    k = next(i for i, s in enumerate(c.satellites) if c.used[0, i] and 13 < number(s) <= 26)
    epsilon_fc = [(A * (t + 1.0 + T_LAT_S) ** 2 / 2.0) ** 2 for t in (12.0, 14.5)]
    assert c.flt_variance_m2[:, k] - epsilon_fc == pytest.approx([UDRE, UDRE + 31.5**2])


def test_ionosphere_of_the_grid_is_slanted() -> None:
    c = corrected(service())
    ratio = 6_378_136.3 / 6_728_136.3 * np.cos(c.el_rad[c.used])
    assert np.allclose(c.iono_m[c.used], 2.5 / np.sqrt(1.0 - ratio**2))


def test_in_npa_without_a_grid_the_climate_gives_sigma() -> None:
    """Without broadcast coefficients the model has 5 ns, a fifth of which is less than F_pp 4.5 m."""
    c = corrected(service_without(18), mode=NPA)
    ratio = 6_378_136.3 / 6_728_136.3 * np.cos(c.el_rad[c.used])
    assert set(np.round(np.sqrt(c.uire_variance_m2[c.used] * (1.0 - ratio**2)), 6)) <= {4.5, 9.0}


def test_type_27_multiplies_the_udre_by_place() -> None:
    """Indicator 4 inside of Japan, 2.0; 15 outside."""
    c = corrected(service((0.5, sent.service(4, 15, [(20, 120, 50, 150, 1)]))))
    terms = (A * (2.0 + T_LAT_S) ** 2 / 2.0) ** 2
    k = next(i for i, s in enumerate(c.satellites) if c.used[0, i] and number(s) > 26)
    assert c.flt_variance_m2[0, k] == pytest.approx(4.0 * UDRE + terms)


def test_a_set_of_type_27_that_is_not_complete_is_not_enough_for_pa() -> None:
    assert reasons(corrected(service((0.5, sent.service(4, 15, [], messages_less_1=1))))) == {Reason.NO_DELTA_UDRE}


def test_type_28_multiplies_by_direction_and_has_to_be_here_for_each_satellite() -> None:
    """R with 3 in its last place and scale 2^-3: a quarter of E44 (3 / 8) whatever the direction, and C_covariance 12.7 / 8."""
    before = corrected(service())
    k = int(np.nonzero(before.used[0])[0][0])
    c = corrected(service((0.5, sent.covariance(number(before.satellites[k]), 2, E44=3))))
    udre = c.flt_variance_m2[0, k] - before.flt_variance_m2[0, k] + UDRE
    assert (udre, reasons(c)) == (pytest.approx(UDRE * (3.0 / 8.0 + 12.7 / 8.0) ** 2), {Reason.USED, Reason.NO_DELTA_UDRE})


def test_a_rail_model_replaces_that_of_aviation() -> None:
    rail = NoiseModel(noise_m=1.0, multipath_floor_m=2.0, multipath_rise_m=0.0, divergence_m=2.0)
    assert np.unique(corrected(service(), noise=rail).air_variance_m2) == pytest.approx([9.0])


@pytest.mark.parametrize("satellite", ["R05", "S37", "E11", "G38"])
def test_other_satellites_than_gps_are_refused(satellite: str) -> None:
    with pytest.raises(ValueError, match="GPS only"):
        rows_of(["G01", satellite])


def test_epochs_are_judged_alone_or_together_alike() -> None:
    """To the bit: a stream may be cut anywhere."""
    seconds = (0.0, 1.0, 2.5, 11.0, 14.0)
    together = corrected(service(), seconds)
    alone = [corrected(service(), (s,)) for s in seconds]
    assert all(np.array_equal(together.sigma_m[k], one.sigma_m[0], equal_nan=True) for k, one in enumerate(alone))


@pytest.mark.parametrize(("since_t0_s", "expected"), [(-16.0, 0.004 + 0.0025 * 16.0), (0.5, 0.0), (119.5, 0.0), (136.0, 0.004 + 0.04)])
def test_long_term_corrections_with_rates_hold_for_an_interval(since_t0_s: float, expected: float) -> None:
    """A.4.5.1.3.1: C_ltc_lsb 4 mm and C_ltc_v1 2.5 mm/s beyond I_ltc_v1 120 s after t0, or before it."""
    assert _epsilon_ltc(1, since_t0_s=since_t0_s) == pytest.approx(expected)


@pytest.mark.parametrize(("age_s", "expected"), [(59.9, 0.0), (60.0, 0.05), (179.9, 0.1)])
def test_long_term_corrections_without_rates_degrade_in_steps(age_s: float, expected: float) -> None:
    """A.4.5.1.3.2: C_ltc_v0 0.05 m each I_ltc_v0 60 s."""
    assert _epsilon_ltc(0, age_s=age_s) == pytest.approx(expected)


def _epsilon_ltc(velocity_code: int, since_t0_s: float = 0.0, age_s: float = 0.0) -> float:
    terms = Terms(np.array(True), *(np.array(sent.DEGRADATION[name]) for name in Terms._fields[1:]))
    t0_ns, sent_ns = (np.array(T0_NS - round(seconds * 1e9)) for seconds in (since_t0_s, age_s))
    return float(epsilon_ltc_m(np.array(velocity_code), np.array(T0_NS), t0_ns, sent_ns, terms))
