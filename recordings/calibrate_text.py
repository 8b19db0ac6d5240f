"""What was measured, as the `[integrity]` table of a site file: each value with what it rests on, and above all what is wrong."""

import tomllib

from integrity import SOFTWARE
from integrity.gnss.gps_time import format_utc
from recordings.calibrate import AXES, Calibration, Mean, Ranges
from recordings.calibrate_statistics import Correlation, Size
from recordings.site_file import SiteFile
from recordings.toml_file import format_value


def warnings(found: Calibration) -> list[str]:
    """What must be dealt with before the values are used."""
    off = [
        f"{_mean(mean)}: beyond its bound. "
        + (
            "All three are displaced alike: another frame or epoch of the coordinates, or the ionosphere of these hours"
            if mean.what.startswith("the whole")
            else "Survey this antenna again"
        )
        + "; no sigma was made larger for it"
        for mean in found.means
        if mean.significant
    ]
    refused = sum(count for reason, count in found.left_out.items() if reason != "starting up")
    if refused > 0.01 * found.epochs:
        off.append(f"{refused} epochs were not sound and are left out: if these were false alarms, the true tails are longer than measured")
    return off


def integrity_table(found: Calibration, site: SiteFile, recording: str) -> str:
    """The table, whole: what the site promised before is kept, what was measured is replaced."""
    before = tomllib.loads(site.text).get("integrity", {})
    left_out = ", ".join(f"{n} x {reason}" for reason, n in sorted(found.left_out.items())) or "nothing"
    head = [
        f"Measured by {SOFTWARE} on {recording}, site {site.config.site_id}:",
        f"{format_utc(found.start_ns)} to {format_utc(found.end_ns)}; {found.epochs} sound epochs, {found.hours:.1f} h.",
        f"Left out: {left_out}.",
        "Each sigma is the larger of the 95 % upper bound of a Gauss-Markov process and the smallest zero-mean Gaussian above every tail",
        "seen. Beyond the tails seen the Gaussian is a promise, and another day's ionosphere was not there: measure on many days, keep the",
        "largest. Correlation times are lower bounds, which promise more looks.",
        "",
        *(f"Mean displacement of {_mean(mean)}" for mean in found.means),
        *(f"WARNING: {text}." for text in warnings(found)),
    ]
    c, d = found.correlation_common, found.correlation_differential
    notes = {
        "sigma_common_m": [_size(axis, s) for axis, s in zip(AXES[:2], found.common, strict=False)],
        "sigma_common_up_m": [_size("up", found.common[2])],
        "sigma_differential_m": [_size(f"{axis}, worst receiver", s) for axis, s in zip(AXES[:2], found.differential, strict=False)],
        "sigma_differential_up_m": [_size("up, worst receiver", found.differential[2])],
        "sigma_range_m": _ranges(found.ranges, found.correlation_range),
        "sigma_range_differential_m": _ranges(found.differential_ranges, found.correlation_range_differential),
        "correlation_common_s": [_correlation(c)],
        "correlation_differential_s": [_correlation(d), f"from epoch to epoch {d.lag_one:.3f}: the shorter time counts"],
    }
    lines = [f"# {line}".rstrip() for line in head] + ["", "[integrity]"]
    lines += [f"{key} = {format_value(value)}" for key, value in before.items() if key not in found.values]
    for key, value in found.values.items():
        lines += [f"# {note}" for note in notes.get(key, [])] + [f"{key} = {format_value(value)}"]
    return "\n".join(lines) + "\n"


def _mean(mean: Mean) -> str:
    parts = (f"{axis} {m:+.2f} +- {b:.2f}" for axis, m, b in zip(AXES, mean.mean_m, mean.bound_m, strict=True))
    return f"{mean.what}: {', '.join(parts)} m (95 %)"


def _size(what: str, of: Size) -> str:
    return (
        f"{what}: estimate {of.estimate:.3f}, 95 % bound {of.upper:.3f}, overbound of the tails {of.overbound:.3f}; "
        f"{of.epochs} epochs, {of.hours:.1f} h, {of.effective:.0f} effective samples"
    )


def _ranges(of: Ranges, correlation: Correlation) -> list[str]:
    first = f"above the bound of every elevation, times {of.stretch:.2f} for the tails; 1/e time {correlation.tau_s:.3g} s"
    return [
        first,
        *(
            f"{x.low_deg:.0f} to {x.high_deg:.0f} deg: estimate {x.estimate_m:.3f}, 95 % bound {x.upper_m:.3f}; {x.samples} ranges, "
            f"{x.effective:.0f} effective samples"
            for x in of.bins
        ),
    ]


def _correlation(of: Correlation) -> str:
    return f"1/e time {of.tau_s:.3g} s, 95 % bounds {of.lower_s:.3g} and {of.upper_s:.3g} s"
