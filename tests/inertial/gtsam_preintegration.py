# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0
"""gtsam_preintegration.py IN OUT: preintegrates the intervals of IN with GTSAM, for test_gtsam.cpp.

IN, numbers in text: gyro density, accelerometer density; number of intervals; for each of them bias (gyro, accelerometer),
another bias, number of steps, and per step dt, angular velocity, specific force.
OUT, a line per interval: dR dV dP (15); the same corrected to the other bias (15); covariance of rotation, velocity and
position (81), in the frame of the start.
"""
import sys

import gtsam
import numpy as np


def motion(R, V, P):
    return [*R.flatten(), *V, *P]


def bias_of(b):
    return gtsam.imuBias.ConstantBias(b[3:], b[:3])


def main(source, target):
    values = np.fromstring(open(source).read(), sep=" ")
    at = 0

    def take(n):
        nonlocal at
        at += n
        return values[at - n : at]

    gyro, acceleration = take(2)
    params = gtsam.PreintegrationParams(np.zeros(3))  # no gravity
    params.setGyroscopeCovariance(gyro**2 * np.eye(3))
    params.setAccelerometerCovariance(acceleration**2 * np.eye(3))
    params.setIntegrationCovariance(np.zeros((3, 3)))
    on_manifold = getattr(gtsam, "PreintegratedImuMeasurementsManifold", gtsam.PreintegratedImuMeasurements)
    with open(target, "w") as out:
        for _ in range(int(take(1)[0])):
            bias, other = take(6), take(6)
            p = on_manifold(params, bias_of(bias))
            for _ in range(int(take(1)[0])):
                s = take(7)
                p.integrateMeasurement(s[4:], s[1:4], s[0])
            R = p.deltaRij().matrix()
            moved = p.predict(gtsam.NavState(), bias_of(other))
            # GTSAM: rotation, position, velocity, errors of the last two in the frame of the end.
            T = np.zeros((9, 9))
            T[0:3, 0:3], T[3:6, 6:9], T[6:9, 3:6] = np.eye(3), R, R
            C = T @ p.preintMeasCov() @ T.T
            line = [
                *motion(R, p.deltaVij(), p.deltaPij()),
                *motion(moved.attitude().matrix(), moved.velocity(), moved.position()),
                *C.flatten(),
            ]
            out.write(" ".join(repr(float(x)) for x in line) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
