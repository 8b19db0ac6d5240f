"""The localiser on a simulated ride: what is VALID, and everything that must not be."""

from dataclasses import replace

import numpy as np
import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from integrity.errors import DecodeError
from integrity.events import RawBytes, Tick
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.signals import satellite_of
from integrity.gnss.ubx.framing import Framer, frame_bytes
from integrity.gnss.ubx.sfrbx import RXM_SFRBX
from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import HEALTH, site_key
from integrity.messages.signatures import sign_health, signing_key
from tests.unit.train.ride import (
    KEY,
    MAP,
    MS,
    SITE,
    START_NS,
    STEP_NS,
    Ground,
    Otherwise,
    a_run,
    a_train,
    errors_m,
    events,
    last_reasons,
    measured,
    positions,
    ride,
    valid,
)
from train_client.events import HealthReceived, TrainEvent
from train_client.localisation.localiser import TrainLocaliser
from train_client.outputs import MessageRefused, PositionReport, Status, TrainOutput, TrustChange
from train_client.snapshots import decode_snapshot, encode_snapshot
from train_client.track.track_map import Section
from train_client.trust import TrustState

EPOCHS = 40


def anomaly(number: int, plain: pb.Health) -> pb.Health:
    if 10 <= number < 15:
        plain.state, plain.cause = pb.SATELLITE_ANOMALY, pb.SPOOFING
        plain.ClearField("covers_from_gps_ns")
        plain.ClearField("covers_to_gps_ns")
    return plain


