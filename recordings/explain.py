"""A replay in words: one calm line per change, then the evidence."""

from collections import Counter
from collections.abc import Sequence

from integrity.gnss.gps_time import format_utc
from integrity.outputs import EpochReport
from integrity.states import Cause, State
from recordings.summary import Summary, episodes, exclusions, receivers

WORDS = {
    Cause.NOT_READY: "starting: not enough clean epochs yet",
    Cause.MAINTENANCE: "maintenance",
    Cause.SELF_TEST: "the self-test failed",
    Cause.DATA: "data missing, frozen or repeated",
    Cause.JAMMING: "jamming: signals sink at two or more receivers",
    Cause.SPOOFING: "spoofing: the triangle went elsewhere",
    Cause.CONSTELLATION: "a constellation is wrong",
    Cause.SATELLITE: "a satellite is wrong",
    Cause.RECEIVER: "a receiver is faulty",
    Cause.CLOCK: "GNSS time left the independent clock",
    Cause.AMBIGUOUS: "something is wrong, and naming it could be wrong too",
}


def explain(summary: Summary) -> str:
    """Several lines for a terminal."""
    config, reports = summary.site.config, summary.reports
    if not reports:
        return f"site {config.site_id}: no aligned epoch in the window; nothing can be confirmed\n"
    states, alone = Counter(r.state for r in reports), Counter(r.triangle_alone for r in reports)
    lines = [
        f"site {config.site_id} ({config.frame}), receivers {', '.join(config.receiver_names)}, rule {config.integrity.rule}, "
        f"a satellite fault leads to {config.integrity.on_satellite_fault}",
        f"{format_utc(reports[0].gps_time_ns)} to {format_utc(reports[-1].gps_time_ns)}, {len(reports)} epochs, "
        f"decided in {summary.wall_s:.2f} s; tolerance radius {summary.limits.radius_m:.2f} m",
        "",
    ]
    previous_end = ""
    for episode in episodes(summary):
        if previous_end and episode["start"] != previous_end:
            lines.append(f"  {_clock(previous_end)}  NORMAL")
        lines.append(f"  {_clock(episode['start'])}  {episode['state']:<17}  {_why(episode)}")
        previous_end = episode["end"]
    if reports[-1].state is State.NORMAL:
        lines.append(f"  {_clock(previous_end) if previous_end else _clock(format_utc(reports[0].gps_time_ns))}  NORMAL")
    listed = exclusions(reports)
    if listed:
        lines.append("")
        lines += [
            f"  {_clock(x['start'])} to {_clock(x['end'])}  {x['satellite']} excluded: "
            f"{x['check']} {x['statistic']:.4g} > {x['threshold']:.4g}" + "; still out" * _still_out(x, reports[-1])
            for x in listed
        ]
    lines += ["", f"  {'published':<16}" + _counts(states), f"  {'triangle alone':<16}" + _counts(alone), ""]
    for name, r in receivers(reports, config.receiver_names).items():
        errors = (
            "never solved"
            if r["h_rms_m"] is None
            else f"horizontal rms {r['h_rms_m']:.2f} m, max {r['h_max_m']:.2f} m, up rms {r['v_rms_m']:.2f} m"
        )
        dropped = sum(summary.dropped.get(name, {}).values())
        lines.append(f"  receiver {name}: solved {r['solved']} of {r['epochs']}; {errors}; {dropped} not aligned or unreadable")
    return "\n".join(lines) + "\n"


def _why(episode: dict[str, object]) -> str:
    cause = Cause(str(episode["cause"]))
    subjects = episode["subjects"]
    who = f" ({', '.join(map(str, subjects))})" if isinstance(subjects, list) and subjects else ""
    if episode["statistic"] is None:
        return f"{WORDS[cause]}{who}"
    return f"{WORDS[cause]}{who}; {episode['check']} {episode['statistic']:.4g} > {episode['threshold']:.4g}"


def _still_out(exclusion: dict[str, object], last: EpochReport) -> bool:
    """Whether a stay on the exclusion list goes on after the last epoch."""
    return exclusion["satellite"] in last.excluded and exclusion["end"] == format_utc(last.gps_time_ns)


def changed(state: State, cause: Cause, subjects: Sequence[str], reasons: Sequence[str]) -> str:
    """One change of the published state, on a line; at most two of the reasons, with the number of the others."""
    if state is State.NORMAL:
        return str(state)
    who = f" ({', '.join(subjects)})" if subjects else ""
    shown = list(reasons[:2]) + [f"{len(reasons) - 2} more reasons"] * (len(reasons) > 2)
    return "; ".join([f"{state:<17}  {WORDS[cause]}{who}", *shown])


def _clock(utc: str | None) -> str:
    return utc[11:].removesuffix("Z").ljust(8) if utc else "--:--:--"


def _counts(counts: Counter[State]) -> str:
    return ", ".join(f"{state} {counts[state]}" for state in State)
