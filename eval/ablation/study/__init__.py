"""What artefacts and faults cost odometry: one trace, many settings, paired differences over drives."""
