"""What a replay says to machines and to people: the promised keys, the hash of the decisions, episodes, exclusions, one row per epoch."""

import csv
import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from integrity.events import Event
from integrity.gnss.gps_time import NS_PER_S, format_utc
from integrity.gnss.observations import ObservationRow
from integrity.outputs import EpochReport
from integrity.states import Cause, State
from recordings.explain import WORDS, explain
from recordings.replay import decide
from recordings.site_file import override_site, parse_site
from recordings.summary import Summary, alerted, as_json_object, decisions_sha256, episodes, in_window, silences, write_epochs_csv
from tests.unit.sites import edited
from tests.unit.streams import START_NS, epoch_of, moved, rows_changed, stream, ticks_only, with_more

SECONDS = 60
SITE = parse_site(edited(("recover_after_s = 30.0", "recover_after_s = 5.0"), ('fault = "stop"', 'fault = "exclude"')), "site.toml")
KEYS = {  # interfaces.md, Command line
    "recording", "site", "config_sha256", "software", "start", "end", "epochs", "wall_s", "alignment", "states", "episodes",
    "exclusions", "triangle_alone", "receivers", "decisions_sha256",
}  # fmt: skip
DROPPED = {"A": {"epoch repeated": 2, "field not a number": 1}, "B": {}, "C": {}}


def at(second: int) -> str:
    return format_utc(START_NS + second * NS_PER_S)


def spoiled(row: ObservationRow) -> ObservationRow | None:
    """The code of G07 40 m long from 10 to 14 s, so that it jumps again at 15 s; B elsewhere from 30 to 33 s; B silent from 45 to 49 s."""
    second = epoch_of(row)
    if 10 <= second < 15:
        return with_more(row, "pseudorange_m", 40.0, [row.signals.index("G07.1C")])
    if 30 <= second < 34 and row.receiver == "B":
        return moved(row, 30.0, 1.0)
    return None if 45 <= second < 50 and row.receiver == "B" else row


EVENTS = rows_changed(stream(SECONDS), spoiled)


def summary_of(events: Sequence[Event], start_ns: int | None = None, end_ns: int | None = None, *settings: str) -> Summary:
    site = override_site(SITE, settings)
    outputs, monitor = decide(site, events)
    reports, health = in_window(outputs, start_ns, end_ns)
    return Summary("x.mcap", site, monitor.limits, reports, health, DROPPED, 0.5)


@pytest.fixture(scope="module")
def summary() -> Summary:
    return summary_of(EVENTS)


@pytest.fixture(scope="module")
def found(summary: Summary) -> dict[str, Any]:
    """The object as a program reads it."""
    read: dict[str, Any] = json.loads(json.dumps(as_json_object(summary), allow_nan=False))
    return read


# The object


def test_the_object_has_every_promised_key_and_no_other(found: dict[str, Any]) -> None:
    assert set(found) == KEYS


def test_the_object_names_the_recording_the_site_and_the_software(found: dict[str, Any]) -> None:
    assert (found["recording"], found["site"], found["config_sha256"]) == ("x.mcap", "kokubunji-1", SITE.config.config_sha256)
    assert re.fullmatch(r"wayside \d+\.\d+\.\d+", found["software"])


def test_start_and_end_are_of_the_first_and_last_epoch(found: dict[str, Any]) -> None:
    assert (found["start"], found["end"]) == (at(0), at(SECONDS - 1))


def test_epochs_are_those_that_all_receivers_share(found: dict[str, Any]) -> None:
    assert found["epochs"] == SECONDS - 5


def test_states_count_every_epoch_once(found: dict[str, Any]) -> None:
    assert (set(found["states"]), sum(found["states"].values())) == ({"NORMAL", "SATELLITE_ANOMALY", "NOT_CONFIRMABLE"}, SECONDS - 5)


def test_states_count_what_was_published(found: dict[str, Any], summary: Summary) -> None:
    assert found["states"]["NORMAL"] == sum(r.state is State.NORMAL for r in summary.reports)


def test_triangle_alone_counts_what_the_triangle_would_have_said(found: dict[str, Any], summary: Summary) -> None:
    assert found["triangle_alone"] == {state: sum(r.triangle_alone is state for r in summary.reports) for state in State}


def test_alignment_is_the_sum_of_what_was_dropped_and_why(found: dict[str, Any]) -> None:
    assert found["alignment"]["A"] == {"dropped": 3, "reasons": DROPPED["A"]}


