"""The demo from beginning to end: stage set, story played and told, recordings decided again.

The processes are started as early as can be: they import what they need, a second's work, while this one does so and computes the story.
"""

import tempfile
from collections.abc import Sequence
from pathlib import Path

from integrity.errors import ConfigError
from recordings.simulate.server import ReceiverServer
from train_client.demo.row import Row
from train_client.demo.screen import Screen
from train_client.demo.stage import SETTINGS, Folder, Stage, make_folder
from train_client.demo.summary import Summary
from train_client.demo.wish import Wish

RECEIVERS = ("A", "B", "C", "front", "rear")


def run_demo(wish: Wish, screen: Screen) -> Summary:
    """Run it. ConfigError for an unknown kind, DemoFailed where a process ended that should not."""
    _check_kind(wish.kind)
    with ReceiverServer(RECEIVERS, "127.0.0.1", 0) as server:
        folder = make_folder(Path(tempfile.mkdtemp(prefix="wayside-demo-")), SETTINGS, server.addresses)
        with Stage(folder) as stage:
            screen.say(f"Everything of this demo lies in {folder.path}")
            screen.say(f"Zenoh listens at {folder.endpoint}; in that folder `wayside listen {folder.site_id}` verifies health itself\n")
            from train_client.demo.play import play, prepare  # only now: see above

            show = prepare(wish, folder)
            rows = play(show, server, stage, folder, screen)
    screen.say("\nBoth recordings are decided again ...")
    return _with_recordings(wish, folder, show.duration_s, rows)


def _check_kind(kind: str | None) -> None:
    if kind is None:
        return
    from train_client.simulate.story import TIMELINE

    kinds = [phase.kind for phase in TIMELINE[1:]]
    if kind not in kinds:
        raise ConfigError(f"--fault {kind}: expected one of {', '.join(kinds)}")


def _with_recordings(wish: Wish, folder: Folder, duration_s: float, rows: Sequence[Row]) -> Summary:
    """Both are decided again."""
    from train_client.demo.again import saved, station_row, train_row

    of_station, of_train = ([saved(path) for path in folder.recordings(directory)] for directory in folder.directories)
    again = (station_row(of_station), train_row(of_train))
    return Summary(folder.path, folder.endpoint, wish.began_ns, duration_s, (*rows, *again), tuple(of_station), tuple(of_train))
