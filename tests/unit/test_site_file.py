import json
import re
from dataclasses import asdict, replace
from hashlib import sha256
from pathlib import Path

import pytest

from integrity.config import IntegrityConfig, SiteConfig
from recordings.site_file import config_sha256, load_site, override_site, parse_site
from recordings.toml_file import ConfigProblems
from tests.unit.sites import A_ECEF_M, SITE, edited

A_LINE = "position_ecef_m = [-3962108.673, 3381309.574, 3668678.638]"
B_LINE = "position_ecef_m = [-3962186.571, 3381218.295, 3668678.638]"
C_TABLE = (
    '[receivers.C]\nsource = "ntrip://user:secret@caster.example:2101/MOUNT"\nposition_ecef_m = [-3962101.898, 3381224.913, 3668763.412]\n'
)
MINIMAL = "\n".join(
    ['[site]\nid = "s"']
    + [f"[receivers.{name}]\nposition_ecef_m = {point}" for name, point in zip("ABC", re.findall(r"\[-.*\]", SITE), strict=True)]
)


def problems_of(text: str) -> list[str]:
    with pytest.raises(ConfigProblems) as caught:
        parse_site(text, "site.toml")
    return str(caught.value).splitlines()


# What is edited in the sound file, and the one line that says so: its beginning, and a text that it must hold.
BAD: dict[str, tuple[tuple[str, str], str, str]] = {
    "no id": (('id = "kokubunji-1"', ""), "site.toml:1: site.id: missing", "add id, a name of letters"),
    "id with a slash": (('id = "kokubunji-1"', 'id = "a/b"'), 'site.toml:2: site.id = "a/b": expected a name', "north-1"),
    "id with a line end": (('id = "kokubunji-1"', 'id = "a\\n"'), 'site.toml:2: site.id = "a\\n": expected a name', "north-1"),
    "rule misspelt": (
        ('rule = "full"', 'rule = "ful"'),
        'site.toml:19: integrity.rule = "ful": expected "full" or "triangle"; did you mean "full"?',
        "",
    ),
    "rule of another type": (('rule = "full"', "rule = 1"), "site.toml:19: integrity.rule = 1: expected", '"triangle"'),
    "unknown key": (
        ("sigma_common_m =", "sigma_comon_m ="),
        "site.toml:24: integrity.sigma_comon_m = 1.2: no such key",
        '"sigma_common_m"?',
    ),
    "key of another section": (
        ("[integrity]", '[integrity]\nhost_clock = "ptp"'),
        'site.toml:19: integrity.host_clock = "ptp": no such key here: it belongs in [site]',
        "",
    ),
    "unknown section": (("[publish]", "[publsh]"), "site.toml:33: publsh: no such key", 'did you mean "publish"?'),
    "unknown receiver key": (('model = "mosaic-X5"', 'modle = "x"'), 'site.toml:14: receivers.B.modle = "x": no such key', '"model"?'),
    "section is a value": (('[record]\ndirectory = "/var/lib/wayside"', "[[record]]"), "site.toml:38: record", "write [record]"),
    "two receivers": ((C_TABLE, ""), "site.toml:7: receivers: 2 receivers: expected exactly three", "[receivers.C]"),
    "four receivers": (
        ("[integrity]", "[receivers.D]\nposition_ecef_m = [-3962101.898, 3381224.913, 3668663.412]\n[integrity]"),
        "site.toml:7: receivers: 4 receivers",
        "exactly three",
    ),
    "receiver name": (("[receivers.C]", '[receivers."C/1"]'), 'site.toml:15: receivers."C/1": expected a name', '"A"'),
    "no coordinates": ((B_LINE, ""), "site.toml:11: receivers.B.position_ecef_m: missing coordinates", "position_llh_deg_m = [latitude"),
    "both coordinates": (
        (B_LINE, f"{B_LINE}\nposition_llh_deg_m = [35.3393, 139.5235, 65.7]"),
        "site.toml:14: receivers.B.position_llh_deg_m = [35.3393, 139.5235, 65.7]: the point is given twice",
        "either",
    ),
    "two numbers": ((B_LINE, "position_ecef_m = [1.0, 2.0]"), "site.toml:13: receivers.B.position_ecef_m = [1.0, 2.0]: expected three", ""),
    "NaN": ((B_LINE, "position_ecef_m = [nan, nan, 1.0]"), "site.toml:13: receivers.B.position_ecef_m = [nan, nan, 1.0]", "three finite"),
    "placeholder": ((B_LINE, "position_ecef_m = [0, 0, 0]"), "site.toml:13: receivers.B.position_ecef_m = [0, 0, 0]: 0 m from", "surveyed"),
    "degrees as ECEF": ((B_LINE, "position_ecef_m = [35.3, 139.5, 65.7]"), "site.toml:13: receivers.B", "belong in position_llh_deg_m"),
    "kilometres": ((B_LINE, "position_ecef_m = [-3962.1, 3381.2, 3668.6]"), "site.toml:13: receivers.B", "look like kilometres"),
    "above the Earth": ((B_LINE, "position_ecef_m = [-3967810.0, 3386190.0, 3674090.0]"), "site.toml:13: receivers.B", "height 9"),
    "height": (
        (B_LINE, "position_llh_deg_m = [35.3, 139.5, -500.1]"),
        "site.toml:13: receivers.B",
        "height -500.1 m: expected -500 to 9000",
    ),
    "latitude": ((B_LINE, "position_llh_deg_m = [139.5, 35.3, 65.7]"), "site.toml:13: receivers.B", "-90 to 90 deg"),
    "equal points": ((B_LINE, A_LINE), "site.toml:13: receivers.B.position_ecef_m = [-396", "0.000 m from receiver A"),
    "nearly equal": ((B_LINE, A_LINE.replace("638]", "678]")), "site.toml:13: receivers.B", "0.040 m from receiver A: each receiver"),
    "sigma zero": (("sigma_range_m = 0.9", "sigma_range_m = 0"), "site.toml:28: integrity.sigma_range_m = 0: expected", "above 0"),
    "sigma infinite": (("sigma_range_m = 0.9", "sigma_range_m = inf"), "site.toml:28: integrity.sigma_range_m = inf: expected", "1000"),
    "sigma too large": (
        ("sigma_range_m = 0.9", "sigma_range_m = 1000.1"),
        "site.toml:28: integrity.sigma_range_m = 1000.1",
        "at most 1000",
    ),
    "sigma in quotes": (("sigma_range_m = 0.9", 'sigma_range_m = "1"'), 'site.toml:28: integrity.sigma_range_m = "1": expected', "metres"),
    "sigma true": (("sigma_range_m = 0.9", "sigma_range_m = true"), "site.toml:28: integrity.sigma_range_m = true: expected", "metres"),
    "no false stops": (("stops_per_year = 1.0", "stops_per_year = 0.0"), "site.toml:21: integrity.false_stops_per_year = 0.0", "above 0"),
    "missed": (("missed_detection = 1e-5", "missed_detection = 0.2"), "site.toml:22: integrity.missed_detection = 0.2", "at most 0.1"),
    "interval": (
        ("interval_s = 1.0", "interval_s = 301"),
        "site.toml:5: site.epoch_interval_s = 301: expected seconds, from 0.05 to 300",
        "",
    ),
    "recovery": (("after_s = 30.0", "after_s = -1.0"), "site.toml:32: integrity.recover_after_s = -1.0: expected seconds, from 0", ""),
    "systems": (("[publish]", 'systems = ["GPS", "Loran"]\n[publish]'), "site.toml:33: integrity.systems = ", '"GPS", "Galileo", "BeiDou"'),
    "no system": (("[publish]", "systems = []\n[publish]"), "site.toml:33: integrity.systems = []", "at least one"),
    "mask": (("[publish]", "elevation_mask_deg = 46\n[publish]"), "site.toml:33: integrity.elevation_mask_deg = 46", "from 0 to 45"),
    "validity": (("valid_for_ms = 3000", "valid_for_ms = 99"), "site.toml:37: publish.valid_for_ms = 99: expected", "from 100 to 60000"),
    "endpoint": (('["tcp/0.0.0.0:7447"]', '["7447"]'), 'site.toml:34: publish.listen = ["7447"]: expected a list of Zenoh endpoints', ""),
    "endpoint alone": (('["tcp/0.0.0.0:7447"]', '"tcp/x:1"'), 'site.toml:34: publish.listen = "tcp/x:1": expected a list', '["tcp'),
    "page": (('"127.0.0.1:8080"', '"8080"'), 'site.toml:41: page.listen = "8080": expected "HOST:PORT"', ""),
    "scheme": (("tcp://10", "tpc://10"), 'site.toml:12: receivers.B.source = "tpc://10.0.0.2:2000": no such kind', 'did you mean "tcp"?'),
    "no port": (("10.0.0.2:2000", "10.0.0.2"), 'site.toml:12: receivers.B.source = "tcp://10.0.0.2": expected tcp://host:port', "port"),
    "large port": (("10.0.0.2:2000", "10.0.0.2:65536"), 'site.toml:12: receivers.B.source = "tcp://10.0.0.2:65536": expected', "65535"),
    "baud": (("baud=460800", "baud=fast"), 'site.toml:8: receivers.A.source = "serial:///dev/ttyACM0?baud=fast": expected serial', ""),
    "protocol": (
        ('model = "mosaic-X5"', 'protocol = "rtcm"'),
        'site.toml:14: receivers.B.protocol = "rtcm": expected "ubx" or "rtcm3"',
        "",
    ),
    "latitude of a caster's position": (("2101/MOUNT", "2101/M?gga=90.1,0,0"), "site.toml:16: receivers.C.source", "/MOUNT"),
    "certificates without TLS": (("2101/MOUNT", "2101/M?ca=ca.pem"), "site.toml:16: receivers.C.source", "ntrip://"),
    "no mount": (("2101/MOUNT", "2101"), "site.toml:16: receivers.C.source", "/MOUNT"),
    "same source": (("tcp://10.0.0.2:2000", "serial:///dev/ttyACM0"), "site.toml:12: receivers.B.source", "receiver A has the same"),
    "too small": (
        ("sigma_differential_m = 0.5", "sigma_differential_m = 10.01"),
        "site.toml:7: receivers: too small a triangle for the promised collapse test",
        "sides of 120.2 m (root mean square; now 120.00 m), or a measured sigma_differential_m of at most 9.999",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_with_one_line_that_says_what_would_do(name: str) -> None:
    edit, beginning, holds = BAD[name]
    (line,) = problems_of(edited(edit))
    assert line.startswith(beginning) and holds in line, line


@pytest.mark.parametrize(
    "edit",
    [
        ("sigma_range_m = 0.9", "sigma_range_m = 1000"),
        ("stops_per_year = 1.0", "stops_per_year = 1000"),
        ("missed_detection = 1e-5", "missed_detection = 0.1"),
        ("interval_s = 1.0", "interval_s = 0.05"),
        ("interval_s = 1.0", "interval_s = 300"),
        ("after_s = 30.0", "after_s = 0"),
        ("[publish]", "elevation_mask_deg = 0\n[publish]"),
        ("[publish]", 'systems = ["Galileo", "GLONASS"]\n[publish]'),
        ("[publish]", "elevation_mask_deg = 45\n[publish]"),
        ("valid_for_ms = 3000", "valid_for_ms = 100"),
        ("valid_for_ms = 3000", "valid_for_ms = 60000"),
        ('listen = "127.0.0.1:8080"', 'listen = "127.0.0.1:0"'),
    ],
)
def test_a_value_at_the_edge_of_its_range_is_taken(edit: tuple[str, str]) -> None:
    parse_site(edited(edit), "site.toml")


def test_five_mistakes_are_reported_at_once_with_their_lines() -> None:
    text = edited(
        ("epoch = 2011.40", 'epoch = "2011.40"'),
        (B_LINE, ""),
        ('rule = "full"', 'rule = "ful"'),
        ("sigma_common_m = 1.2", "sigma_common_m = -1.2"),
        ('listen = "127.0.0.1:8080"', "lisen = 1"),
    )
    assert [line.split(" = ")[0].split(": missing")[0] for line in problems_of(text)] == [
        "site.toml:4: site.epoch",
        "site.toml:11: receivers.B.position_ecef_m",
        "site.toml:19: integrity.rule",
        "site.toml:24: integrity.sigma_common_m",
        "site.toml:41: page.lisen",
    ]


def test_an_empty_file_lacks_an_id_and_three_receivers() -> None:
    assert [line.split(": ")[1] for line in problems_of("")] == ["site.id", "receivers"]


def test_a_wrong_sigma_differential_is_not_held_against_the_triangle_too() -> None:
    assert len(problems_of(edited(("sigma_differential_m = 0.5", "sigma_differential_m = 1e9")))) == 1


def test_a_wrong_value_is_not_warned_of_as_well() -> None:
    with pytest.raises(ConfigProblems) as caught:
        parse_site(edited(('host_clock = "ntp"', 'host_clock = "ntpp"')), "site.toml")
    assert caught.value.warnings == ()


def test_a_password_does_not_reach_a_problem() -> None:
    assert "secret" not in "".join(problems_of(edited(("2101/MOUNT", "2101"))))


def test_the_sound_file_has_no_warning() -> None:
    assert parse_site(SITE, "site.toml").warnings == ()


WARNINGS: dict[str, tuple[tuple[str, str], str]] = {
    "frame unstated": (('frame = "JGD2011"', ""), "site.toml:1: site.frame: not stated"),
    "clock unstated": (('host_clock = "ntp"', ""), "site.toml:1: site.host_clock: time spoofing is not monitored"),
    "no clock": (('host_clock = "ntp"', 'host_clock = "none"'), 'site.toml:6: site.host_clock = "none": time spoofing is not'),
    "clock by GNSS": (('host_clock = "ntp"', 'host_clock = "gnss"'), 'site.toml:6: site.host_clock = "gnss": time spoofing is not'),
}


@pytest.mark.parametrize("name", WARNINGS)
def test_a_weakness_is_a_warning(name: str) -> None:
    edit, beginning = WARNINGS[name]
    (warning,) = parse_site(edited(edit), "site.toml").warnings
    assert str(warning).startswith(beginning)


@pytest.mark.parametrize("key", ["supply", "mast", "switch"])
def test_what_two_receivers_share_is_a_warning(key: str) -> None:
    text = edited(('model = "mosaic-X5"', f'{key} = "one"'), ("[integrity]", f'{key} = "one"\n[integrity]'))
    (warning,) = parse_site(text, "site.toml").warnings
    assert str(warning).startswith(f'site.toml:18: receivers.C.{key} = "one": shared by receivers B, C')


def test_three_receivers_of_one_model_are_a_warning() -> None:
    text = edited(('model = "mosaic-X5"', 'model = "ZED-F9P HPG 1.51"'), ("[integrity]", 'model = "ZED-F9P HPG 1.51"\n[integrity]'))
    assert "all receivers are of one model" in str(parse_site(text, "site.toml").warnings[0])


# 120 m sides: 17 sigma at 7.0588 m; the boundary is met from both sides.
@pytest.mark.parametrize(("sigma_m", "warnings"), [(7.05, 0), (7.06, 3)])
def test_a_pair_closer_than_17_sigma_is_a_warning(sigma_m: float, warnings: int) -> None:
    site = parse_site(edited(("sigma_differential_m = 0.5", f"sigma_differential_m = {sigma_m}")), "site.toml")
    assert len(site.warnings) == warnings


# 120 m sides to the millimetre: sqrt(Lambda) is 12 at 10 m.
def test_a_triangle_just_large_enough_for_the_collapse_test_is_accepted() -> None:
    parse_site(edited(("sigma_differential_m = 0.5", "sigma_differential_m = 9.999")), "site.toml")


def test_a_side_over_ten_kilometres_is_a_warning() -> None:
    far = "position_llh_deg_m = [35.45, 139.5221731278654, 65.7]"  # 12.3 km north of A
    assert [warning.message[:25] for warning in parse_site(edited((B_LINE, far)), "site.toml").warnings] == [
        "12.3 km from receiver A, ",
        "12.2 km from receiver B, ",
    ]


def test_settings_of_the_sound_file() -> None:
    config = parse_site(SITE, "site.toml").config
    assert replace(config, receivers=(), config_sha256="") == SiteConfig(
        site_id="kokubunji-1",
        frame="JGD2011",
        frame_epoch=2011.4,
        epoch_interval_ns=1_000_000_000,
        host_clock="ntp",
        receivers=(),
        integrity=IntegrityConfig(tolerance_m=20.0),
        valid_for_ms=3000,
        config_sha256="",
    )


def test_a_file_with_nothing_optional_has_the_documented_defaults() -> None:
    site = parse_site(MINIMAL, "site.toml")
    assert (site.config.integrity, site.config.valid_for_ms, site.config.frame) == (IntegrityConfig(), 3000, "unstated")


def test_sections_left_out_have_their_defaults() -> None:
    site = parse_site(MINIMAL, "site.toml")
    assert (site.publish.listen, site.publish.connect, site.publish.key) == (("tcp/0.0.0.0:7447",), (), "keys/s.pem")


def test_receivers_stand_in_the_order_of_their_names() -> None:
    text = edited(("[receivers.A]", "[receivers.Z]"))
    assert parse_site(text, "site.toml").config.receiver_names == ("B", "C", "Z")


def test_a_vertical_sigma_left_out_is_twice_the_horizontal_one() -> None:
    text = edited(("sigma_common_up_m = 2.4\n", ""), ("sigma_common_m = 1.2", "sigma_common_m = 1.5"))
    assert parse_site(text, "site.toml").config.integrity.sigma_common_up_m == 3.0


def test_a_vertical_sigma_given_is_kept() -> None:
    text = edited(("sigma_differential_up_m = 1.0", "sigma_differential_up_m = 0.7"))
    assert parse_site(text, "site.toml").config.integrity.sigma_differential_up_m == 0.7


def test_geodetic_coordinates_give_the_same_point() -> None:
    # Of A's ECEF coordinates, by pymap3d; the height to 1e-9 m, the angles to 1e-14 deg: 1e-6 m is the rounding of the point.
    text = edited((A_LINE, "position_llh_deg_m = [35.33932577626121, 139.5221731278654, 65.71196605211195]"))
    assert parse_site(text, "site.toml").config.receivers[0].position_ecef_m == pytest.approx(A_ECEF_M, abs=2e-6)


def test_the_hash_is_that_of_canonical_json_without_itself() -> None:
    config = parse_site(SITE, "site.toml").config
    content = {key: value for key, value in asdict(config).items() if key not in ("config_sha256", "map_sha256")}
    assert config.config_sha256 == sha256(json.dumps(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


@pytest.mark.parametrize(
    "edit", [('3668678.638]\nmodel = "Z', '3668678.639]\nmodel = "Z'), ("= 30.0", "= 31.0"), ("valid_for_ms = 3000", "valid_for_ms = 2999")]
)
def test_the_hash_changes_with_what_decisions_depend_on(edit: tuple[str, str]) -> None:
    assert parse_site(edited(edit), "s").config.config_sha256 != parse_site(SITE, "s").config.config_sha256


@pytest.mark.parametrize(
    "edit",
    [
        *[("10.0.0.2:2000", "10.0.0.3:2000"), ("# of the coordinates", ""), ("/var/lib/wayside", "/tmp"), ("= 30.0", "= 30")],
        ("valid_for_ms = 3000", f'valid_for_ms = 3000\nmap_sha256 = ["{"0a" * 32}"]'),
    ],
)
def test_the_hash_does_not_change_with_what_they_do_not_depend_on(edit: tuple[str, str]) -> None:
    assert parse_site(edited(edit), "s").config.config_sha256 == parse_site(SITE, "s").config.config_sha256


def test_the_hash_does_not_hash_itself() -> None:
    config = parse_site(SITE, "s").config
    assert config_sha256(replace(config, config_sha256="else")) == config.config_sha256


def test_a_site_is_loaded_from_a_path(tmp_path: Path) -> None:
    path = tmp_path / "site.toml"
    path.write_text(SITE)
    assert load_site(path) == parse_site(SITE, str(path))


def test_an_override_changes_only_what_it_names() -> None:
    site = parse_site(SITE, "site.toml")
    changed = override_site(site, ["integrity.rule=triangle"])
    assert replace(changed.config, config_sha256="") == replace(
        site.config, integrity=replace(site.config.integrity, rule="triangle"), config_sha256=""
    )


def test_the_epoch_interval_is_in_nanoseconds() -> None:
    assert override_site(parse_site(SITE, "site.toml"), ["epoch_interval_s=0.1"]).config.epoch_interval_ns == 100_000_000


@pytest.mark.parametrize("value", ["ITRF2014", "1\nid = 2", "a = b"])
def test_a_setting_that_is_not_a_toml_value_is_text(value: str) -> None:
    assert override_site(parse_site(SITE, "site.toml"), [f"site.frame={value}"]).config.frame == value


def test_an_overridden_site_parses_to_itself_again() -> None:
    settings = [
        "rule = triangle",
        "epoch_interval_s=0.1",
        "frame=ITRF2014",
        'publish.listen=["tcp/[::]:7447", "udp/h:1"]',
        "receivers.B.mast=m",
    ]
    changed = override_site(parse_site(SITE, "site.toml"), settings)
    again = parse_site(changed.text, changed.file)
    assert again == changed


def test_the_text_of_a_site_without_override_is_that_of_the_file() -> None:
    assert parse_site(SITE, "site.toml").text == SITE


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        (["integrity.rule=ful"], '--set: integrity.rule = "ful": expected "full" or "triangle"; did you mean "full"?'),
        (["integrity.sigma_common_m=wide"], '--set: integrity.sigma_common_m = "wide": expected a standard deviation'),
        (["integrity.sgma_common_m=1"], '--set: integrity.sgma_common_m = 1: no such key; did you mean "sigma_common_m"?'),
        (["integrity.sigma_differential_m=20"], "--set: receivers: too small a triangle"),
        (["listen=x"], "--set: listen = x: several sections have this key: write publish.listen or page.listen"),
        (["ruel=full"], '--set: ruel = full: no such key; did you mean "rule"?'),
        (["source=file:x"], "--set: source = file:x: no such key here: it belongs in [receivers.NAME]"),
        (["integrity.rule"], "--set: integrity.rule: expected KEY=VALUE"),
        (["=1"], "--set: 1: expected KEY=VALUE"),
        (["site.id.x=1"], "--set: site.id.x = 1: expected a key in a table"),
        (["receivers.D.mast=m"], "--set: receivers: 4 receivers"),
    ],
)
def test_a_setting_that_does_not_fit_is_refused(settings: list[str], expected: str) -> None:
    with pytest.raises(ConfigProblems) as caught:
        override_site(parse_site(SITE, "site.toml"), settings)
    assert any(line.startswith(expected) for line in str(caught.value).splitlines()), str(caught.value)


def test_all_settings_that_do_not_fit_are_refused_at_once() -> None:
    with pytest.raises(ConfigProblems) as caught:
        override_site(parse_site(SITE, "site.toml"), ["rule=ful", "valid_for_ms=1"])
    assert len(caught.value.problems) == 2


def test_a_warning_of_a_setting_names_the_setting() -> None:
    (warning,) = override_site(parse_site(SITE, "site.toml"), ["host_clock=gnss"]).warnings
    assert str(warning).startswith('--set: site.host_clock = "gnss": time spoofing')


def test_a_warning_of_the_file_keeps_its_line() -> None:
    site = parse_site(edited(('host_clock = "ntp"', 'host_clock = "none"')), "site.toml")
    (warning,) = override_site(site, ["rule=triangle"]).warnings
    assert (warning.file, warning.line) == ("site.toml", 6)


def test_warnings_come_with_the_errors() -> None:
    with pytest.raises(ConfigProblems) as caught:
        parse_site(edited(('host_clock = "ntp"', 'host_clock = "none"'), ("recover_after_s", "recover_s")), "site.toml")
    assert [warning.key for warning in caught.value.warnings] == ["site.host_clock"]
