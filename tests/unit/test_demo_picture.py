"""The demo's picture: what it says, and what it is made of. Station and train decide a short story for it, in one process."""

import math
import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import pytest

from integrity import SOFTWARE
from integrity.errors import RecordingError
from integrity.events import Event, RawBytes, Tick
from integrity.gnss.gps_time import NS_PER_S, parse_utc, utc_from_gps
from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import HEALTH, site_key
from integrity.messages.signatures import sign_health
from integrity.states import Cause
from recordings.channels import TRAIN_TOPICS
from recordings.reader import Contents, read_recording
from recordings.replay import Boot, decide_and_record
from recordings.site_file import SiteFile, load_site, override_site
from recordings.writer import RecordingWriter
from tests.unit.train import ride
from train_client.demo.picture import animated_svg, still_svg
from train_client.demo.picture_told import Told, told
from train_client.events import ChallengeSent, HealthReceived, TrainEvent
from train_client.localisation.localiser import TrainLocaliser
from train_client.messages import encode_event, encode_position, encode_started
from train_client.outputs import PositionReport
from train_client.simulate.line import sample_line
from train_client.simulate.motion import antennas_on, sample_run
from train_client.simulate.story import GROUND, Phase, tell
from train_client.track.track_map import format_map

START_NS = parse_utc("2026-03-02T03:05:00Z")
SETTINGS = ("site.epoch_interval_s=0.2", "integrity.recover_after_s=1.0", 'integrity.on_satellite_fault="exclude"')
PHASES = (
    Phase("start-up", 0.0, 1.0, "start", cause=Cause.NOT_READY),
    Phase("receiver fault", 6.0, 9.0, "receiver_bias", {"receiver": "B", "offset_enu_m": (12.0, -9.0, 0.0)}),
    Phase("satellite fault", 13.0, 16.0, "satellite_step", {"size_m": 30.0}),
    Phase("spoofing", 20.0, 23.0, "spoofing", {"receivers": GROUND}),
    Phase("jamming", 27.0, 30.0, "jamming", {"receivers": GROUND, "drop_db": 15.0}),
)
FORGED_S, FROZEN_S, THAWED_S, KILLED_S, END_S = 33.0, 37.0, 42.0, 45.0, 50.0
STEP_S = 0.2
SVG = "{http://www.w3.org/2000/svg}"
KEY_EXPR = site_key(ride.SITE, HEALTH)


def site() -> SiteFile:
    return override_site(load_site(ride.SAMPLES / "site.toml"), SETTINGS)


def story_s(mono_ns: int) -> float:
    return (mono_ns - START_NS) / NS_PER_S


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> tuple[Contents, Contents]:
    """Of a station and of a train."""
    folder = tmp_path_factory.mktemp("picture")
    train = antennas_on(sample_run(sample_line(), START_NS), ride.a_train().antennas)
    events = tell(site().config, train, START_NS, 1, PHASES, END_S).events
    ground = [e for e in events if story_s(e.mono_ns) < KILLED_S and not (isinstance(e, RawBytes) and e.receiver in ("front", "rear"))]
    boot = Boot(ride.BOOT, utc_from_gps(START_NS) - START_NS)
    decide_and_record(folder / "station.mcap", site(), ground, {}, boot=boot)
    station = read_recording(folder / "station.mcap")
    record_train(folder / "train.mcap", on_board(events, [e.message for e in station.entries if isinstance(e.message, pb.Health)]))
    return station, read_recording(folder / "train.mcap")


def on_board(events: tuple[Event, ...], health: list[pb.Health]) -> list[TrainEvent]:
    """What the antennas send, challenges and their answers, health while the station decides, and what an attacker adds."""
    measured: list[TrainEvent] = [e for e in events if isinstance(e, Tick) or (isinstance(e, RawBytes) and e.receiver in ("front", "rear"))]
    ground = ride.Ground()
    asked: list[TrainEvent] = []
    for second in range(int(KILLED_S)):
        challenge = ChallengeSent(START_NS + second * NS_PER_S + 1000, ride.SITE, second.to_bytes(16, "big"))
        asked += [challenge, *ground.answer(challenge)]
    heard = [said(h) for h in health if not FROZEN_S <= story_s(h.gps_time_ns) < THAWED_S]
    return sorted([*measured, *asked, *heard, *forged(health)], key=lambda event: event.mono_ns)


