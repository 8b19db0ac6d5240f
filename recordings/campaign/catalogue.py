"""The threats: which fault in which sizes, and what a good answer to it is. Sizes after section 3 of the notes on ground integrity.

Satellite, receivers, direction and moment are drawn anew for every trial; all sizes are played equally often, those below what can be
detected included.

Of the threats there, these are not played, and why:
EPH-A1    a manoeuvre under an old orbit is, in the ranges, the ramp of SV-RAMP: 0.01 to 0.5 m/s.
EPH-A2    flagged unhealthy, the satellite is screened out before anything looks at it: a test of screening, without sizes.
EPH-SPF   a transmitter's invalid orbit is that of EPH-B, for all satellites that it repeats.
UTC/NAV   nothing here reads a UTC term: UTC comes from the station's computer. Weeks and times of a set that are wrong are refused by its
          plausibility, or displace the satellite by kilometres, as EPH-B does. Wrong ionospheric terms: no fault of that kind yet.
RX-MOVE   of 1 mm/h, and a mast that leans: days, not minutes; the tests of slow shifts hold them.
RX-CFG    coordinates 0, 0, 0 and equal ones: refused before anything starts. A wrong datum is, in every epoch but its first, SPF-ALL;
          antennas swapped are CFG-SWAP.
RX NaN    measurements that are none are refused where they are decoded.
MP        that repeats each sidereal day: days; its size and period are those of MP and MP-SLOW.
JAM chirp a sweep of microseconds is, at one measurement a second, the C/N0 that it leaves: JAM-ALL.
SPF-TIME  a push of 10 ns/s, of minutes, and the cause `clock`: a site needs a clock beside GNSS for it; the sample's has none, and what is
          played as SPF-TIME is that nothing else is said then.
MEAC      from two antennas, in turns: the repeater here has one antenna.
SBAS-DNU  no station here uses SBAS.
NET       messages on their way to trains: the tests of the publisher and of the train client.
MIX       at start-up and during a survey: before NORMAL there is nothing to lose; a satellite with a receiver is MIX-SV-RX.
"""

from recordings.campaign.receiver_threats import RECEIVER_THREATS
from recordings.campaign.satellite_threats import SATELLITE_THREATS

CATALOGUE = SATELLITE_THREATS + RECEIVER_THREATS
