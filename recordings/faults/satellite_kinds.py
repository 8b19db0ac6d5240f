"""The kinds of faults that act on all receivers: of a satellite, of a constellation, of the ionosphere.

One class each: its parameters as they stand in a `[[fault]]` table, and what it does. See `parameters` for what they may be.
"""

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from recordings.faults.parameters import Displacement, DropDb, RampS, RateMps, RateMps2, Receivers, Satellite, SizeM, System
from recordings.site_schema import Section

MOST_FRONT_DELAY_M = 200.0  # threat models end at 50 m; a bound of plausibility


class SatelliteStep(Section):
    """The range to a satellite is longer by `size_m`, for all receivers alike, on code and carrier."""

    kind: ClassVar = "satellite_step"
    satellite: Satellite
    size_m: SizeM


class SatelliteRamp(Section):
    """The range to a satellite grows by `rate_mps` more than it should, for all receivers alike, on code, carrier and Doppler."""

    kind: ClassVar = "satellite_ramp"
    satellite: Satellite
    rate_mps: RateMps


class SatelliteAcceleration(Section):
    """The range to a satellite grows by half of `rate_mps2` times the square of the time, on code, carrier and Doppler: a clock that
    runs away, as that of SVN 27 did in March 1998."""

    kind: ClassVar = "satellite_acceleration"
    satellite: Satellite
    rate_mps2: RateMps2


class CodeCarrierDivergence(Section):
    """The codes of a satellite drift away from its carriers by `rate_mps`, on all its signals and for all receivers alike.

    Carriers and Doppler stay: in the threat of this name it is the payload that lets code and carrier go apart, and a fault in which
    the carrier runs away is an acceleration or a ramp. (The ionosphere, which moves both, is `iono_front`.) Source: Gleason and
    Gebre-Egziabher, GNSS Applications and Methods, 2009, and those who cite it for GAST-D and GAST-F; which of the two moves is our choice.
    """

    kind: ClassVar = "code_carrier_divergence"
    satellite: Satellite
    rate_mps: RateMps


class CodeBias(Section):
    """The codes of a satellite are longer by `size_m` at some receivers (at all, where none is named); carriers and Doppler stay.

    Of all: its signal is deformed, and receivers of one bandwidth and correlator see that alike. Of some: they are of another bandwidth,
    or hear an echo instead of the signal. Source of the threat: Phelts, Multicorrelator Techniques, 2001 (evil waveforms); sizes by ICAO's
    models are metres.
    """

    kind: ClassVar = "code_bias"
    satellite: Satellite
    size_m: SizeM
    receivers: Receivers | None = None


class LowPower(Section):
    """A satellite sends weaker by `drop_db`, reached in the course of `ramp_s` (at once without it), on all its signals: noise grows, what
    falls below the tracking threshold is lost."""

    kind: ClassVar = "low_power"
    satellite: Satellite
    drop_db: DropDb
    ramp_s: RampS = 0.0


class WrongEphemeris(Section):
    """A satellite broadcasts an orbit that is displaced by `offset_m`, or a clock that is off by it; its ranges are as they were."""

    kind: ClassVar = "wrong_ephemeris"
    satellite: Satellite
    offset_m: SizeM
    direction: Annotated[Literal["along", "cross", "radial", "clock"], Field(description='"along", "cross", "radial" or "clock"')]


class ConstellationClock(Section):
    """The ranges to all satellites of a system are longer by `size_m`, on code and carrier: its time is off."""

    kind: ClassVar = "constellation_clock"
    system: System
    size_m: SizeM


class ConstellationFrame(Section):
    """The orbits that a system broadcasts are all displaced by `offset_ecef_m` against those that its satellites fly.

    What is broadcast stays as it was recorded, and the ranges become those to satellites that fly where it does not say: no orbit of Kepler
    elements stands still in ECEF beside another one, and a frame that is off is so in every set, so that no set changes. Whoever believes
    the broadcast finds itself displaced by the offset.
    """

    kind: ClassVar = "constellation_frame"
    system: System
    offset_ecef_m: Displacement


class IonoFront(Section):
    """A front in the ionosphere moves over the site: behind its edge the slant delay on L1 grows by `slope_mm_per_km` over `width_km`, and
    stays. Codes come later, carriers earlier, by the square of the wavelength more on other bands.

    The front is straight, reaches to both sides without end, and moves at `speed_mps` towards `azimuth_deg`, where signals pierce it
    350 km above the ground. When the fault starts, its edge is at `edge_km`, from the middle of the site towards the azimuth; without it at
    the hindmost satellite above the site's elevation mask, so that one after the other comes under it and none of a sudden.
    Source of the model: Datta-Barua et al., Journal of Aircraft 47(4), 2010 (the threat model of GBAS for CONUS).
    """

    kind: ClassVar = "iono_front"
    slope_mm_per_km: Annotated[float, Field(gt=0, le=2000, description="millimetres per kilometre, above 0 and at most 2000")]
    width_km: Annotated[float, Field(gt=0, le=1000, description="kilometres, above 0 and at most 1000")]
    speed_mps: Annotated[float, Field(ge=0, le=2000, description="metres per second, from 0 to 2000")]
    azimuth_deg: Annotated[float, Field(ge=-360, le=360, description="where to, in degrees clockwise from north, from -360 to 360")]
    edge_km: Annotated[
        float | None, Field(ge=-5000, le=5000, description="kilometres from the site towards the azimuth, from -5000 to 5000")
    ] = None

    @model_validator(mode="after")
    def _a_delay_that_can_be(self) -> "IonoFront":
        if self.delay_m > MOST_FRONT_DELAY_M:
            raise ValueError(
                f"the front delays by {self.delay_m:g} m, expected at most {MOST_FRONT_DELAY_M:g}: "
                f"with this slope make width_km {1e3 * MOST_FRONT_DELAY_M / self.slope_mm_per_km:g} or less"
            )
        return self

    @property
    def delay_m(self) -> float:
        """Behind the whole front, on L1."""
        return 1e-3 * self.slope_mm_per_km * self.width_km