def said(health: pb.Health) -> HealthReceived:
    return HealthReceived(health.issued_mono_ns + 2 * ride.MS, KEY_EXPR, sign_health(ride.KEY, KEY_EXPR, health).SerializeToString())


def forged(health: list[pb.Health]) -> Iterator[HealthReceived]:
    """One with a flipped bit, one from the beginning once more."""
    at_ns = START_NS + round(FORGED_S * NS_PER_S) + 50 * ride.MS
    now = said(max((h for h in health if h.issued_mono_ns < at_ns), key=lambda h: h.sequence))
    yield HealthReceived(at_ns, KEY_EXPR, now.data[:40] + bytes([now.data[40] ^ 1]) + now.data[41:])
    yield HealthReceived(at_ns + 400 * ride.MS, KEY_EXPR, said(health[0]).data)


def record_train(path: Path, events: list[TrainEvent]) -> None:
    """What it heard and where it was; bytes of antennas are not looked at."""
    train = ride.a_train()
    localiser = TrainLocaliser(train, ride.MAP, {ride.SITE: [ride.KEY.public]})
    toml = (ride.SAMPLES / "train.toml").read_text()
    head = encode_started(train, toml, format_map(ride.MAP), {ride.SITE: (ride.KEY.public,)}, START_NS, START_NS)
    with RecordingWriter(path, SOFTWARE, START_NS, START_NS, {}, train.antenna_ids, TRAIN_TOPICS) as writer:
        writer.write(head, START_NS)
        for event in events:
            if isinstance(event, HealthReceived):
                writer.write(encode_event(event), event.mono_ns)
            for output in localiser.feed([event]):
                if isinstance(output, PositionReport):
                    writer.write(encode_position(output, train, ride.MAP), event.mono_ns)


@pytest.fixture(scope="module")
def story(recordings: tuple[Contents, Contents]) -> Told:
    return told(*recordings)


@pytest.fixture(scope="module")
def svg(recordings: tuple[Contents, Contents]) -> str:
    return animated_svg(*recordings)


def texts(element: ElementTree.Element) -> list[str]:
    return [text.text or "" for text in element.iter(f"{SVG}text")]


def seen(svg_text: str, layer: str) -> ElementTree.Element:
    """The frame of a layer that is in its window while nothing moves."""
    film = ElementTree.fromstring(svg_text).find(f".//{SVG}g[@id='{layer}']")
    assert film is not None
    shift = -float((film.get("transform") or "").removeprefix("translate(0 ").removesuffix(")"))
    (frame,) = [g for g in film if g.get("transform") == f"translate(0 {shift:g})"]
    return frame


def test_what_happened_is_named_in_order(story: Told) -> None:
    names = [re.sub(r"[GE]\d\d", "a satellite", episode.name) for episode in story.episodes]
    assert names == ["starting", "receiver B", "a satellite excluded", "spoofing", "jamming", "forged", "silent", "dead"]


def test_what_happened_has_its_time(story: Told) -> None:
    begins = [episode.from_s for episode in story.episodes]
    expected = [0.0, 6.0, 13.0, 20.0, 27.0, FORGED_S + STEP_S, FROZEN_S - STEP_S, KILLED_S - STEP_S]
    assert begins == pytest.approx(expected, abs=0.06)


def test_the_spells_of_station_and_train_leave_no_gap(story: Told) -> None:
    for spells in (story.station, story.train):
        assert [spell.to_s for spell in spells] == [*(spell.from_s for spell in spells[1:]), story.end_s]


def test_health_that_was_forged_or_replayed_is_not_the_stations(story: Told) -> None:
    sequences = [heard.health.sequence for heard in story.heard]
    assert sequences == sorted(set(sequences))


def test_the_numbers_of_what_happened_stand_in_the_picture(story: Told, svg: str) -> None:
    found = texts(ElementTree.fromstring(svg))
    missing = [episode.numbers for episode in story.episodes if episode.numbers and episode.numbers not in found]
    assert missing == []


def test_a_receiver_that_is_off_is_named_with_its_distance(recordings: tuple[Contents, Contents]) -> None:
    (label,) = texts(seen(still_svg(*recordings, 7.5), "triangle"))
    assert label == "B 15 m off"


