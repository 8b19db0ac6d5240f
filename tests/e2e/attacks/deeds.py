"""What is done to the path, to the station, and besides it. Each deed is a `with`: it begins, lasts, and ends, and all is as it was."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from integrity.gnss.gps_time import NS_PER_S
from integrity.messages.key_expressions import HEALTH, site_key
from integrity.messages.verification import NONCE_BYTES
from recordings.link import dial_link
from tests.e2e.attacks import forged
from tests.e2e.attacks.certificates_scene import certificates_of
from tests.e2e.attacks.certified import OTHER_SITE, SITE, of, speaking
from tests.e2e.attacks.ride import Deed, Ride
from tests.e2e.attacks.tactics import first_answer, played_back, tactic, withheld
from tests.e2e.field import until

GARBAGE = 100_000
MANY = 20  # messages
PATIENCE_S = 20.0
SPEAK_EVERY_S = 0.1
SITE_HEALTH = site_key(SITE, HEALTH)


# ---- the path


@contextmanager
def cut(ride: Ride) -> Iterator[None]:
    ride.wire.cut()
    yield
    ride.wire.mend()


@contextmanager
def slowed(ride: Ride) -> Iterator[None]:
    ride.wire.delay_s = 0.2
    yield


@contextmanager
def bits_flipped(ride: Ride) -> Iterator[None]:
    """In every third piece that comes down the wire."""
    ride.wire.flip_every = 3
    yield
    ride.wire.flip_every = 0


@contextmanager
def stalled(ride: Ride) -> Iterator[None]:
    """A genuine message as fast as it goes, never dropped for want of room, down a wire that stands still: so Zenoh corrupts some."""
    ended, genuine = threading.Event(), ride.relay.heard[-1]

    def flow() -> None:
        while not ended.is_set():
            ride.relay.put(genuine, wait=True)

    flowing = threading.Thread(target=flow, daemon=True)
    with tactic(withheld)(ride):
        ride.wire.stall()
        flowing.start()
        yield
        ended.set()
        flowing.join(PATIENCE_S)
        ride.wire.mend()


@contextmanager
def flooded(ride: Ride) -> Iterator[None]:
    for data in forged.garbage(GARBAGE, ride.relay.heard[-1]):
        ride.relay.put(data, wait=True)
    yield


@contextmanager
def flooded_in_its_place(ride: Ride) -> Iterator[None]:
    """And the station is withheld."""
    with tactic(withheld)(ride), flooded(ride):
        yield


# ---- the station


@contextmanager
def stopped(ride: Ride) -> Iterator[None]:
    ride.scene.send(signal.SIGSTOP)
    yield
    ride.scene.send(signal.SIGCONT)


@contextmanager
def killed(ride: Ride) -> Iterator[None]:
    """And begun anew."""
    ride.scene.kill()
    yield
    ride.scene.begin()


@contextmanager
def played_back_after_a_boot(ride: Ride) -> Iterator[None]:
    """The station begins anew, and the train trusts it; then it is withheld, and what the boot before said comes instead."""
    old = list(ride.relay.heard)
    ride.scene.begin_anew()
    ride.train.until(lambda said: not said.trusts, PATIENCE_S)
    ride.train.until(lambda said: said.trusts, PATIENCE_S)
    ride.begin()
    with tactic(played_back(old))(ride):
        yield


@contextmanager
def played_back_from_the_start(ride: Ride) -> Iterator[None]:
    """To a train that knows nothing yet: what an older boot said, and answered."""
    relay = ride.relay
    if not ride.scene.heard:
        until(lambda: len(relay.heard) > MANY, PATIENCE_S)
        relay.ask(bytes(NONCE_BYTES), lambda _: None)
        until(lambda: bool(relay.answers), PATIENCE_S)
        ride.scene.heard = list(relay.heard)
        ride.scene.begin_anew()
    with tactic(played_back(ride.scene.heard), first_answer)(ride):
        yield


@contextmanager
def decisions_frozen(ride: Ride) -> Iterator[None]:
    ride.scene.manager.stop_reading()
    yield
    ride.scene.manager.read()


# ---- with certificates, behind a router


@contextmanager
def nothing(ride: Ride) -> Iterator[None]:
    """The way says it all."""
    yield


@contextmanager
def guest_speaks(ride: Ride) -> Iterator[None]:
    with dial_link([ride.scene.place.endpoint], lambda: None, of(certificates_of(ride.scene), "guest")) as guest:
        put = guest.urgent(SITE_HEALTH, "x")
        with again_and_again(lambda: put(b"forged")):
            yield


@contextmanager
def other_site_speaks(ride: Ride) -> Iterator[None]:
    """Whose certificate lets it speak at its own key."""
    with (
        speaking(certificates_of(ride.scene), OTHER_SITE, [], [ride.scene.place.endpoint], honest=False) as other,
        again_and_again(lambda: other.put(SITE_HEALTH, "forged")),
    ):
        yield


@contextmanager
def again_and_again(do: Callable[[], None]) -> Iterator[None]:
    ended = threading.Event()

    def run() -> None:
        while not ended.wait(SPEAK_EVERY_S):
            do()

    thread = threading.Thread(target=run)
    thread.start()
    yield
    ended.set()
    thread.join()


# ---- time


def until_after(gps_ns: int) -> Deed:
    """Nothing but that this moment passes."""

    @contextmanager
    def deed(ride: Ride) -> Iterator[None]:
        assert max(said.gps_time_ns or 0 for said in ride.train.said) < gps_ns - NS_PER_S, "too late: has it passed before there was trust?"
        passed = ride.train.until(lambda said: said.gps_time_ns is not None and said.gps_time_ns > gps_ns + 3 * NS_PER_S, PATIENCE_S)
        assert passed is not None
        yield

    return deed
