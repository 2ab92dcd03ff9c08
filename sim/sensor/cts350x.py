"""Navtech CTS350-X as in the Oxford Radar RobotCar data set; numbers have a source or are marked calibrated.

Sources: [O] Barnes et al., "The Oxford Radar RobotCar Dataset", ICRA 2020, and its files; [C] Cen & Newman,
"Precise Ego-Motion Estimation with Millimeter-Wave Radar", ICRA 2018; [B] Burnett et al., "Do We Need to
Compensate for Motion Distortion and Doppler Effects in Spinning Radar Navigation?", RA-L 2021; [M] measured
on raw scans of [O]; [cal] calibrated so that simulated scans have the statistics of [M].
"""

from echoscape.sim.sensor.sensor import Sensor

CTS350X = Sensor(
    name="cts350x",
    azimuths=400,  # [O]
    bins=3768,  # [O]
    bin_m=0.0432,  # [O] files and loaders (the data set's page says 0.0438)
    rotation_hz=4.0,  # [O]
    rotation_jitter_s=0.0013,  # [M] frame to frame 247-253 ms
    encoder_per_turn=5600,  # [M]
    encoder_first=13,  # [M]
    carrier_hz=76.5e9,  # [O] 76-77 GHz
    bandwidth_hz=636e6,  # [cal] to the noise's correlation over range in [M]; echoes: sweep_ripple_db
    doppler_beta_s=0.049,  # [B]
    chirps="rising",  # [cal] assumed
    fft_size=8192,  # the least power of two that gives 3768 bins from real samples
    window="hann",  # [M] shape of the range point spread
    sweep_ripple_db=(  # [cal] to [M]: echoes are wider than the noise's correlation, with a smooth skirt
        (1.0, -24.5),
        (2.2, -25.0),
        (4.0, -32.6),
        (5.2, -36.6),
        (6.8, -34.3),
        (9.0, -35.9),
    ),
    adc_bits=12,  # [cal] no published figure; its quantisation noise stays below the thermal noise
    full_scale_db=72.0,  # [cal] above the ceiling that compression sets: [M] has no harmonics of walls
    compression_dbm=-61.6,  # [cal] to [M] largest code 136: 63.6 dB in the scan, 5.9 dB below the ceiling
    tx_power_w=0.02,  # [cal] 13 dBm, usual for a single-chip 77 GHz transmitter
    antenna_gain_db=35.15,  # directivity of the patterns below
    system_loss_db=15.3,  # [cal] brings the level of a street's echoes to [M]; losses of the dish included
    noise_figure_db=15.0,  # [cal] usual for 77 GHz receivers
    noise_units=1.57,  # [M] mean power of quiet azimuths at far range, and the shares of codes there
    range_gain_db=(  # [cal] to the lower envelope of [M] relative to the noise beyond 100 m
        (0.0, -3.0),
        (4.0, -3.5),
        (7.5, -3.0),
        (15.0, -0.8),
        (30.0, 0.9),
        (50.0, 1.2),
        (70.0, 1.0),
        (90.0, 0.5),
        (110.0, 0.0),
        (163.0, -0.4),
    ),
    azimuth_pattern_db=(  # [M] azimuth point spread, main lobe narrowed by 6 % for the turn within a sweep
        (0.0, 0.0),
        (0.511, -3.0),
        (0.801, -6.0),
        (1.09, -10.0),
        (1.872, -20.0),
        (2.83, -30.0),
        (4.5, -38.0),
        (9.0, -44.0),
        (20.0, -58.0),  # from here on [cal]: what rings of all around add to the ground near by
        (45.0, -74.0),
        (90.0, -84.0),
        (180.0, -88.0),
    ),
    elevation_pattern_db=(  # [C] cosecant-squared fill below a narrow main lobe; levels [cal]
        (-90.0, -45.0),
        (-40.0, -28.0),
        (-25.0, -21.0),
        (-10.0, -13.5),
        (-5.0, -7.5),
        (-3.0, -4.0),
        (-1.5, -1.2),
        (0.0, 0.0),
        (1.5, -1.8),
        (3.0, -6.0),
        (6.0, -15.0),
        (15.0, -26.0),
        (40.0, -35.0),
        (90.0, -45.0),
    ),
    phase_noise_dbc_hz=-84.0,  # [cal] usual for 77 GHz synthesisers inside the loop bandwidth
    phase_noise_corner_hz=300e3,  # [cal]
    leakage_dbm=(  # [cal] to [M]: mean code 30 below 0.3 m, 47 at 0.7 m, 43 at 1.1 m, 29 at 1.4 m, 16 at 2 m
        (0.1, -110.8),
        (0.35, -125.0),
        (0.6, -97.3),
        (0.85, -125.0),
        (1.1, -102.2),
        (1.4, -110.6),
        (1.75, -109.7),
        (2.2, -114.8),
        (2.8, -117.9),
        (3.5, -125.0),
    ),
    mount_height_m=2.0,  # [cal] on the roof of a compact car
    mount_tilt_deg=0.0,  # [cal]
    blocking_db=((0.0, 0.0), (360.0, 0.0)),  # the roof is free all round
    epoch_us=1_700_000_000_000_000,  # November 2023; no loader of [O] goes by the date
)