def test_every_receiver_has_the_promised_numbers(found: dict[str, Any]) -> None:
    promised = {"epochs", "solved", "h_rms_m", "h_p95_m", "h_max_m", "v_rms_m"}
    assert {name: set(numbers) for name, numbers in found["receivers"].items()} == dict.fromkeys("ABC", promised)


@pytest.mark.parametrize("receiver", "ABC")
def test_errors_of_a_receiver_are_those_of_its_solutions(found: dict[str, Any], summary: Summary, receiver: str) -> None:
    e = np.array([r.e_enu_m["ABC".index(receiver)] for r in summary.reports])
    h = np.hypot(e[:, 0], e[:, 1])
    expected = [np.sqrt(np.mean(h**2)), np.percentile(h, 95), h.max(), np.sqrt(np.mean(e[:, 2] ** 2))]
    numbers = found["receivers"][receiver]
    assert [numbers[key] for key in ("h_rms_m", "h_p95_m", "h_max_m", "v_rms_m")] == pytest.approx(expected, abs=0.00051)  # rounded to mm


def test_a_receiver_that_was_never_solved_has_no_errors(summary: Summary) -> None:
    unsolved = [replace(r, e_enu_m=np.full((3, 3), np.nan)) for r in summary.reports]
    numbers = as_json_object(replace(summary, reports=unsolved))["receivers"]["B"]
    assert numbers == {"epochs": SECONDS - 5, "solved": 0, "h_rms_m": None, "h_p95_m": None, "h_max_m": None, "v_rms_m": None}


def test_an_empty_window_is_an_object_with_the_same_keys() -> None:
    empty = as_json_object(summary_of(EVENTS, START_NS - 10, START_NS - 5))
    assert (set(empty), empty["start"], empty["end"], empty["epochs"]) == (KEYS, None, None, 0)


# The hash


def canonical(reports: Sequence[EpochReport]) -> str:
    """As interfaces.md says it, in other words than the code's."""
    lines = "".join(
        f'[{r.gps_time_ns},"{r.state}","{r.cause}",{json.dumps(sorted(r.subjects), separators=(",", ":"))},'
        f"{json.dumps(sorted(x.satellite for x in r.exclusions), separators=(',', ':'))}]\n"
        for r in reports
    )
    return hashlib.sha256(lines.encode()).hexdigest()


def test_the_hash_is_of_one_json_line_per_epoch(found: dict[str, Any], summary: Summary) -> None:
    assert found["decisions_sha256"] == canonical(summary.reports)


@pytest.mark.parametrize(
    "change",
    [
        {"gps_time_ns": START_NS},
        {"state": State.SATELLITE_ANOMALY},
        {"cause": Cause.SPOOFING},
        {"subjects": ("A",)},
        {"exclusions": ()},
    ],
    ids=lambda change: next(iter(change)),
)
def test_the_hash_changes_with_every_part_of_a_decision(summary: Summary, change: dict[str, Any]) -> None:
    reports = list(summary.reports)
    reports[12] = replace(reports[12], **change)  # G07 is out then
    assert decisions_sha256(reports) != decisions_sha256(summary.reports)


def test_the_hash_does_not_depend_on_the_order_of_subjects(summary: Summary) -> None:
    one, other = (replace(summary.reports[0], subjects=subjects) for subjects in (("A", "B"), ("B", "A")))
    assert decisions_sha256([one]) == decisions_sha256([other])


def test_the_hash_does_not_depend_on_floats(summary: Summary) -> None:
    r = summary.reports[0]
    assert decisions_sha256([replace(r, statistic=r.statistic * 1.0001, e_enu_m=r.e_enu_m + 1.0)]) == decisions_sha256([r])


# Episodes


def test_episodes_are_told_in_order_with_what_was_wrong(found: dict[str, Any]) -> None:
    assert [(e["state"], e["cause"], e["subjects"]) for e in found["episodes"]] == [
        ("NOT_CONFIRMABLE", "not_ready", []),
        ("NOT_CONFIRMABLE", "receiver", ["B"]),
        ("NOT_CONFIRMABLE", "data", ["B"]),
    ]


def test_an_episode_lasts_until_something_else_is_published(found: dict[str, Any]) -> None:
    assert [(e["start"], e["end"]) for e in found["episodes"][:2]] == [(at(0), at(5)), (at(30), at(39))]


def test_a_silence_begins_when_it_is_noticed_and_ends_after_recovery(found: dict[str, Any]) -> None:
    silence = found["episodes"][2]
    assert (silence["start"], silence["end"], silence["check"]) == (at(47), at(55), "silence")  # heard last at 44 s; more than 2 s


