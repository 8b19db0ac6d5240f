"""Commands on recordings: import, replay, inject, simulate, and looking after the files."""

import json
import math
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from integrity.errors import ConfigError, DecodeError
from integrity.events import Event

if TYPE_CHECKING:
    from recordings.replay import Replayable

commands = typer.Typer(no_args_is_help=True)
recording_commands = typer.Typer(no_args_is_help=True, help="Look at a recording, check it, save what is whole of it.")

Recording = Annotated[Path, typer.Argument(help="A recording (.mcap).", show_default=False)]
Output = Annotated[Path, typer.Option("--output", "-o", help="Where to write.", show_default=False)]
From = Annotated[str | None, typer.Option("--from", help="First epoch, UTC: 2010-03-18T05:00:00Z.")]
To = Annotated[str | None, typer.Option("--to", help="End, UTC, not included.")]
Json = Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")]


def talk(text: str) -> None:
    """To people: stderr, so that stdout stays data."""
    print(text, file=sys.stderr)


def watched(events: Sequence[Event]) -> Iterator[Event]:
    """The events one by one; on a terminal, after two seconds, with a word on stderr of how far they are."""
    began, said = time.monotonic(), False
    for i, event in enumerate(events):
        if i % 500 == 0 and sys.stderr.isatty() and time.monotonic() - began > 2.0:
            print(f"\rdeciding, {100 * i // len(events)} %", end="", file=sys.stderr, flush=True)
            said = True
        yield event
    if said:
        print("\r" + " " * 20 + "\r", end="", file=sys.stderr, flush=True)


@commands.command("import")
def import_(
    site: Annotated[Path, typer.Option("--site", help="Site file.", show_default=False)],
    receiver: Annotated[list[str], typer.Option("--receiver", help="A=FILE; repeat for B and C, and for further files.")],
    output: Output,
    nav: Annotated[list[Path] | None, typer.Option("--nav", help="Navigation file; repeatable.")] = None,
    start: Annotated[str | None, typer.Option("--start", help="First epoch, UTC.")] = None,
    end: Annotated[str | None, typer.Option("--end", help="End, UTC, not included.")] = None,
) -> None:
    """RINEX files or u-blox logs of three receivers to one recording, decided on the way.

    A log brings its own ephemerides; RINEX needs --nav.

    Example: wayside import --site site.toml --receiver A=a.10o.gz --receiver B=b.10o --receiver C=c.ubx --nav brdc.10n.gz -o day.mcap
    """
    from recordings.importer import import_files, read_files
    from recordings.replay import decide_and_record, window
    from recordings.rinex.navigation import read_navigation
    from recordings.site_file import load_site
    from recordings.ubx_files import UbxLog

    site_file = load_site(site)
    start_ns, end_ns = window(start, end)
    files = _files_of_receivers(receiver, site_file.config.receiver_names)
    observations = {name: read_files(paths, name) for name, paths in files.items()}
    navigation = [read_navigation(path) for path in nav or []]
    logs = [file for group in observations.values() for file in group if isinstance(file, UbxLog)]
    if not navigation and not logs:
        raise ConfigError(
            "no navigation file: give the broadcast ephemerides of the day with --nav FILE; only UBX logs bring their own (RXM-SFRBX)"
        )
    imported = import_files(site_file.config, observations, navigation, start_ns, end_ns)
    for warning in imported.warnings:
        talk(f"warning: {warning}")
    counted = {"dropped": imported.dropped, "passed over": imported.passed_over}
    metadata = {"import": {what.replace(" ", "_"): json.dumps(counts, sort_keys=True) for what, counts in counted.items()}}
    _, monitor = decide_and_record(output, site_file, imported.events, metadata, watch=watched)
    if any(log.words for log in logs) and monitor.snapshot().assembler.klobuchar is None:
        talk("warning: no Klobuchar terms came in the logs: the ionosphere stays in the ranges; give a navigation file with --nav")
    for what, counts in counted.items():
        for name, reasons in counts.items():
            if reasons:
                talk(f"receiver {name}: {what} {', '.join(f'{n} x {reason}' for reason, n in reasons.items())}")
    talk(f"{output}: {imported.epochs} aligned epochs")