def numbers(reports: list[PositionReport]) -> set[int]:
    """Epochs."""
    return {(report.fix.gps_time_ns - START_NS) // STEP_NS for report in reports if report.fix}


def test_every_epoch_is_valid_from_the_third_normal_message_on() -> None:
    assert numbers(valid(ride(events(measured())))) == set(range(2, EPOCHS))


def test_the_front_end_is_where_it_was() -> None:
    errors = errors_m(valid(ride(events(measured()))), a_run())
    assert np.sqrt(np.mean(np.square(errors))) <= 0.5


def test_a_fix_is_confirmed_in_the_event_that_covers_it() -> None:
    at = {report.fix.gps_time_ns: report.mono_ns for report in valid(ride(events(measured()))) if report.fix}
    assert all(mono_ns == gps_ns for gps_ns, mono_ns in at.items())


def test_an_anomaly_ends_trust_in_its_epoch() -> None:
    changes = [output for output in ride(events(measured(), anomaly)) if isinstance(output, TrustChange)]
    assert (changes[-2].state, changes[-2].mono_ns) == (TrustState.SATELLITE_ANOMALY, START_NS + 10 * STEP_NS)


def test_nothing_is_valid_during_an_anomaly_nor_until_enough_messages_are_normal() -> None:
    assert set(range(EPOCHS)) - numbers(valid(ride(events(measured(), anomaly)))) == {0, 1, *range(10, 17)}


def test_a_position_during_an_anomaly_has_no_place() -> None:
    found = [r for r in positions(ride(events(measured(), anomaly))) if r.trust is TrustState.SATELLITE_ANOMALY]
    assert {r.status for r in found} == {Status.UNKNOWN}


def test_an_excluded_satellite_is_not_used_in_the_epoch_of_the_message() -> None:
    used = {satellite_of(s) for r in valid(ride(events(measured()))) if r.fix for s in r.fix.used}
    out = min(used)

    def say(number: int, plain: pb.Health) -> pb.Health:
        if number >= 10:
            plain.excluded_satellites.append(out)
        return plain

    late = [r.fix for r in valid(ride(events(measured(), say))) if r.fix and r.fix.gps_time_ns >= START_NS + 10 * STEP_NS]
    assert len(late) == EPOCHS - 10 and not any(out in {satellite_of(s) for s in fix.used} for fix in late)


def test_with_another_ephemeris_than_the_one_vouched_for_a_satellite_is_not_used() -> None:
    reports = valid(ride(events(measured(), ground=Otherwise())))
    assert reports and not any(signal.startswith("G07") for report in reports if report.fix for signal in report.fix.used)
    said = {why for report in reports if report.fix for signal, why in report.fix.unused if signal.startswith("G07")}
    assert said == {"another ephemeris than the one that the ground vouches for"}


def test_only_monitored_signals_are_used() -> None:
    def say(number: int, plain: pb.Health) -> pb.Health:
        monitored = [signal for signal in plain.monitored if signal.startswith("G")]
        del plain.monitored[:]
        plain.monitored.extend(monitored)
        return plain

    used = {s for r in valid(ride(events(measured(), say))) if r.fix for s in r.fix.used}
    assert used and all(signal.startswith("G") for signal in used)


@pytest.mark.parametrize("shift_ns", [-STEP_NS, STEP_NS])
def test_an_epoch_that_is_not_covered_is_never_valid(shift_ns: int) -> None:
    def say(number: int, plain: pb.Health) -> pb.Health:
        plain.covers_from_gps_ns = plain.covers_to_gps_ns = plain.gps_time_ns + shift_ns // 2
        return plain

    assert not valid(ride(events(measured(), say)))


def test_a_message_a_second_confirms_every_epoch_since_the_one_before() -> None:
    """The station is slower than the train: five fixes wait for each message."""

    def say(number: int, plain: pb.Health) -> pb.Health | None:
        plain.covers_from_gps_ns, plain.valid_for_ms = plain.gps_time_ns - 5 * STEP_NS + 1, 3000
        return plain if number % 5 == 0 else None

    assert numbers(valid(ride(events(measured(), say)))) == set(range(6, EPOCHS - 4))


def test_silence_of_the_ground_ends_trust_when_the_last_message_runs_out() -> None:
    outputs = ride(events(measured(), lambda number, plain: plain if number <= 20 else None))
    ends = [o.mono_ns for o in outputs if isinstance(o, TrustChange) and o.state is TrustState.STALE]
    assert ends and 0 <= ends[-1] - (START_NS + 20 * STEP_NS + 1000 * MS) <= STEP_NS


def test_after_the_end_of_validity_fixes_stay_provisional() -> None:
    outputs = ride(events(measured(), lambda number, plain: plain if number <= 20 else None))
    assert {r.status for r in positions(outputs) if r.fix and r.mono_ns > START_NS + 27 * STEP_NS} == {Status.PROVISIONAL}


def test_without_an_answered_challenge_nothing_is_ever_valid() -> None:
    outputs = ride(events(measured(), ground=Ground(answers=False)))
    assert not valid(outputs) and {r.trust for r in positions(outputs)} == {TrustState.NO_COMMS}


def test_health_of_another_site_is_refused_and_raises_nothing() -> None:
    outputs = ride(events(measured(), ground=Ground(site="elsewhere")))
    assert not valid(outputs) and any("wrong place" in o.refusal for o in outputs if isinstance(o, MessageRefused))


def test_health_signed_by_a_stranger_is_refused_and_raises_nothing() -> None:
    stranger = signing_key(Ed25519PrivateKey.from_private_bytes(bytes(range(1, 33))))
    assert not valid(ride(events(measured(), ground=Ground(key=stranger))))


def with_replays(of: list[TrainEvent], forged: bytes) -> list[TrainEvent]:
    """Each message three epochs later once more, and a forged one with it."""
    health = [event for event in of if isinstance(event, HealthReceived)]
    found: list[TrainEvent] = []
    for event in of:
        found.append(event)
        if isinstance(event, HealthReceived) and (k := health.index(event)) >= 3:
            found += [replace(health[k - 3], mono_ns=event.mono_ns), HealthReceived(event.mono_ns, event.key_expr, forged)]
    return found


def test_replayed_and_forged_messages_change_no_position() -> None:
    """The station has said SATELLITE_ANOMALY; replays of NORMAL and forged ones do not lift it."""

    def say(number: int, plain: pb.Health) -> pb.Health:
        if number >= 20:
            plain.state, plain.cause = pb.SATELLITE_ANOMALY, pb.JAMMING
        return plain

    honest = events(measured(), say)
    signed = sign_health(KEY, site_key("other", HEALTH), pb.Health(site=SITE, boot_id=b"boot of the ride", sequence=10**6, state=pb.NORMAL))
    attacked = ride(with_replays(honest, signed.SerializeToString()))
    assert [(r.status, r.fix and r.fix.front) for r in positions(attacked)] == [
        (r.status, r.fix and r.fix.front) for r in positions(ride(honest))
    ]


def test_replayed_and_forged_messages_are_counted() -> None:
    attacked = ride(with_replays(events(measured()), b"nonsense"))
    assert positions(attacked)[-1].stations[0].refused_messages == 2 * (EPOCHS - 4)  # those of the last epoch come after its position


def exchanged(of: list[TrainEvent]) -> list[TrainEvent]:
    other = {"front": "rear", "rear": "front"}
    return [replace(e, receiver=other[e.receiver]) if isinstance(e, RawBytes) else e for e in of]


def test_exchanged_antennas_are_refused_where_the_train_is_known_to_face_the_other_way() -> None:
    outputs = ride(exchanged(events(measured())), a_train(facing=1))
    assert not valid(outputs) and "exchanged" in last_reasons(outputs)


def test_exchanged_antennas_are_refused_after_twenty_metres_where_nobody_knows() -> None:
    outputs = ride(exchanged(events(measured())), a_train(facing=0))
    assert "rear first" in last_reasons(outputs)


def test_a_silent_antenna_leaves_no_position_and_is_named() -> None:
    def heard(event: TrainEvent) -> bool:
        return not (isinstance(event, RawBytes) and event.receiver == "rear" and event.mono_ns > START_NS + 3 * NS_PER_S)

    outputs = ride([event for event in events(measured()) if heard(event)])
    assert last_reasons(outputs) == "silent: rear"


def test_beyond_the_end_of_the_map_there_is_no_position() -> None:
    """The map ends at 2080 m of main-2; the train stands with its front antenna 30 m before that, on a map cut 60 m short."""
    whole = MAP
    last = whole.edges[-1]
    keep = last.s_m <= last.s_m[-1] - 60.0
    short = replace(
        whole,
        edges=(*whole.edges[:-1], replace(last, s_m=last.s_m[keep], pos_ecef_m=last.pos_ecef_m[keep], cant_rad=last.cant_rad[keep])),
        sections=(Section(last.id, 0.0, 1.0, station=SITE),),
    )
    outputs = ride(events(measured(4.0, 2970.0, 0.0)), track=short)
    assert not valid(outputs) and "end of the map" in last_reasons(outputs)


def test_a_clock_that_steps_back_ends_trust_at_once() -> None:
    def mono(gps_ns: int) -> int:
        return gps_ns - (5 * NS_PER_S if gps_ns >= START_NS + 4 * NS_PER_S else 0)

    changes = [o for o in ride(events(measured(), mono=mono)) if isinstance(o, TrustChange)]
    assert [o.reasons for o in changes if o.state is TrustState.NO_COMMS] == [("the train's clock stepped back by 4.800 s",)]


def test_a_clock_that_jumps_ahead_ends_trust_at_once() -> None:
    def mono(gps_ns: int) -> int:
        return gps_ns + (3600 * NS_PER_S if gps_ns >= START_NS + 4 * NS_PER_S else 0)

    changes = [o for o in ride(events(measured(), mono=mono)) if isinstance(o, TrustChange)]
    lost = [o for o in changes if o.state is TrustState.NO_COMMS]
    assert lost and lost[0].mono_ns == START_NS + 3604 * NS_PER_S


def test_a_satellite_whose_message_only_one_antenna_has_heard_is_not_used() -> None:
    """The rear antenna's navigation words are damaged from the beginning: their parity is wrong."""

    def deaf(event: TrainEvent) -> TrainEvent:
        if not (isinstance(event, RawBytes) and event.receiver == "rear"):
            return event
        frames = [f for f in Framer().feed(event.data) if (f.message_class, f.message_id) != RXM_SFRBX]
        return replace(event, data=b"".join(frame_bytes(*f) for f in frames))

    outputs = ride([deaf(event) for event in events(measured())])
    assert "too few satellites" in last_reasons(outputs)


def test_one_event_at_a_time_or_all_at_once_decides_the_same() -> None:
    stream = events(measured(), anomaly)
    single = TrainLocaliser(a_train(), MAP, {SITE: [KEY.public]})
    assert [output for event in stream for output in single.feed([event])] == ride(stream)


def test_looking_ahead_changes_nothing() -> None:
    """Not the last bit of a number, through start-up, an anomaly and a change of the satellites allowed."""
    stream = events(measured(), anomaly)
    ahead = TrainLocaliser(a_train(), MAP, {SITE: [KEY.public]})
    outputs = []
    for event in stream:
        outputs += ahead.feed([event])
        ahead.look_ahead()
    assert outputs == ride(stream)


def test_a_tick_at_the_deadline_is_what_ends_trust() -> None:
    localiser = TrainLocaliser(a_train(), MAP, {SITE: [KEY.public]})
    localiser.feed(events(measured())[: 12 * 5])
    assert localiser.trust is TrustState.NORMAL
    due_ns = localiser.next_deadline_ns
    assert due_ns is not None
    localiser.feed([Tick(due_ns - 1, due_ns, None)])
    before = localiser.trust
    localiser.feed([Tick(due_ns, due_ns, None)])
    assert (before, localiser.trust) == (TrustState.NORMAL, TrustState.STALE)


def from_snapshot(stream: list[TrainEvent], at: int) -> tuple[list[TrainOutput], list[TrainOutput]]:
    """What one localiser decides from an event on, and what another one does that begins there with the snapshot, through its message."""
    first = TrainLocaliser(a_train(), MAP, {SITE: [KEY.public]})
    first.feed(stream[:at])
    message = encode_snapshot(first.snapshot(), a_train(), MAP, 0).SerializeToString()
    second = TrainLocaliser(a_train(), MAP, {SITE: [KEY.public]}, decode_snapshot(pb.TrainSnapshot.FromString(message), MAP))
    return first.feed(stream[at:]), second.feed(stream[at:])


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3, 0.33, 0.5, 0.9])
def test_another_localiser_goes_on_from_a_snapshot_as_this_one_does(share: float) -> None:
    """Through start-up, an anomaly, and with fixes that wait."""
    stream = events(measured(), anomaly)
    one, other = from_snapshot(stream, round(share * len(stream)))
    assert one == other


def test_a_snapshot_of_another_map_is_refused() -> None:
    localiser = TrainLocaliser(a_train(), MAP, {SITE: [KEY.public]})
    localiser.feed(events(measured())[:100])
    message = encode_snapshot(localiser.snapshot(), a_train(), MAP, 0)
    renamed = replace(MAP, edges=tuple(replace(edge, id=f"{edge.id}-new") for edge in MAP.edges), sections=())
    with pytest.raises(DecodeError, match="is not on map"):
        decode_snapshot(message, renamed)
