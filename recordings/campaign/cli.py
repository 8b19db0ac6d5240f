"""The command that plays every threat and says what became of it."""

import json
import os
import platform
import sys
import time
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer

SAMPLE_SITE = Path(__file__).resolve().parents[1] / "samples" / "site.toml"
START = "2026-03-02T00:00:00Z"
STAGE_S = 1800.0
SMALL_STAGES, SMALL_TRIALS = 2, 2
FULL_STAGES, FULL_TRIALS = 4, 6

Site = Annotated[Path | None, typer.Argument(metavar="SITE", help="Site file; by default the sample's.", show_default=False)]
Recordings = Annotated[
    list[Path] | None, typer.Option("--recording", help="A recording in which nothing was wrong, to play on; may be given several times.")
]
Threats = Annotated[list[str] | None, typer.Option("--threat", help="Only this one, such as SV-STEP; may be given several times.")]
Jobs = Annotated[int, typer.Option("--jobs", min=1, help="Processes.")]
Full = Annotated[bool, typer.Option("--full", help=f"{FULL_STAGES} simulated stages with {FULL_TRIALS} trials of each size on each.")]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Of everything drawn.")]
Plot = Annotated[Path | None, typer.Option("--plot", metavar="OUT.svg", help="A picture of all of it (SVG).", show_default=False)]
Out = Annotated[
    Path | None,
    typer.Option("-o", "--out", metavar="DIR", help="Write results.json, .svg and .md there.", show_default=False),
]
Table = Annotated[bool, typer.Option("--table", help="A Markdown table on stdout, a line a threat.")]
Json = Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")]


def campaign(
    site: Site = None,
    recording: Recordings = None,
    threat: Threats = None,
    jobs: Jobs = 1,
    full: Full = False,
    seed: Seed = 1,
    plot: Plot = None,
    out: Out = None,
    table: Table = False,
    as_json: Json = False,
) -> None:
    """Every fault of the catalogue, in every size, on streams in which nothing was wrong: what is caught, how soon, and who is named.

    Without recordings the streams are simulated receivers of the site. Where no threat is chosen, also what trials cannot reach: rare
    misses and wrong names, months and years of false alarms. The same seed, the same result, however many processes.

    Example: wayside campaign --jobs 2 --plot campaign.svg
    """
    from integrity.gnss.gps_time import DAY_S, NS_PER_S, parse_utc
    from recordings.campaign.campaign import Plan, Played, Recorded, Simulated, stage_from, tolerance_m
    from recordings.campaign.campaign import campaign as played_in
    from recordings.campaign.picture import campaign_svg
    from recordings.campaign.summary import as_json_object, explain, refuse_unknown, took
    from recordings.campaign.table import table_md
    from recordings.campaign.theory import FULL, SMALL, theory
    from recordings.site_file import load_site

    refuse_unknown(threat or ())
    stages, trials = (FULL_STAGES, FULL_TRIALS) if full else (SMALL_STAGES, SMALL_TRIALS)
    config = load_site(site or SAMPLE_SITE).config
    start_ns = parse_utc(START)
    simulated = [Simulated(config, start_ns + k * 3607 % DAY_S * NS_PER_S, STAGE_S, seed + k) for k in range(stages)]
    plan = Plan(tuple(map(Recorded, recording)) if recording else tuple(simulated), trials, seed)
    pictures = [path for path in (plot, out and out / "results.svg") if path]
    for path in pictures:
        path.parent.mkdir(parents=True, exist_ok=True)  # before hours of work, not after
    began_s = time.monotonic()
    played: list[Played] = []
    for piece in played_in(plan, jobs, threat or ()):
        played += piece
        if time.monotonic() - began_s > 2.0:
            _progress(f"{len(played)} trials")
    found = as_json_object(played, plan)
    if not threat:
        _progress("what trials cannot reach")
        of_site = stage_from(plan.sources[0]).site
        found["theory"] = theory(of_site, tolerance_m(of_site), FULL if full else SMALL, seed, jobs)
    _progress("")
    found["machine"] = (
        f"{platform.machine()}, {os.cpu_count()} processors, {jobs} in use, Python {platform.python_version()}, numpy {version('numpy')}"
    )
    found["wall_s"] = round(time.monotonic() - began_s, 1)
    text = json.dumps(found, indent=2)
    for path in pictures:
        path.write_text(campaign_svg(found), "utf-8")
    if out:
        (out / "results.json").write_text(text + "\n", "utf-8")
        (out / "results.md").write_text(table_md(found), "utf-8")
    print(text if as_json else table_md(found) if table else f"{explain(found)}\n{took(found)}")


def _progress(words: str) -> None:
    """One line that is written over, for people only."""
    if sys.stderr.isatty():
        print(f"\r{words:<40}\r", end="", file=sys.stderr, flush=True)