@commands.command()
def replay(
    recording: Recording,
    site: Annotated[Path | None, typer.Option("--site", help="Another site file than the recorded one.")] = None,
    settings: Annotated[list[str] | None, typer.Option("--set", help="KEY=VALUE of the site file; repeatable.")] = None,
    from_: From = None,
    to: To = None,
    block_epochs: Annotated[int, typer.Option("--block-epochs", min=1, help="Epochs decided at a time; never changes a decision.")] = 1000,
    epochs: Annotated[Path | None, typer.Option("--epochs", help="CSV with a row per epoch.")] = None,
    out: Annotated[Path | None, typer.Option("--out", help="A new recording with these decisions.")] = None,
    diff: Annotated[bool, typer.Option("--diff", help="Compare with the recorded decisions; exit 1 on any difference.")] = False,
    calibrate: Annotated[Path | None, typer.Option("--calibrate", help="Measure the site's sigmas: an [integrity] table (TOML).")] = None,
    plot: Annotated[Path | None, typer.Option("--plot", help="Picture of triangle, errors and states (SVG).")] = None,
    fail_on: Annotated[str | None, typer.Option("--fail-on", help="'alert': exit 3 if anything but NORMAL after start-up.")] = None,
    as_json: Json = False,
) -> None:
    """Decide a recording again, and say why.

    Example: wayside replay day.mcap --set integrity.on_satellite_fault=exclude --plot day.svg
    """
    from recordings import replay as again
    from recordings.diff import differences, recorded_reports
    from recordings.explain import explain
    from recordings.reader import read_recording
    from recordings.site_file import load_site, override_site
    from recordings.summary import Summary, alerted, as_json_object, in_window, silences, write_epochs_csv

    if fail_on not in (None, "alert"):
        raise ConfigError(f"--fail-on {fail_on}: the only choice is alert")
    contents = read_recording(recording)
    start_ns, end_ns = again.window(from_, to)
    chosen = load_site(site) if site else again.recorded_site(contents)
    if settings:
        chosen = override_site(chosen, settings)
    todo = again.replayable(contents, chosen, start_ns, end_ns)
    began = time.perf_counter()
    outputs, monitor = again.decide(todo.site, watched(todo.events), todo.snapshot, block_epochs)
    wall_s = time.perf_counter() - began
    reports, health = in_window(outputs, start_ns, end_ns)
    dropped = again.recorded_drops(contents)
    for name, count in monitor.dropped.items():
        if count:
            dropped[name]["not aligned"] = count
    summary = Summary(recording.name, todo.site, monitor.limits, reports, health, dropped, wall_s)

    if out:
        kept = {name: values for name, values in contents.metadata.items() if name in ("import", "truth")}
        again.decide_and_record(out, todo.site, todo.events, kept, todo.snapshot, boot=todo.boot)
        talk(f"{out}: recorded with these decisions")
    if epochs:
        write_epochs_csv(epochs, reports, chosen.config.receiver_names)
    if calibrate:
        _calibrate(calibrate, recording, todo, start_ns, end_ns)
    if plot:
        from recordings.report.plot import replay_svg

        if not reports:
            raise ConfigError("there is no epoch in the window: nothing to draw")
        title = f"{recording.name}, site {chosen.config.site_id}"
        plot.write_text(replay_svg(title, monitor.triangle, monitor.limits, reports, silences(summary)), "utf-8")
    print(json.dumps(as_json_object(summary), indent=2) if as_json else explain(summary), end="\n" if as_json else "")
    if diff:
        lines = differences(recorded_reports(contents, start_ns, end_ns), reports)
        for line in lines[:20]:
            talk(line)
        if len(lines) > 20:
            talk(f"... and {len(lines) - 20} more")
        talk(f"{len(lines)} of {len(reports)} epochs decided differently" if lines else f"all {len(reports)} epochs decided as recorded")
        if lines:
            raise typer.Exit(1)
    if fail_on == "alert" and alerted(summary):
        raise typer.Exit(3)


