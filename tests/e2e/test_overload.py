"""A station that cannot keep up says so, and vouches for nothing meanwhile."""

import os
import threading
from pathlib import Path

from integrity import SOFTWARE
from integrity.events import RawBytes
from integrity.messages import wayside_pb2 as pb
from integrity.station_monitor import StationMonitor
from recordings.keys import load_key
from recordings.link import open_link
from recordings.reader import read_recording
from recordings.recorder import Recorder
from recordings.replay import decide, replayable
from recordings.sources.inbox import Inbox
from station.publisher import Publisher
from station.recording import manner_of
from station.runtime import Station
from tests.e2e.field import make_field, measured
from tests.unit.streams import health

NOBODY = {name: f"tcp://127.0.0.1:{port}" for port, name in enumerate("ABC", start=9)}


def test_what_the_inbox_drops_lowers_health_and_is_recorded(tmp_path: Path) -> None:
    field = make_field(tmp_path, NOBODY)
    lines: list[str] = []
    inbox, boot_id = Inbox[RawBytes](most_pieces=3), os.urandom(16)
    field.records.mkdir()
    with open_link([field.endpoint], []) as link:
        publisher = Publisher(link, field.site.config, load_key(tmp_path / "keys" / "field.pem"), boot_id, SOFTWARE)
        recorder = Recorder(field.records, manner_of(field.site, boot_id), lines.append)
        station = Station(field.site, StationMonitor(field.site.config), inbox, publisher, recorder, boot_id, lines.append)
        for event in measured(field.site, 2.0):
            if isinstance(event, RawBytes):
                inbox.put(event.receiver, 0, event.data)  # nobody takes: the second epoch does not fit
        threading.Timer(2.5, station.stop, args=(15,)).start()
        station.run(lambda: True)
        recorder.close()
    (path,) = field.recordings()
    contents = read_recording(path)
    lost = [entry.message for entry in contents.entries if isinstance(entry.message, pb.InputLost)]
    assert sorted((m.receiver, m.chunks) for m in lost) == [("A", 1), ("B", 1), ("C", 1)]
    assert sum("pieces of its bytes were lost" in line for line in lines) == 3
    todo = replayable(contents)
    again = health(decide(todo.site, todo.events, todo.snapshot)[0])
    assert any("bytes of A were lost" in reason for h in again for reason in h.reasons)
