"""What other programs find in a recording: positions on a map, and messages that they decode by the file alone."""

from pathlib import Path

import numpy as np
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass
from mcap.reader import make_reader

from integrity.gnss.frames import ecef_from_geodetic
from integrity.gnss.gps_time import utc_from_gps
from integrity.messages import wayside_pb2 as pb
from integrity.messages.fixes import location_fixes
from integrity.messages.location_fix_pb2 import LocationFix
from recordings.reader import Contents
from tests.unit.recording.written import SECONDS, data
from tests.unit.streams import TRIANGLE

# Positions


def test_a_fix_is_the_surveyed_point_and_what_was_solved_beside_it(contents: Contents) -> None:
    """By the other way: the fix back to ECEF, its offset from the surveyed point along the axes there, is what the report says."""
    reports = [e.message for e in contents.entries if isinstance(e.message, pb.EpochReport)]
    fixes = {(f.timestamp.ToNanoseconds(), f.frame_id): f for e in contents.entries if isinstance(f := e.message, LocationFix)}
    assert len(fixes) == 3 * SECONDS
    for report in reports:
        for r, vertex in enumerate(report.triangle):
            fix = fixes[utc_from_gps(report.gps_time_ns), f"kokubunji-1/{vertex.receiver}"]
            pos_ecef_m = ecef_from_geodetic(np.radians(fix.latitude), np.radians(fix.longitude), fix.altitude)
            e_enu_m = TRIANGLE.enu[r] @ (pos_ecef_m - TRIANGLE.pos_ecef_m[r])
            np.testing.assert_allclose(e_enu_m, (vertex.east_m, vertex.north_m, vertex.up_m), atol=1e-6)  # 1e-8 m: pymap3d and back


def test_a_receiver_without_a_position_has_no_fix(contents: Contents) -> None:
    report = pb.EpochReport()
    report.CopyFrom(next(e.message for e in contents.entries if isinstance(e.message, pb.EpochReport)))
    for name in ("east_m", "north_m", "up_m"):
        report.triangle[1].ClearField(name)
    (fixes,) = location_fixes([report], TRIANGLE, "x")
    assert [fix.frame_id for fix in fixes] == ["x/A", "x/C"]


def test_fixes_stand_in_the_channels_of_their_receivers(contents: Contents) -> None:
    ids = {(e.topic, e.message.frame_id) for e in contents.entries if isinstance(e.message, LocationFix)}
    assert ids == {(f"/receiver/{r}/fix", f"kokubunji-1/{r}") for r in "ABC"}


# Self-describing: another reader needs nothing of ours


def test_the_reader_of_the_mcap_library_finds_our_messages_sound(whole: Path, contents: Contents) -> None:
    with whole.open("rb") as file:
        found = [(channel.topic, message.log_time) for _, channel, message in make_reader(file, validate_crcs=True).iter_messages()]
    assert sorted(found) == sorted((e.topic, e.log_ns) for e in contents.entries)


def test_the_statistics_count_every_message(whole: Path, contents: Contents) -> None:
    with whole.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary.statistics.message_count == len(contents.entries)


def decoded_by_their_own_schema(path: Path) -> list[Message]:
    """Messages by the file alone: the descriptor of each is built from the schema that it carries."""
    found: list[Message] = []
    classes: dict[int, type[Message]] = {}
    with path.open("rb") as file:
        for schema, _, message in make_reader(file, validate_crcs=True).iter_messages(log_time_order=False):
            if schema.id not in classes:
                pool = DescriptorPool()
                for description in FileDescriptorSet.FromString(schema.data).file:
                    pool.AddSerializedFile(description.SerializeToString())
                classes[schema.id] = GetMessageClass(pool.FindMessageTypeByName(schema.name))
            found.append(classes[schema.id].FromString(message.data))
    return found


def test_messages_are_decoded_from_the_embedded_schema_alone(whole: Path, contents: Contents) -> None:
    assert [data(m) for m in decoded_by_their_own_schema(whole)] == [e.data for e in contents.entries]


def test_no_field_is_unknown_to_the_embedded_schema(whole: Path, contents: Contents) -> None:
    named = [[field.name for field, _ in m.ListFields()] for m in decoded_by_their_own_schema(whole)]
    ours = [e.message for e in contents.entries if isinstance(e.message, Message)]
    assert named == [[field.name for field, _ in message.ListFields()] for message in ours]
