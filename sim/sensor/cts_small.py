"""A small radar for tests: the CTS350-X with a quarter of its azimuths and of its resolution in range.

No such radar exists. Transmitter, receiver and converter are those of the CTS350-X. The antenna is a quarter
as wide, so that the beam covers as many azimuths. The sweep covers a quarter of the bandwidth at the same
rate, so that Doppler shifts are as long in metres. That weakens point targets by 18.1 dB relative to the
noise; the sixteen times larger cell gives surfaces 12 dB back, and lower losses give 6 dB to everything, so
that surfaces have the codes that the CTS350-X writes.
"""

from dataclasses import replace

from echoscape.sim.sensor.cts350x import CTS350X

_COARSER = 4

CTS_SMALL = replace(
    CTS350X,
    name="cts_small",
    azimuths=CTS350X.azimuths // _COARSER,
    bins=512,  # 88.5 m
    bin_m=_COARSER * CTS350X.bin_m,
    bandwidth_hz=CTS350X.bandwidth_hz / _COARSER,
    fft_size=1024,  # the least power of two that gives 512 bins from real samples
    azimuth_pattern_db=(
        *((_COARSER * offset_deg, level_db) for offset_deg, level_db in CTS350X.azimuth_pattern_db[:9]),
        (180.0, -74.0),
    ),
    antenna_gain_db=29.17,  # directivity of the patterns
    system_loss_db=CTS350X.system_loss_db - 6.0,
    full_scale_db=CTS350X.full_scale_db - 6.06,  # the same power in: a sweep has an eighth of the samples
)
