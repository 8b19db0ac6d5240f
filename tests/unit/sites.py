"""A sound site file for tests: three antennas 120 m apart (equilateral) at a surveyed point in Tokyo."""

A_ECEF_M = (-3962108.673, 3381309.574, 3668678.638)  # truth of the cssrlib-data recording
B_ECEF_M = (-3962186.571, 3381218.295, 3668678.638)  # 120 m east of A
C_ECEF_M = (-3962101.898, 3381224.913, 3668763.412)  # 60 m east, 103.923 m north of A

SITE = """\
[site]
id = "kokubunji-1"
frame = "JGD2011"               # of the coordinates
epoch = 2011.40
epoch_interval_s = 1.0
host_clock = "ntp"
[receivers.A]
source = "serial:///dev/ttyACM0?baud=460800"
position_ecef_m = [-3962108.673, 3381309.574, 3668678.638]
model = "ZED-F9P HPG 1.51"
[receivers.B]
source = "tcp://10.0.0.2:2000"
position_ecef_m = [-3962186.571, 3381218.295, 3668678.638]
model = "mosaic-X5"
[receivers.C]
source = "ntrip://user:secret@caster.example:2101/MOUNT"
position_ecef_m = [-3962101.898, 3381224.913, 3668763.412]
[integrity]
rule = "full"
on_satellite_fault = "stop"
false_stops_per_year = 1.0
missed_detection = 1e-5
tolerance_m = 20.0
sigma_common_m = 1.2
sigma_differential_m = 0.5
sigma_common_up_m = 2.4
sigma_differential_up_m = 1.0
sigma_range_m = 0.9
sigma_range_low_m = 0.4
sigma_range_differential_m = 0.25
sigma_range_differential_low_m = 0.2
recover_after_s = 30.0
[publish]
listen = ["tcp/0.0.0.0:7447"]
connect = []
key = "keys/kokubunji-1.pem"
valid_for_ms = 3000
[record]
directory = "/var/lib/wayside"
[page]
listen = "127.0.0.1:8080"
"""
ALL_UBX = ('/MOUNT"\n', '/MOUNT"\nprotocol = "ubx"\n')  # an edit: as what is simulated without regard to protocols


def edited(*edits: tuple[str, str]) -> str:
    """The sound file with each first text replaced by the second; a text that is not there is a slip of the test."""
    text = SITE
    for old, new in edits:
        assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in the sample"
        text = text.replace(old, new)
    return text


UBX_SITE = edited(ALL_UBX)
