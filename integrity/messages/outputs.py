"""Decisions to messages. What is not a number is left out: absent, never NaN."""

import math

import numpy as np
from google.protobuf.message import Message

from integrity.config import SiteConfig
from integrity.exclusion import Exclusion
from integrity.gnss.gps_time import utc_from_gps
from integrity.gnss.least_squares import Unsolved
from integrity.messages import wayside_pb2 as pb
from integrity.outputs import Alert, EpochReport, HealthReport, Output
from integrity.states import Cause, Outcome, State
from integrity.vouching import MonitoredSignal

STATES = {State.NORMAL: pb.NORMAL, State.SATELLITE_ANOMALY: pb.SATELLITE_ANOMALY, State.NOT_CONFIRMABLE: pb.NOT_CONFIRMABLE}
CAUSES = {cause: pb.CAUSE_UNSPECIFIED if cause is Cause.NONE else getattr(pb, cause.name) for cause in Cause}
OUTCOMES = {Outcome.PASS: pb.PASS, Outcome.NOT_MONITORED: pb.NOT_MONITORED, Outcome.UNKNOWN: pb.UNKNOWN, Outcome.FAIL: pb.FAIL}


def encode_output(output: Output, site: SiteConfig, software: str, boot_id: bytes = b"") -> Message:
    """The message that publishes or records an output; `boot_id` is that of the running station, empty where none runs."""
    match output:
        case EpochReport():
            return encode_report(output)
        case HealthReport():
            return encode_health(output, site, software, boot_id)
        case Alert():
            return encode_alert(output)


def encode_health(health: HealthReport, site: SiteConfig, software: str, boot_id: bytes = b"") -> pb.Health:
    """Health of one epoch or heartbeat. NORMAL covers what trains measured since the epoch before, which was checked too."""
    covers_to_ns = health.gps_time_ns if health.state is State.NORMAL else None
    return pb.Health(
        site=site.site_id,
        boot_id=boot_id,
        sequence=health.sequence,
        gps_time_ns=health.gps_time_ns,
        utc_ns=None if health.gps_time_ns is None else utc_from_gps(health.gps_time_ns),
        issued_mono_ns=health.issued_mono_ns,
        valid_for_ms=health.valid_for_ms,
        covers_from_gps_ns=None if covers_to_ns is None else covers_to_ns - site.epoch_interval_ns + 1,
        covers_to_gps_ns=covers_to_ns,
        state=STATES[health.state],
        cause=CAUSES[health.cause],
        subjects=health.subjects,
        reasons=health.reasons,
        not_monitored=health.not_monitored,
        monitored=health.monitored,
        monitored_signals=[encode_monitored(of) for of in health.vouched],
        excluded_satellites=health.excluded,
        config_sha256=site.config_sha256,
        software=software,
        map_sha256=site.map_sha256,
    )


def encode_monitored(of: MonitoredSignal) -> pb.MonitoredSignal:
    """What a train needs of one signal."""
    return pb.MonitoredSignal(
        signal=of.signal,
        issue=of.issue,
        ephemeris_crc32=of.ephemeris_crc32,
        undetected_range_m=of.undetected_range_m,
        correction_m=of.correction_m,
        correction_sigma_m=of.correction_sigma_m,
        b_m=of.b_m,
    )


def encode_report(report: EpochReport) -> pb.EpochReport:
    """The record of why."""
    verdict = report.verdict
    message = pb.EpochReport(
        gps_time_ns=report.gps_time_ns,
        mono_ns=report.mono_ns,
        state=STATES[report.state],
        cause=CAUSES[report.cause],
        subjects=report.subjects,
        verdict_state=STATES[verdict.state],
        verdict_cause=CAUSES[verdict.cause],
        verdict_subjects=verdict.subjects,
        check=verdict.check,
        statistic=_number(verdict.statistic),
        threshold=_number(verdict.threshold),
        reasons=verdict.reasons,
        triangle_alone=STATES[report.triangle_alone],
        exclusions=[encode_exclusion(x) for x in report.exclusions],
        channels=[
            pb.Channel(receiver=c.receiver, satellite=c.satellite, statistic=c.statistic, threshold=c.threshold) for c in report.channels
        ],
    )
    for name, e_enu_m, satellites, why in zip(
        report.receivers, report.e_enu_m.tolist(), report.satellites_used.tolist(), report.unsolved.tolist(), strict=True
    ):
        east_m, north_m, up_m = (_number(v) for v in e_enu_m)
        vertex = message.triangle.add(receiver=name, east_m=east_m, north_m=north_m, up_m=up_m, satellites=satellites)
        vertex.unsolved = getattr(pb, Unsolved(why).name)
    for name, statistic, threshold, outcome in zip(
        report.check_names, report.statistic.tolist(), report.threshold.tolist(), report.outcome.tolist(), strict=True
    ):
        message.checks.add(name=name, statistic=_number(statistic), threshold=threshold, outcome=OUTCOMES[Outcome(outcome)])
    computed = np.isfinite(report.residual_sigmas)
    for s in np.flatnonzero(computed | report.used):
        b_m = report.b_m[:, s].tolist()
        message.residuals.add(
            signal=report.signals[s],
            used=bool(report.used[s]),
            sigmas=_number(float(report.residual_sigmas[s])),
            b_m=b_m if all(math.isfinite(b) for b in b_m) else [],
        )
    return message


def encode_alert(alert: Alert) -> pb.Alert:
    """One change."""
    return pb.Alert(
        gps_time_ns=alert.gps_time_ns,
        mono_ns=alert.mono_ns,
        before=STATES[alert.before],
        state=STATES[alert.state],
        cause=CAUSES[alert.cause],
        subjects=alert.subjects,
        reasons=alert.reasons,
    )


def encode_exclusion(exclusion: Exclusion) -> pb.Exclusion:
    """One satellite that is out."""
    return pb.Exclusion(
        satellite=exclusion.satellite,
        since_ns=exclusion.since_ns,
        check=exclusion.check,
        statistic=exclusion.statistic,
        threshold=exclusion.threshold,
        clean_since_ns=exclusion.clean_since_ns,
        clean_epochs=exclusion.clean_epochs,
    )


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