def test_an_episode_says_which_check_weighed_most(found: dict[str, Any], summary: Summary) -> None:
    episode = found["episodes"][1]
    assert episode["check"] in summary.reports[0].check_names
    assert episode["statistic"] > episode["threshold"]


def test_what_has_no_number_has_none(found: dict[str, Any]) -> None:
    assert (found["episodes"][0]["statistic"], found["episodes"][0]["threshold"]) == (None, None)


def test_an_episode_that_never_ends_ends_with_the_last_word() -> None:
    (*_, last) = episodes(summary_of([*EVENTS, *ticks_only(EVENTS[-1], 10)]))
    assert (last["cause"], last["end"]) == ("data", at(SECONDS - 1 + 10))


def test_every_time_of_an_episode_is_utc_or_null_where_no_epoch_came_before() -> None:
    late = rows_changed(stream(SECONDS), lambda row: None if row.receiver == "C" and epoch_of(row) < 10 else row)
    times = [e[key] for e in episodes(summary_of(late)) for key in ("start", "end")]
    assert all(t is None or re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?Z", t) for t in times), times


def test_silences_run_from_the_last_epoch_before_to_the_first_after(summary: Summary) -> None:
    assert silences(summary) == [(START_NS + 44 * NS_PER_S, START_NS + 50 * NS_PER_S)]


def test_a_silence_at_the_end_runs_to_the_last_word() -> None:
    (*_, last) = silences(summary_of([*EVENTS, *ticks_only(EVENTS[-1], 10)]))
    assert last == (START_NS + (SECONDS - 1) * NS_PER_S, START_NS + (SECONDS + 9) * NS_PER_S)


# Exclusions


def test_an_exclusion_says_when_why_and_until_when(found: dict[str, Any]) -> None:
    (exclusion,) = found["exclusions"]
    assert (exclusion["satellite"], exclusion["start"], exclusion["end"], exclusion["check"]) == ("G07", at(10), at(21), "innovation")


def test_an_exclusion_shows_what_failed(found: dict[str, Any]) -> None:
    (exclusion,) = found["exclusions"]
    assert exclusion["statistic"] > exclusion["threshold"]


def test_an_exclusion_that_lasts_ends_with_the_last_epoch() -> None:
    (exclusion,) = as_json_object(summary_of(EVENTS, None, START_NS + 13 * NS_PER_S))["exclusions"]
    assert exclusion["end"] == at(12)


# Windows


def test_a_window_includes_its_start_and_not_its_end() -> None:
    part = as_json_object(summary_of(EVENTS, START_NS + 20 * NS_PER_S, START_NS + 25 * NS_PER_S))
    assert (part["start"], part["end"], part["epochs"]) == (at(20), at(24), 5)


# Alerted


def windowed(start_s: int, end_s: int) -> Summary:
    return summary_of(EVENTS, START_NS + start_s * NS_PER_S, START_NS + end_s * NS_PER_S)


def test_a_calm_stretch_alerts_nobody() -> None:
    assert not alerted(windowed(6, 30))


def test_starting_alerts_nobody() -> None:
    assert not alerted(windowed(0, 30))


def test_an_excluded_satellite_alerts_nobody_where_it_leaves_normal() -> None:
    assert not alerted(windowed(9, 21))


def test_the_same_satellite_alerts_where_a_fault_stops() -> None:
    assert alerted(summary_of(EVENTS, START_NS + 6 * NS_PER_S, START_NS + 29 * NS_PER_S, "on_satellite_fault=stop"))


def test_a_single_epoch_alerts() -> None:
    assert alerted(windowed(6, 31))


def test_a_silence_between_epochs_alerts() -> None:
    published = summary_of(EVENTS)
    calm_epochs = [h for h in published.health if h.cause is Cause.DATA and h.mono_ns == START_NS + 47 * NS_PER_S]
    assert alerted(replace(published, health=calm_epochs))


def test_a_start_that_never_ends_alerts() -> None:
    assert alerted(windowed(0, 4))


def test_nothing_published_alerts() -> None:
    assert alerted(summary_of(EVENTS, START_NS - 10, START_NS - 5))


# A row per epoch


@pytest.fixture(scope="module")
def table(summary: Summary, tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, str]]:
    path = tmp_path_factory.mktemp("csv") / "epochs.csv"
    write_epochs_csv(path, summary.reports, ("A", "B", "C"))
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_columns_are_decision_receivers_and_checks(table: list[dict[str, str]], summary: Summary) -> None:
    decision = ["gps_time_ns", "utc", "state", "cause", "subjects", "excluded", "triangle_alone"]
    receivers = [f"{r}_{q}" for r in "ABC" for q in ("e_m", "n_m", "u_m", "sats")]
    checks = [column for name in summary.reports[0].check_names for column in (name, f"{name}_threshold")]
    assert list(table[0]) == decision + receivers + checks


