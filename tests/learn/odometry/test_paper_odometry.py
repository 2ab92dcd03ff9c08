"""The solver of the paper: the plain model on the images of two scans, and nothing else."""

from itertools import pairwise

import pytest
import torch
from numpy.testing import assert_allclose

from echoscape.learn.model.weights import load_weights, shipped_weights
from echoscape.learn.odometry.paper_odometry import PaperOdometry
from tests.eval.drives import landmarks, scan_of


def test_the_papers_solver_is_the_plain_model_on_two_images() -> None:
    model, _ = load_weights(shipped_weights()[0.6912])
    odometry = PaperOdometry(model)
    scans = [scan_of(landmarks(count=150), (1.2 * k, 0.1 * k, 0.02 * k), number=k) for k in range(3)]
    state = odometry.start(scans[0])
    for before, after in pairwise(scans):
        found, state = odometry.follow(state, after)
        with torch.no_grad():
            motion, matches = model(odometry.image(after), odometry.image(before))
        assert found.motion.x_m == float(motion.translation_m[0, 0])
        assert found.motion.y_m == float(motion.translation_m[0, 1])
        assert found.motion.yaw_rad == float(motion.yaw_rad[0])
        assert_allclose(found.weights, matches.weights[0], atol=0)
        assert found.motion.x_m == pytest.approx(1.2, abs=0.2 * 0.6912)
