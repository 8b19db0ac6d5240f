"""A campaign as a Markdown table: a line a threat, what its numbers are at the smallest size from which every trial is caught."""

from collections.abc import Mapping
from typing import Any

from recordings.campaign.summary import took
from recordings.campaign.tally import rounded

HEAD = ("threat", "fault", "caught in every trial from", "alert, 95 %", "moved until then, 95 %", "wrong names", "circles and shape alone")


def table_md(found: Mapping[str, Any]) -> str:
    """The table of `summary.as_json_object`, and below it what it sums up to."""
    lines = [_line(HEAD), "|" + "---|" * len(HEAD), *(_line(_cells(threat)) for threat in found["threats"])]
    wrong, hazards = found["named_wrongly"], found["hazards"]
    return "\n".join(
        [
            *lines,
            "",
            f"{found['trials']} trials on {len(found['stages'])} streams, seed {found['seed']}: someone else named in {wrong['count']} "
            f"(at most {100 * wrong['at_most']:.2g} % at 95 % confidence), NORMAL beyond {found['tolerance_m']:g} m in {hazards['count']} "
            f"(at most {100 * hazards['at_most']:.2g} %). Moved: how far the fault had moved a position, horizontally, before the alert, "
            f"and of slow faults in its epoch too. The radius is {found['radius_m']:g} m. {took(found)}.",
            "",
        ]
    )


def _line(cells: tuple[str, ...]) -> str:
    return f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |"


def _cells(threat: Mapping[str, Any]) -> tuple[str, ...]:
    played = [of for of in threat["sizes"] if of["trials"]]
    wrong = str(sum(of["named_wrongly"] for of in played))
    if threat["kind"] == "harmless":
        stopped = sum(of["detected"]["count"] for of in played)
        return threat["id"], threat["title"], f"harmless: stopped in {stopped} of {sum(of['trials'] for of in played)}", "", "", wrong, ""
    caught, alone = _always(threat, "detected"), _always(threat, "triangle_alone")
    if caught is None:
        return threat["id"], threat["title"], "not in every", "", _moved(threat, played), wrong, _size(threat, alone)
    at_once = caught["in_first_epoch"]["count"] == caught["trials"]
    alert = "first epoch" if at_once else f"{rounded(caught['time_to_alert_s']['p95']):g} s"
    return threat["id"], threat["title"], _size(threat, caught), alert, _moved(threat, played), wrong, _size(threat, alone)


def _always(threat: Mapping[str, Any], share: str) -> Mapping[str, Any] | None:
    """The smallest size from which, and at all above, every trial is caught."""
    smallest = None
    for of in reversed(threat["sizes"]):
        if of["trials"] == 0 or of[share]["count"] < of[share]["of"]:
            break
        smallest = of
    return smallest


def _size(threat: Mapping[str, Any], of: Mapping[str, Any] | None) -> str:
    if of is None:
        return "not in every"
    return f"{of['size']:g} {threat['unit']}" if len(threat["sizes"]) > 1 else "always"


def _moved(threat: Mapping[str, Any], played: list[Mapping[str, Any]]) -> str:
    """Of the size that moved a position farthest; how often it was more than the radius, where it was."""
    farthest = max((of["shift_m"]["p95"] for of in played), default=0.0)
    within = threat["shift_within_radius"]
    beyond = within["of"] - within["count"]
    return f"{farthest:.1f} m" + (f" (beyond the radius in {beyond} of {within['of']})" if beyond else "")
