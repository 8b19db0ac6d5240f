"""The story played, told and judged: everything of the demo that is imported and computed while its processes start."""

import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import takewhile
from socket import create_connection

from integrity.events import Event
from integrity.gnss.gps_time import NS_PER_S, parse_utc
from integrity.limits import derive
from integrity.triangle import reference_triangle
from recordings.keys import keys_of, load_key, read_trusted
from recordings.link import Link, dial_link
from recordings.simulate.server import ReceiverServer
from recordings.site_file import SiteFile, load_site
from recordings.sources.host_clock import mono_now_ns
from train_client.demo.acts import Acts
from train_client.demo.attacks import Attacker
from train_client.demo.row import Row
from train_client.demo.screen import Screen
from train_client.demo.stage import KEYS, SITE, TRAIN, DemoFailed, Folder, Stage
from train_client.demo.table import Contract, judge
from train_client.demo.telling import Teller
from train_client.demo.truth import Truth, truth_from
from train_client.demo.view import Scene, scene_of
from train_client.demo.watch import Watch
from train_client.demo.wish import Wish
from train_client.simulate.motion import antennas_on
from train_client.simulate.story import END_S, TIMELINE, Phase, Story, alone, tell
from train_client.train_file import TrainFile, load_train

LOOK_EVERY_S = 0.05
CHALLENGE_EVERY_S = 1.0
READY_WITHIN_S = 60.0
AFTER_THE_LAST_S = 0.3  # what was sent last is decided and heard
START_NS = parse_utc("2026-03-02T03:05:00Z")  # not at a full hour, when a station begins a new file
SEED = 1


@dataclass(frozen=True)
class Show:
    """What is played, and who watches."""

    site: SiteFile
    train: TrainFile
    story: Story
    truth: Truth
    watch: Watch
    duration_s: float
    contract: Contract
    radius_m: float


def prepare(wish: Wish, folder: Folder) -> Show:
    """Compute the story, while the processes start."""
    site, train, truth = load_site(folder.at(SITE)), load_train(folder.at(TRAIN)), truth_from(START_NS)
    contract = Contract(
        interval_s=site.config.epoch_interval_ns / NS_PER_S,
        recover_after_s=site.config.integrity.recover_after_s,
        recover_messages=train.config.trust.recover_messages,
        valid_for_s=min(site.publish.valid_for_ms, train.config.max_valid_ms) / 1000.0,
    )
    phases, duration_s = _chosen(wish, contract)
    story = tell(site.config, antennas_on(truth.run, train.config.antennas), START_NS, SEED, phases, duration_s)
    trusted = folder.at(KEYS)
    watch = Watch(folder.site_id, keys_of(read_trusted(trusted), folder.site_id, trusted), truth.error_m, wish.began_ns, START_NS)
    return Show(site, train, story, truth, watch, duration_s, contract, derive(site.config, reference_triangle(site.config)).radius_m)


def _chosen(wish: Wish, contract: Contract) -> tuple[Sequence[Phase], float]:
    """Phases and how long the story is; of one kind alone, until trust must be back."""
    phases: Sequence[Phase] = TIMELINE
    duration_s = END_S
    if wish.kind is not None:
        phases = alone(wish.kind)
        last = phases[-1]
        duration_s = last.end_s + (0.0 if last.kind == TIMELINE[-1].kind else contract.back_within_s + 0.5)
    return phases, duration_s if wish.seconds is None else min(wish.seconds, duration_s)


def play(show: Show, server: ReceiverServer, stage: Stage, folder: Folder, screen: Screen) -> list[Row]:
    """Play the story to the end; the rows of its phases."""
    _until_ready(stage)
    with dial_link([folder.endpoint], lambda: None) as link, dial_link([folder.endpoint], lambda: None) as another:
        show.watch.listen(link)
        show.watch.read_positions(stage.positions)
        attacker = Attacker(another, folder.site_id, load_key(folder.at(show.site.publish.key)))
        acts = Acts(show.story.phases, stage, attacker, show.watch)
        with _playing(server, show.story.events, show.watch):
            _go_through(show, stage, acts, link, screen)
    return judge(show.story.phases, show.watch.records(acts.deeds), show.contract, show.duration_s)


def _until_ready(stage: Stage) -> None:
    deadline_s = time.monotonic() + READY_WITHIN_S
    while not stage.station_ready:
        stage.check()
        if time.monotonic() > deadline_s:
            raise DemoFailed(f"the station is not ready after {READY_WITHIN_S:g} s: is this machine very busy?")
        time.sleep(0.01)


@contextmanager
def _playing(server: ReceiverServer, events: Iterable[Event], watch: Watch) -> Iterator[None]:
    """In a thread: wait until all receivers have a client, then play, until the events or this block end."""
    ended = threading.Event()

    def play() -> None:
        server.wait_for_clients()
        server.play(takewhile(lambda _: not ended.is_set(), events), sent=watch.sent)

    player = threading.Thread(target=play, name="player", daemon=True)
    player.start()
    try:
        yield
    finally:
        ended.set()
        for address in server.addresses.values():
            with suppress(OSError):
                create_connection(address, 1.0).close()  # it may still wait for somebody
        player.join()


def _go_through(show: Show, stage: Stage, acts: Acts, link: Link, screen: Screen) -> None:
    """From the first epoch to the last."""
    watch, teller = show.watch, Teller(show.watch)
    deadline_s, challenge_s = time.monotonic() + READY_WITHIN_S, 0.0
    while (story_s := watch.story_s(mono_now_ns())) < show.duration_s + AFTER_THE_LAST_S:
        stage.check()
        if watch.first_sent_ns is None and time.monotonic() > deadline_s:
            raise DemoFailed(f"station or train has not called the receivers within {READY_WITHIN_S:g} s: is this machine very busy?")
        for line in [*acts.perform(story_s), *teller.lines(mono_now_ns())]:
            screen.say(str(line))
        if time.monotonic() >= challenge_s:
            challenge_s = time.monotonic() + CHALLENGE_EVERY_S
            watch.challenge(link)
        screen.show(lambda: _scene(show))
        time.sleep(LOOK_EVERY_S)


def _scene(show: Show) -> Scene | None:
    """What there is to see now; None before the first epoch."""
    watch = show.watch
    report = watch.reports.get(max(watch.reports, default=0))
    if report is None or not watch.health or not watch.positions:
        return None
    return scene_of(watch.health[-1], report, watch.messages[-1], watch.positions[-1].error_m, show.truth, show.radius_m)