def _calibrate(output: Path, recording: Path, todo: "Replayable", start_ns: int | None, end_ns: int | None) -> None:
    from recordings.calibrate import calibrate as measured
    from recordings.calibrate_samples import samples
    from recordings.calibrate_text import integrity_table, warnings

    found = measured(samples(todo.site.config, todo.events, todo.snapshot, start_ns, end_ns), todo.site.config)
    output.write_text(integrity_table(found, todo.site, recording.name), "utf-8")
    for warning in warnings(found):
        talk(f"WARNING: {warning}")
    talk(f"{output}: sigmas measured on {found.epochs} epochs, {found.hours:.1f} h; replace the [integrity] table of the site file with it")


@commands.command()
def inject(
    recording: Recording,
    faults: Annotated[Path, typer.Option("--faults", help="Fault file (TOML).", show_default=False)],
    output: Output,
) -> None:
    """A recording with faults in it, decided anew; the truth goes along as metadata.

    Example: wayside inject day.mcap --faults spoofing.toml -o spoofed.mcap
    """
    from recordings.faults import inject as with_faults
    from recordings.faults import parse_faults
    from recordings.reader import read_recording
    from recordings.replay import decide_and_record, first_epoch_ns, replayable

    contents = read_recording(recording)
    todo = replayable(contents)
    text = _text(faults)
    parsed = parse_faults(text, str(faults), first_epoch_ns(todo), todo.site.config)
    events = with_faults(todo.events, parsed, todo.site.config, snapshot=todo.snapshot)
    kept = {name: values for name, values in contents.metadata.items() if name == "import"}
    decide_and_record(output, todo.site, events, kept | {"truth": {"faults": text}}, todo.snapshot, watched, todo.boot)
    talk(f"{output}: {len(parsed)} fault{'s' if len(parsed) != 1 else ''} injected")


@commands.command()
def simulate(
    scenario: Annotated[Path, typer.Argument(help="Scenario file (TOML).", show_default=False)],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Where to write a recording.", show_default=False)] = None,
    serve: Annotated[str | None, typer.Option("--serve", help="HOST:PORT of the first receiver, the others follow; 0: free ports.")] = None,
    speed: Annotated[float, typer.Option("--speed", help="Times real time, of --serve.")] = 1.0,
) -> None:
    """What never happened: simulated satellites, receivers and faults, as a recording (truth as metadata), as live receivers, or both.

    Example: wayside simulate recordings/samples/triangle.toml -o triangle.mcap
    """
    from recordings.faults import at_link, parse_faults
    from recordings.faults import inject as with_faults
    from recordings.replay import decide_and_record, redacted
    from recordings.simulate.observations import antennas_of
    from recordings.simulate.observations import simulate as simulated
    from recordings.simulate.rtcm import as_sent
    from recordings.simulate.scenario import parse_scenario

    if output is None and serve is None:
        raise ConfigError("nothing to do: give -o OUT.mcap for a recording, --serve HOST:PORT for live receivers, or both")
    if not 0.0 < speed < math.inf:
        raise ConfigError(f"--speed {speed:g}: expected a number above 0; 1 is real time")
    text = _text(scenario)
    story = parse_scenario(text, str(scenario))
    site = story.site
    address = None if serve is None else _first_address(serve, len(site.config.receivers))
    faults = parse_faults(story.faults, str(scenario), story.start_ns, site.config) if story.faults.strip() else ()
    measured = simulated(site.config, story.start_ns, story.duration_s, story.rate_hz, story.seed, frequencies=story.frequencies)
    before_receivers = [fault for fault in faults if not at_link(fault)]
    sent = as_sent(with_faults(measured, before_receivers, site.config), antennas_of(site.config), site.config.protocols)
    events = with_faults(sent, [fault for fault in faults if at_link(fault)], site.config)
    if output is not None:
        truth = {"faults": story.faults.strip() + "\n", "scenario": redacted(text)}
        decide_and_record(output, site, events, {"truth": truth}, watch=watched)
        talk(f"{output}: simulated, {len(faults)} fault{'s' if len(faults) != 1 else ''}")
    if address is not None:
        _serve(events, site.config.receiver_names, *address, speed)


