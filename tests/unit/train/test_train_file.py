"""A train file: everything that is wrong with it at once, each with line and remedy; and never anything but a ConfigError."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.errors import ConfigError
from integrity.messages import wayside_pb2 as pb
from recordings.toml_file import ConfigProblems, dotted, format_value
from train_client.config import AntennaConfig, TrainConfig
from train_client.recording import manner_of
from train_client.stop import StopLimits
from train_client.train_file import load_train, parse_train
from train_client.trust import TrustLimits

# As printed in the description of the interface
EXAMPLE = """\
[train]
id = "r291"
length_m = 40.0
[[antenna]]
id = "front"
source = "tcp://10.0.0.11:2000"
x_m = -3.0                       # from the front end, backwards negative
y_m = 0.0                        # right of the track centre
height_m = 3.9                   # above railhead
receiver = "rx1"
model = "ZED-F9P"
clock = "own"                    # or a group name shared by synchronised receivers
oscillator = 1e-6
[trust]
stations = ["kokubunji-1"]
public_keys = "keys/trusted.toml"
recover_messages = 10
max_valid_ms = 3000
[publish]
connect = ["tcp/10.0.0.1:7447"]
"""
SECOND = """[[antenna]]
id = "rear"
x_m = -21.15
height_m = 3.9
"""


def problems(text: str) -> list[str]:
    with pytest.raises(ConfigProblems) as caught:
        parse_train(text, "train.toml")
    return str(caught.value).splitlines()


def changed(old: str, new: str) -> str:
    assert EXAMPLE.count(old) == 1
    return EXAMPLE.replace(old, new)


def sha256(text: str) -> str:
    return parse_train(text, "train.toml").config.config_sha256


def test_the_example_decides_as_it_says() -> None:
    config = parse_train(EXAMPLE, "train.toml").config
    assert replace(config, config_sha256="") == TrainConfig(
        train_id="r291",
        length_m=40.0,
        antennas=(AntennaConfig("front", -3.0, 0.0, 3.9),),
        epoch_interval_ns=1_000_000_000,
        facing=0,
        most_speed_mps=100.0,
        sigma_range_m=1.0,
        sigma_range_low_m=0.5,
        sigma_range_pair_m=3.0,
        sigma_range_pair_low_m=1.5,
        stations=("kokubunji-1",),
        max_valid_ms=3000,
        trust=TrustLimits(recover_messages=10, no_comms_after_ns=2_000_000_000),
        stop=StopLimits(after_ns=3_000_000_000, latches=True),
        config_sha256="",
    )


def test_sigmas_of_pairs_left_out_follow_those_of_single_signals() -> None:
    config = parse_train(changed("40.0", "40.0\nsigma_range_m = 0.8\nsigma_range_pair_low_m = 0.7"), "train.toml").config
    assert (config.sigma_range_pair_m, config.sigma_range_pair_low_m) == pytest.approx((2.4, 0.7))


def test_paths_count_from_where_the_file_lies(tmp_path: Path) -> None:
    (tmp_path / "train.toml").write_text(changed('id = "r291"', 'id = "r291"\nmap = "maps/line.json"'))
    train = load_train(tmp_path / "train.toml")
    folders = (tmp_path / "maps/line.json", tmp_path / "keys/trusted.toml", tmp_path / "train-recordings")
    assert (train.map_path, train.keys_path, train.directory) == folders


def test_the_rest_is_as_written() -> None:
    train = parse_train(EXAMPLE + SECOND, "train.toml")
    expected = ({"front": "tcp://10.0.0.11:2000", "rear": None}, {("tcp/10.0.0.1:7447",): ("kokubunji-1",)}, None)
    assert (train.sources, train.connect, train.map_path) == expected


@pytest.mark.parametrize("word, facing", [("increasing", 1), ("decreasing", -1), ("either", 0)])
def test_facing(word: str, facing: int) -> None:
    assert parse_train(changed("length_m = 40.0", f'length_m = 40.0\nfacing = "{word}"'), "t").config.facing == facing


WRONG = {  # a change, and the one problem that it makes
    "no id": ('id = "r291"\n', "", "train.toml:1: train.id: missing: add id, a name of letters"),
    "id with a slash": ('"r291"', '"r/291"', 'train.toml:2: train.id = "r/291": expected a name of letters'),
    "no length": ("length_m = 40.0\n", "", "train.toml:1: train.length_m: missing: add length_m, metres, above 0 and at most 2000"),
    "length 0": ("40.0", "0.0", "train.toml:3: train.length_m = 0.0: expected metres, above 0"),
    "length of NaN": ("40.0", "nan", "train.toml:3: train.length_m = nan: expected metres, above 0"),
    "length in quotes": ("40.0", '"40"', 'train.toml:3: train.length_m = "40": expected metres, above 0'),
    "misspelt key": ("length_m = 40.0", "length_m = 40.0\nfaceing = 1", 'train.faceing = 1: no such key; did you mean "facing"?'),
    "unknown facing": ("40.0", '40.0\nfacing = "up"', 'train.facing = "up": expected "increasing" or "decreasing" or "either"'),
    "fast": ("40.0", "40.0\nmax_speed_mps = 300", "train.toml:4: train.max_speed_mps = 300: expected metres per second, above"),
    "hasty": ("40.0", "40.0\nepoch_interval_s = 0.01", "train.toml:4: train.epoch_interval_s = 0.01: expected seconds, from 0.05 to 10"),
    "sigma 0": ("40.0", "40.0\nsigma_range_m = 0.0", "train.toml:4: train.sigma_range_m = 0.0: expected a standard deviation in metres"),
    "x in mm": ("-3.0", "-3000.0", "train.toml:7: antenna.0.x_m = -3000.0: expected metres, from -1000 to 1000"),
    "under the rail": ("3.9", "-3.9", "train.toml:9: antenna.0.height_m = -3.9: expected metres above railhead, from 0 to 10"),
    "bad source": ("tcp://10.0.0.11:2000", "tcp:10.0.0.11", 'train.toml:6: antenna.0.source = "tcp:10.0.0.11": expected tcp://host:port'),
    "ppm": ("1e-6", "1.0", "train.toml:13: antenna.0.oscillator = 1.0: expected a relative frequency, above 0 and at most 0.001"),
    "one table": ("[[antenna]]", "[antenna]", "train.toml:4: antenna: expected one table [[antenna]] or more, each with id, source, x_m"),
    "misspelt table": ("[publish]", "[publsh]", 'train.toml:19: publsh: no such key; did you mean "publish"?'),
    "a site's table": ("[publish]", "[receivers]", "train.toml:19: receivers: no such key: expected one of train, antenna, trust, publish"),
    "one station twice": ('"kokubunji-1"', '"k-1", "k-1"', 'train.toml:15: trust.stations = ["k-1", "k-1"]: a station stands there twice'),
    "no station": ('"kokubunji-1"', "", "train.toml:15: trust.stations = []: expected one station or more: without"),
    "a station alone": ('["kokubunji-1"]', '"k-1"', 'train.toml:15: trust.stations = "k-1": expected a list of site ids, such as'),
    "no proof": ("= 10\n", "= 0\n", "train.toml:17: trust.recover_messages = 0: expected a whole number from 1 to 100000"),
    "half a message": ("= 10\n", "= 2.5\n", "train.toml:17: trust.recover_messages = 2.5: expected a whole number from 1 to 100000"),
    "valid for ever": ("3000", "3600000", "train.toml:18: trust.max_valid_ms = 3600000: expected whole milliseconds, from 100 to 60000"),
    "never stops": ("3000", "3000\nstop_after_s = 1e9", "train.toml:19: trust.stop_after_s = 1000000000.0: expected seconds, from 0"),
    "releases itself": ("3000", '3000\nrelease = "driver"', 'trust.release = "driver": expected "operator" or "automatic"'),
    "a strange station": ("[publish]", '[[station]]\nid = "k-9"\nconnect = ["tcp/h:1"]\n[publish]', "not among the stations of [trust]"),
    "a station nowhere": ("[publish]", '[[station]]\nid = "kokubunji-1"\n[publish]', "station.0.connect: missing: add connect"),
    "a station as a table": ("[publish]", '[station]\nid = "kokubunji-1"\n[publish]', "station: expected tables [[station]], each with id"),
    "patience": ("3000", "3000\nno_comms_after_s = 1e9", "train.toml:19: trust.no_comms_after_s = 1000000000.0: expected seconds, from 0"),
    "bad endpoint": ("tcp/10.0.0.1:7447", "10.0.0.1", 'train.toml:20: publish.connect = ["10.0.0.1"]: expected a list of Zenoh endpoints'),
    "a train as a list": ("[train]", "[[train]]", "train.toml:1: train = [{id = "),
    "no antenna": (EXAMPLE[EXAMPLE.index("[[a") : EXAMPLE.index("[trust]")], "", "antenna: expected one table [[antenna]] or more"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_said_with_line_and_remedy(name: str) -> None:
    old, new, expected = WRONG[name]
    found = problems(changed(old, new))
    assert [line for line in found if expected in line] == found != []


def test_everything_wrong_is_said_at_once() -> None:
    text = (
        changed('id = "r291"', 'id = ""').replace("3.9", "39").replace("= 10\n", "= 0\n").replace("[publish]\nconnect", "[publish]\nconect")
    )
    text += SECOND.replace("-21.15", "true") + "[record]\nfolder = 1\n[page]\n"
    lines = [line.split(": ")[0] for line in problems(text)]
    assert lines == [f"train.toml:{n}" for n in (2, 9, 17, 20, 23, 26, 27)]


TWICE = {
    "one name": ('"rear"', '"front"', "2 antennas are called 'front': give each a name of its own"),
    "one place": ("-21.15", "-3.0", "two antennas at one x_m: the distance between them would tell nothing"),
}


@pytest.mark.parametrize("name", TWICE)
def test_antennas_that_are_one(name: str) -> None:
    old, new, expected = TWICE[name]
    (found,) = problems(EXAMPLE + SECOND.replace(old, new))
    assert found.endswith(expected)


def test_a_password_is_not_repeated() -> None:
    assert "secret" not in "".join(problems(changed("tcp://10.0.0.11:2000", "ntrip://me:secret@host")))


@pytest.mark.parametrize("scheme", ["ntrip", "ntrips"])
def test_no_password_is_in_a_recording(scheme: str) -> None:
    text = changed("tcp://10.0.0.11:2000", f"{scheme}://me:secret@host:2101/M")
    head = manner_of(parse_train(text, "train.toml").config, text, "{}", {}).head(0, 0)
    assert isinstance(head, pb.TrainStarted) and "secret" not in head.train_toml
    recorded, read = parse_train(head.train_toml, "recorded"), parse_train(text, "train.toml")
    assert (recorded.config, recorded.sources["front"]) == (read.config, f"{scheme}://me:***@host:2101/M")


DECISIVE = {
    "protocol": ("height_m = 3.9", 'height_m = 3.9\nprotocol = "rtcm3"'),
    "source that sends another protocol": ("tcp://10.0.0.11:2000", "ntrip://host:2101/M"),
    "id": ('"r291"', '"r292"'),
    "length_m": ("40.0", "41.0"),
    "facing": ("40.0", '40.0\nfacing = "increasing"'),
    "epoch_interval_s": ("40.0", "40.0\nepoch_interval_s = 0.1"),
    "max_speed_mps": ("40.0", "40.0\nmax_speed_mps = 99.0"),
    "sigma_range_m": ("40.0", "40.0\nsigma_range_m = 1.1"),
    "sigma_range_low_m": ("40.0", "40.0\nsigma_range_low_m = 0.6"),
    "sigma_range_pair_m": ("40.0", "40.0\nsigma_range_pair_m = 2.9"),
    "sigma_range_pair_low_m": ("40.0", "40.0\nsigma_range_pair_low_m = 1.4"),
    "antenna id": ('"front"', '"ahead"'),
    "x_m": ("-3.0", "-3.01"),
    "y_m": ("y_m = 0.0", "y_m = 0.01"),
    "height_m": ("3.9", "3.91"),
    "stations": ('"kokubunji-1"', '"kokubunji-2"'),
    "recover_messages": ("= 10\n", "= 11\n"),
    "max_valid_ms": ("3000", "3001"),
    "no_comms_after_s": ("3000", "3000\nno_comms_after_s = 2.5"),
    "stop_after_s": ("3000", "3000\nstop_after_s = 2.5"),
    "release": ("3000", '3000\nrelease = "automatic"'),
    "another station": ('"kokubunji-1"', '"kokubunji-1", "kokubunji-2"'),
    "another antenna": ("[trust]", SECOND + "[trust]"),
}


@pytest.mark.parametrize("name", DECISIVE)
def test_the_hash_changes_with_what_decides(name: str) -> None:
    assert sha256(changed(*DECISIVE[name])) != sha256(EXAMPLE)


def test_the_hash_changes_with_the_order_of_antennas() -> None:
    front, rest = EXAMPLE[EXAMPLE.index("[[antenna]]") : EXAMPLE.index("[trust]")], EXAMPLE[EXAMPLE.index("[trust]") :]
    head = EXAMPLE[: EXAMPLE.index("[[antenna]]")]
    assert sha256(head + front + SECOND + rest) != sha256(head + SECOND + front + rest)


NOT_DECISIVE = {
    "source": ("tcp://10.0.0.11:2000", "udp://:1"),
    "map": ("40.0", '40.0\nmap = "x.json"'),
    "public_keys": ("keys/trusted.toml", "elsewhere.toml"),
    "connect": ("tcp/10.0.0.1:7447", "tcp/[::1]:1"),
    "connect of a station": ("[publish]", '[[station]]\nid = "kokubunji-1"\nconnect = ["tcp/h:1"]\n[publish]'),
    "directory": ("[publish]", '[record]\ndirectory = "x"\n[publish]'),
    "receiver": ('"rx1"', '"rx2"'),
    "a default, written out": ("40.0", "40.0\nmax_speed_mps = 100.0"),
    "a comment": ("# above railhead", "# of the rail"),
}


@pytest.mark.parametrize("name", NOT_DECISIVE)
def test_the_hash_does_not_change_with_anything_else(name: str) -> None:
    assert sha256(changed(*NOT_DECISIVE[name])) == sha256(EXAMPLE)


def outcome(text: str) -> str:
    try:
        return parse_train(text, "train.toml").config.config_sha256
    except ConfigError as error:
        return str(error)


odd = st.recursive(
    st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
    | st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats()
    | st.sampled_from([10**400, -(10**400), 0.0, "front", "kokubunji-1", "tcp://h:1", "tcp/h:1"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["id", "x_m", "train", "0", "", "é"]), inner, max_size=3),
    max_leaves=6,
)
KEYS = [("train",), ("trust",), ("antenna",), ("publish",), ("more",)] + [
    (table, key)
    for table, keys in {
        "train": ("id", "length_m", "map", "facing", "epoch_interval_s", "max_speed_mps", "sigma_range_m", "sigma_range_pair_m", "extra"),
        "antenna": ("id", "source", "x_m", "y_m", "height_m", "receiver", "clock", "oscillator", "extra"),
        "trust": ("stations", "public_keys", "recover_messages", "max_valid_ms", "no_comms_after_s", "stop_after_s", "release"),
        "station": ("id", "connect"),
        "publish": ("connect",),
        "record": ("directory",),
    }.items()
    for key in keys
]


@settings(max_examples=300, deadline=None)
@given(st.dictionaries(st.sampled_from(KEYS), odd, min_size=1, max_size=4))
def test_any_value_anywhere_is_taken_or_refused(values: dict[tuple[str, ...], Any]) -> None:
    tables: dict[str, Any] = {
        "train": {"id": "r", "length_m": 40.0},
        "antenna": {"id": "front", "x_m": -3.0, "height_m": 3.9},
        "trust": {"stations": ["k"]},
    }
    for (name, *key), value in values.items():
        if not key:
            tables[name] = value
        elif isinstance(tables.setdefault(name, {}), dict):
            tables[name][key[0]] = value
    if isinstance(tables["antenna"], dict):
        tables["antenna"] = [tables["antenna"]]
    text = "".join(f"{dotted([name])} = {format_value(value)}\n" for name, value in tables.items())
    assert outcome(text) != ""


@settings(max_examples=200, deadline=None)
@given(st.integers(0, len(EXAMPLE)), st.integers(0, 30), st.text("[]{}=.,\"'#\n\\ 0x1enaf-", max_size=12))
def test_any_text_is_taken_or_refused(at: int, length: int, put: str) -> None:
    assert outcome(EXAMPLE[:at] + put + EXAMPLE[at + length :]) != ""


MONSTERS: dict[str, tuple[str, Callable[[], str]]] = {
    "an integer of 4,800 digits": ("40.0", lambda: "0x" + "F" * 4000),
    "a thousand tables in each other": ('"kokubunji-1"', lambda: "{" + ".".join("a" * 1000) + " = 1}"),
}


@pytest.mark.parametrize("name", MONSTERS)
def test_a_value_that_cannot_be_printed_is_refused(name: str) -> None:
    old, value = MONSTERS[name]
    assert outcome(changed(old, value())) != ""


@pytest.mark.parametrize("key", ["listen", "valid_for_ms"])
def test_a_key_of_a_site_file_is_not_sent_to_where_it_stands_already(key: str) -> None:
    (found,) = problems(changed("[publish]", f"[publish]\n{key} = 1"))
    assert "it belongs in [publish]" not in found


@pytest.mark.parametrize("x_m", ["3.0", "-40.1"])
def test_an_antenna_that_is_not_on_the_train_is_refused(x_m: str) -> None:
    assert "antenna.0.x_m" in problems(changed("-3.0", x_m))[0]


@pytest.mark.parametrize(
    "other, old, new, key",
    [
        (("3.9", "39"), '"tcp://10.0.0.11:2000"', '"tcp:10"', "antenna.0.source"),
        (("= 10\n", "= 0\n"), '"kokubunji-1"', "", "trust.stations"),
    ],
)
def test_sources_and_stations_are_refused_along_with_the_rest_of_their_table(other: tuple[str, str], old: str, new: str, key: str) -> None:
    assert key in "".join(problems(changed(*other).replace(old, new)))


def test_two_antennas_with_one_source_are_refused() -> None:
    assert "antenna.1.source" in problems(EXAMPLE + SECOND + 'source = "tcp://10.0.0.11:2000"\n')[0]