def test_under_spoofing_all_go_to_one_point(recordings: tuple[Contents, Contents]) -> None:
    assert texts(seen(still_svg(*recordings, 21.5), "triangle")) == ["A, B, C at one point"]


@pytest.mark.parametrize(
    ("at_s", "station", "train", "place"),
    [
        (4.0, "NORMAL", "NORMAL", ["confirmed"]),
        (7.5, "NOT_CONFIRMABLE", "NOT_CONFIRMABLE", ["last confirmed"]),
        (15.0, "NORMAL", "NORMAL", ["confirmed"]),
        (21.5, "SATELLITE_ANOMALY", "SATELLITE_ANOMALY", ["last confirmed"]),
        (40.5, "SILENT", "STALE", ["last confirmed", "not confirmed"]),
        (49.5, "DEAD", "STALE", ["last confirmed", "not confirmed"]),
    ],
)
def test_each_moment_says_how_it_is(recordings: tuple[Contents, Contents], at_s: float, station: str, train: str, place: list[str]) -> None:
    still = still_svg(*recordings, at_s)
    assert (texts(seen(still, "station"))[0], texts(seen(still, "train"))[0], texts(seen(still, "line"))) == (station, train, place)


def test_without_animation_the_triangle_stands_inside_its_circles(story: Told, svg: str) -> None:
    circles = [c for c in ElementTree.fromstring(svg).findall(f"{SVG}circle") if float(c.get("r", "0")) > 8]
    centres = [(float(c.get("cx", "nan")), float(c.get("cy", "nan"))) for c in circles[:3]]
    triangle = seen(svg, "triangle")[0].get("d") or ""
    corners = [tuple(map(float, pair)) for pair in re.findall(r"([\d.]+) ([\d.]+)", triangle)]
    off = [math.dist(centre, corner) / float(c.get("r", "0")) for centre, corner, c in zip(centres, corners, circles[:3], strict=True)]
    assert max(off) < 0.5


def test_without_animation_the_train_is_confirmed(svg: str) -> None:
    assert texts(seen(svg, "train"))[0] == "NORMAL"


def test_every_layer_moves_through_the_whole_loop(svg: str) -> None:
    loops = {float(s) for s in re.findall(r"#\w+\{animation:\w+ ([\d.]+)s", svg)}
    assert [*loops] == [pytest.approx(END_S / 3.0 + 2.0, abs=0.2)]


def test_the_frame_at_which_the_loop_begins_is_the_one_that_stands(svg: str) -> None:
    """A film begins `begin` seconds into its loop; the key frame in force there has the film's own transform."""
    for name, loop, begin in re.findall(r"#(\w+)\{animation:\w+ ([\d.]+)s step-end -([\d.]+)s", svg):
        (keys,) = re.findall(rf"@keyframes {name}\{{(.*?)\}}\}}", svg)
        film = re.findall(rf'id="{name}" transform="translate\(0 (-?[\d.]+)\)"', svg)
        in_force = [
            where
            for at, where in re.findall(r"([\d.]+)%\{transform:translateY\((-?[\d.]+)px\)", keys)
            if float(at) <= 1e-3 + 100 * float(begin) / float(loop)
        ]
        assert in_force[-1:] == film


def test_whoever_wants_no_motion_sees_none(svg: str) -> None:
    assert "@media (prefers-reduced-motion:reduce){.film{animation:none!important}}" in svg


def test_the_same_recordings_give_the_same_bytes(recordings: tuple[Contents, Contents], svg: str) -> None:
    assert animated_svg(*recordings) == svg


def test_it_stands_alone(svg: str) -> None:
    """GitHub shows pictures without scripts and without anything from elsewhere."""
    for word in ("<script", "href", "url(", "@import", "<image", "<foreignObject", "@font-face", " on"):
        assert word not in re.sub(r"<(text|desc)[^>]*>[^<]*", "", svg)


def test_it_is_small(svg: str) -> None:
    assert len(svg.encode()) < 250_000


def test_recordings_of_two_demos_are_refused(recordings: tuple[Contents, Contents]) -> None:
    station, train = recordings
    silent = Contents(train.path, train.metadata, train.receivers, tuple(e for e in train.entries if e.topic != "/health_received"), "", 0)
    with pytest.raises(RecordingError, match="the two recordings of one demo"):
        animated_svg(station, silent)