def _first_address(text: str, receivers: int) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not host or not port.isdecimal() or int(port) > 65_536 - receivers:
        raise ConfigError(
            f"--serve {text}: expected HOST:PORT with {receivers} ports from there on, such as 127.0.0.1:20001; port 0 takes free ones"
        )
    return host, int(port)


def _serve(events: Sequence[Event], receivers: Sequence[str], host: str, port: int, speed: float) -> None:
    """Addresses are talk where the caller has chosen them, and data where they were free ports."""
    from recordings.simulate.server import ReceiverServer

    with ReceiverServer(receivers, host, port) as server:
        for receiver, (at, chosen) in server.addresses.items():
            print(f"{receiver} at tcp://{f'[{at}]' if ':' in at else at}:{chosen}", file=sys.stderr if port else sys.stdout, flush=True)
        talk("waiting for a client of every receiver")
        server.wait_for_clients()
        talk("started")
        server.play(events, speed)
    talk("ended")


@recording_commands.command("info")
def info(recording: Recording, as_json: Json = False) -> None:
    """What is in a recording.

    Example: wayside recording info day.mcap
    """
    from integrity.messages import wayside_pb2 as pb
    from recordings.reader import salvage
    from recordings.replay import beginning, span_utc

    contents = salvage(recording)
    head = beginning(contents)
    start, end = span_utc(contents)
    facts: dict[str, Any] = {
        "recording": recording.name,
        **({"train": head.train} if isinstance(head, pb.TrainStarted) else {"site": head.site}),
        "software": head.software,
        "config_sha256": head.config_sha256,
        "start": start,
        "end": end,
        "bytes": recording.stat().st_size,
        "messages": contents.counts(),
        "truth": contents.metadata.get("truth", {}).get("faults"),
        "damage": contents.damage or None,
    }
    if as_json:
        print(json.dumps(facts, indent=2))
        return
    for key, value in facts.items():
        if value is None:
            continue
        if key == "truth":
            print("faults injected:\n" + "\n".join(f"  {line}" for line in value.strip().splitlines()))
        elif isinstance(value, dict):
            print(f"{key}: " + ", ".join(f"{topic} {n}" for topic, n in sorted(value.items())))
        else:
            print(f"{key}: {value}")


@recording_commands.command("check")
def check(recording: Recording, as_json: Json = False) -> None:
    """Read a recording through, checksums and all; exit 1 where it is not whole.

    Example: wayside recording check day.mcap
    """
    from recordings.reader import salvage
    from recordings.replay import complaints

    contents = salvage(recording)
    found = complaints(contents)
    if as_json:
        print(json.dumps({"recording": recording.name, "whole": not found, "complaints": found}, indent=2))
    else:
        print("\n".join(found) if found else f"{recording.name}: whole, {len(contents.entries)} messages")
    if found:
        raise typer.Exit(1)


@recording_commands.command("recover")
def recover(recording: Recording, output: Output) -> None:
    """Write a whole recording of everything that can still be read from one that was cut or damaged.

    Example: wayside recording recover cut.mcap -o saved.mcap
    """
    from recordings.replay import recover as save
    from recordings.replay import span_utc

    contents = save(recording, output)
    damage = f" ({contents.damage})" if contents.damage else ", nothing was missing"
    talk(f"{output}: {len(contents.entries)} messages up to {span_utc(contents)[1]}{damage}")


def _files_of_receivers(assignments: list[str], names: tuple[str, ...]) -> dict[str, list[Path]]:
    files: dict[str, list[Path]] = {name: [] for name in names}
    for assignment in assignments:
        name, equals, path = assignment.partition("=")
        if not equals or name not in files:
            raise ConfigError(f"--receiver {assignment}: expected NAME=FILE with NAME one of {', '.join(names)}")
        files[name].append(Path(path))
    missing = [name for name, paths in files.items() if not paths]
    if missing:
        raise ConfigError(f"no file for receiver {', '.join(missing)}: add --receiver {missing[0]}=FILE")
    return files


def _text(path: Path) -> str:
    try:
        return path.read_text("utf-8")
    except UnicodeDecodeError as error:
        raise DecodeError(f"{path}: not UTF-8 text ({error.reason} at byte {error.start})") from None
