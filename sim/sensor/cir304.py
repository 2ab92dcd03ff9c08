"""Navtech CIR304-H as in the Boreas data set, and its successor with alternating sweeps as in Boreas-RT.

`CIR304` is the radar of Boreas: 3360 bins of 0.0596 m, sawtooth. `CIR304_RT` is that of Boreas-RT, which its
guide calls RAS6: 6848 bins of 0.0438 m, every other sweep falling. Sources: [N] Burnett et al., "Boreas: A
Multi-Season Autonomous Driving Dataset", IJRR 2023, its guide and loaders (pyboreas); [R] "Boreas Road Trip",
its guide and loaders; [M] measured on one raw scan of [R]; [F] measured on one scan of the FoMo data set's
CIR304; [cal] calibrated to [M]. Everything else is taken over from the CTS350-X, as no figures are published;
the azimuth point spread of [M] fits its pattern (-20 dB at 1.8 deg at azimuths of one sweep direction).
"""

from dataclasses import replace

from echoscape.sim.sensor.cts350x import CTS350X

CIR304 = replace(
    CTS350X,
    name="cir304",
    azimuths=400,  # [N]
    bins=3360,  # [N] 200.256 m
    bin_m=0.0596,  # [N] before the radar's update of September 2021; 0.04381 since
    rotation_hz=4.0,  # [N]
    rotation_jitter_s=0.0001,  # assumed as in the CIR204
    encoder_per_turn=5600,  # [N]
    encoder_first=7,  # [M]
    bandwidth_hz=461e6,  # as many bins to a resolution cell as in [M] and in the CIR204
    doppler_beta_s=0.049,  # [N] loaders
    chirps="rising",  # [N] one direction; which is assumed
    fft_size=8192,
    full_scale_db=84.0,  # [cal] above the ceiling that compression sets
    compression_dbm=-55.8,  # [cal] to [F] largest code 158
    noise_units=7.1,  # [F]
    range_gain_db=((0.0, 0.0), (300.0, 0.0)),  # cannot be separated from clutter in one scan
    leakage_dbm=(  # [cal] to [M] median codes 72, 91, 60, 50 and 40 at 0, 0.9, 1.6, 2 and 2.5 m
        (0.1, -96.0),
        (0.5, -95.0),
        (0.87, -87.0),
        (1.15, -97.0),
        (1.4, -101.0),
        (1.9, -106.0),
        (2.4, -112.0),
    ),
    mount_height_m=2.2,  # [cal] on a roof rack
    epoch_us=1_620_000_000_000_000,  # May 2021, while bins were of 0.0596 m [N]
)

CIR304_RT = replace(
    CIR304,
    name="cir304_rt",
    bins=6848,  # [M]
    bin_m=0.0438,  # [R]
    bandwidth_hz=625e6,  # [M] range widths at -3/-6/-10/-20 dB of 8.7/11.8/14.7/20.5 bins
    compression_dbm=-56.1,  # [cal] to [M] largest code 160
    chirps="alternating",  # [R]; [M] begins with column 10 at 0, which the loaders of [R] take as falling
    fft_size=16384,
    epoch_us=CTS350X.epoch_us,
)