def test_there_is_a_row_per_epoch(table: list[dict[str, str]], summary: Summary) -> None:
    assert [int(row["gps_time_ns"]) for row in table] == [r.gps_time_ns for r in summary.reports]


def test_a_row_says_what_was_decided(table: list[dict[str, str]]) -> None:
    assert [table[12][key] for key in ("utc", "state", "cause", "subjects", "excluded")] == [at(12), "NORMAL", "", "", "G07"]


def test_a_row_of_a_failing_epoch_names_cause_and_subjects(table: list[dict[str, str]]) -> None:
    assert [table[30][key] for key in ("state", "cause", "subjects")] == ["NOT_CONFIRMABLE", "receiver", "B"]


def test_positions_are_in_millimetres(table: list[dict[str, str]], summary: Summary) -> None:
    written = [[float(table[k][f"A_{q}_m"]) for q in "enu"] for k in range(len(table))]
    np.testing.assert_allclose(written, [r.e_enu_m[0] for r in summary.reports], atol=0.00051)


def test_statistics_are_written_to_six_digits(table: list[dict[str, str]], summary: Summary) -> None:
    shape = summary.reports[0].check_names.index("shape")
    assert [float(row["shape"]) for row in table] == pytest.approx([float(r.statistic[shape]) for r in summary.reports], rel=1e-5)


def test_what_was_not_computed_is_empty(summary: Summary, tmp_path: Path) -> None:
    r = summary.reports[0]
    write_epochs_csv(tmp_path / "x.csv", [replace(r, e_enu_m=np.full((3, 3), np.nan), statistic=r.statistic * np.nan)], ("A", "B", "C"))
    with (tmp_path / "x.csv").open(newline="", encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert {row["A_e_m"], row["C_u_m"], row["shape"], row["data"]} == {""}


# In words


def test_the_words_name_every_state_that_was_published(summary: Summary) -> None:
    text = explain(summary)
    assert re.findall(r"^  03:00:\d\d  (\w+)", text, re.MULTILINE) == [
        "NOT_CONFIRMABLE", "NORMAL", "NOT_CONFIRMABLE", "NORMAL", "NOT_CONFIRMABLE", "NORMAL",
    ]  # fmt: skip


@pytest.mark.parametrize("cause", [Cause.NOT_READY, Cause.RECEIVER, Cause.DATA])
def test_the_words_say_the_cause(summary: Summary, cause: Cause) -> None:
    assert WORDS[cause] in explain(summary)


def test_the_words_name_whom(summary: Summary) -> None:
    assert "a receiver is faulty (B); " in explain(summary)


def test_the_words_show_the_evidence(summary: Summary) -> None:
    assert re.search(r"a receiver is faulty \(B\); \w+ [\d.e+]+ > [\d.]+", explain(summary))


def test_the_words_tell_what_was_excluded(summary: Summary) -> None:
    assert re.search(r"03:00:10 to 03:00:21  G07 excluded: innovation [\d.]+ > [\d.]+", explain(summary))


def test_the_words_tell_what_stays_excluded() -> None:
    assert re.search(
        r"03:00:10 to 03:00:12  G07 excluded: innovation .*; still out\n", explain(summary_of(EVENTS, None, START_NS + 13 * NS_PER_S))
    )


def test_what_comes_back_in_the_last_epoch_is_not_still_out() -> None:
    text = explain(summary_of(EVENTS, None, START_NS + 22 * NS_PER_S))
    assert ("03:00:10 to 03:00:21  G07 excluded" in text, "still out" in text) == (True, False)


def test_the_words_count_what_was_not_aligned(summary: Summary) -> None:
    assert "receiver A: solved 55 of 55; " in explain(summary)
    assert "; 3 not aligned or unreadable" in explain(summary)


@pytest.mark.parametrize("cause", [c for c in Cause if c is not Cause.NONE])
def test_there_are_words_for_every_cause(cause: Cause) -> None:
    assert WORDS[cause]


def test_an_empty_window_is_said_to_confirm_nothing() -> None:
    assert "nothing can be confirmed" in explain(summary_of(EVENTS, START_NS - 10, START_NS - 5))
