"""Navtech CIR204-H as in the MulRan data set: what differs from the CTS350-X, each number with its source.

Sources: [K] Kim et al., "MulRan: Multimodal Range Dataset for Urban Place Recognition", ICRA 2020, and its
files; [B] Burnett et al., "Do We Need to Compensate for Motion Distortion and Doppler Effects in Spinning
Radar Navigation?", RA-L 2021; [M] measured on three raw scans of [K], of one place; [cal] calibrated to [M].
Everything else is taken over from the CTS350-X: antenna, transmitter, converter and synthesiser have no
published figures, and the azimuth point spread was measured alike (full widths at -6/-10/-20/-30 dB of
1.71/2.31/3.73/5.98 deg here, 1.67/2.28/3.67/5.94 deg there, by the same code).
"""

from dataclasses import replace

from echoscape.sim.sensor.cts350x import CTS350X

CIR204 = replace(
    CTS350X,
    name="cir204",
    azimuths=400,  # [K] 0.9 deg
    epoch_us=1_560_000_000_000_000,  # June 2019, as [K]; Boreas has such bins until September 2021
    bins=3360,  # [M]
    bin_m=0.0596,  # [K] says 0.06 m and 200 m; 0.0596 is what the loaders of the same radar in Boreas use
    rotation_hz=4.0,  # [K]; [M] 4.005
    rotation_jitter_s=0.0001,  # [M] frame to frame 249.6-249.7 ms
    encoder_per_turn=5600,  # [M]
    encoder_first=7,  # [M]
    bandwidth_hz=461e6,  # [M] range widths at -3/-6/-10/-20 dB of 8.0/11.4/14.3/20.3 bins
    doppler_beta_s=0.049,  # [B] for this radar
    chirps="rising",  # [B] sawtooth; the direction is assumed
    fft_size=8192,  # the least power of two that gives 3360 bins from real samples
    full_scale_db=71.5,  # [cal] above the ceiling that compression sets
    compression_dbm=-60.5,  # [cal] to [M] largest code 135
    noise_units=1.5,  # [M] zeros in 65 % of the quietest tenth of the azimuths, 62 % of the median one
    range_gain_db=(  # [M] lower envelope (5th percentile azimuth) relative to the noise beyond 160 m
        (0.0, -4.0),
        (4.0, -3.2),
        (7.5, -2.1),
        (15.0, -1.5),
        (30.0, 0.8),
        (50.0, 0.8),
        (70.0, 1.4),
        (90.0, 1.2),
        (110.0, 1.0),
        (140.0, 0.6),
        (180.0, 0.0),
    ),
    leakage_dbm=(  # [cal] to [M] code 28 in bins 0-6, 6 at bin 8, 3 from bin 10
        (0.1, -112.5),
        (0.3, -113.5),
    ),
    mount_height_m=2.0,  # [K] 1.97 m above the car's frame
)
