# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0
"""gtsam_adjustment.py IN OUT: the optimum of a visual-inertial problem by GTSAM, for test_gtsam.cpp.

IN, numbers in text: gyro and accelerometer density, walk densities of both; T_bc as R and t; gravity; fx fy cx cy, bf;
frames, landmarks, observations, edges; per frame T_cw (R, t), velocity, bias (gyro, accelerometer); landmarks; per observation
frame, landmark, u, v, u_right or -1, sigma; Huber's delta^2 of two and three residuals; per edge first, second, bias of the
integration, weight, Huber's delta^2 or 0, number of steps, and per step dt, angular velocity, specific force; prior: frame,
velocity, bias, three weights. Frame 0 is fixed.
OUT: cost; per frame T_cw (R, t), velocity, bias; landmarks.
"""
import sys

import gtsam
import numpy as np
from gtsam import noiseModel
from gtsam.symbol_shorthand import B, L, V, X

H = 1e-6  # of numerical derivatives


def bias_of(b):
    return gtsam.imuBias.ConstantBias(b[3:], b[:3])


def edge_residual(pim, T_bc, gravity, pose_i, v_i, bias, pose_j, v_j):
    """[Forster et al. 2017, eq. 45]; the motion corrected to the bias is GTSAM's."""
    body_i, body_j = pose_i.compose(T_bc.inverse()), pose_j.compose(T_bc.inverse())
    moved = pim.predict(gtsam.NavState(), bias)  # no gravity
    R_i, dt = body_i.rotation().matrix(), pim.deltaTij()
    turn = moved.attitude().inverse().compose(body_i.rotation().inverse()).compose(body_j.rotation())
    speed = R_i.T @ (v_j - v_i - gravity * dt) - moved.velocity()
    way = body_j.translation() - body_i.translation() - v_i * dt - 0.5 * gravity * dt * dt
    return np.concatenate([gtsam.Rot3.Logmap(turn), speed, R_i.T @ way - moved.position()])


def edge_factor(pim, T_bc, gravity, i, j, model):
    keys = [X(i), V(i), B(i), X(j), V(j)]

    def at(values):
        return [values.atPose3(X(i)), values.atVector(V(i)), values.atConstantBias(B(i)), values.atPose3(X(j)), values.atVector(V(j))]

    def moved(x, d):
        return x + d if isinstance(x, np.ndarray) else x.retract(d)

    def error(this, values, jacobians):
        x = at(values)
        if jacobians is not None:
            for k in range(5):
                columns = []
                for c in range(len(x[k]) if isinstance(x[k], np.ndarray) else 6):
                    d = np.zeros(len(x[k]) if isinstance(x[k], np.ndarray) else 6)
                    d[c] = H
                    ends = [edge_residual(pim, T_bc, gravity, *x[:k], moved(x[k], s * d), *x[k + 1 :]) for s in (1, -1)]
                    columns.append((ends[0] - ends[1]) / (2 * H))
                jacobians[k] = np.array(columns).T
        return edge_residual(pim, T_bc, gravity, *x)

    return gtsam.CustomFactor(model, keys, error)


def robust(delta2, model):
    return noiseModel.Robust.Create(noiseModel.mEstimator.Huber.Create(np.sqrt(delta2)), model) if delta2 > 0 else model


def main(source, target):
    values = np.array(open(source).read().split(), dtype=float)
    at = 0

    def take(n):
        nonlocal at
        at += n
        return values[at - n : at]

    def take_pose():
        return gtsam.Pose3(gtsam.Rot3(take(9).reshape(3, 3)), take(3))

    gyro, acceleration, gyro_walk, acceleration_walk = take(4)
    T_bc = take_pose()
    gravity = take(3)
    fx, fy, cx, cy, bf = take(5)
    frames, landmarks, observations, edges = take(4).astype(int)
    start, graph = gtsam.Values(), gtsam.NonlinearFactorGraph()
    for f in range(frames):
        pose, velocity, bias = take_pose().inverse(), take(3), bias_of(take(6))
        start.insert(X(f), pose), start.insert(V(f), velocity), start.insert(B(f), bias)
        if f == 0:
            graph.add(gtsam.PriorFactorPose3(X(0), pose, noiseModel.Constrained.All(6)))
            graph.add(gtsam.PriorFactorVector(V(0), velocity, noiseModel.Constrained.All(3)))
            graph.add(gtsam.PriorFactorConstantBias(B(0), bias, noiseModel.Constrained.All(6)))
    for l in range(landmarks):
        start.insert(L(l), take(3))
    rows = take(6 * observations).reshape(-1, 6)
    delta2, delta2_stereo = take(2)
    K, K_stereo = gtsam.Cal3_S2(fx, fy, 0, cx, cy), gtsam.Cal3_S2Stereo(fx, fy, 0, cx, cy, bf / fx)
    for f, l, u, v, right, sigma in rows:
        f, l = int(f), int(l)
        if right < 0:
            model = robust(delta2, noiseModel.Isotropic.Sigma(2, sigma))
            graph.add(gtsam.GenericProjectionFactorCal3_S2(np.array([u, v]), model, X(f), L(l), K))
        else:
            model = robust(delta2_stereo, noiseModel.Isotropic.Sigma(3, sigma))
            graph.add(gtsam.GenericStereoFactor3D(gtsam.StereoPoint2(u, right, v), model, X(f), L(l), K_stereo))
    params = gtsam.PreintegrationParams(np.zeros(3))  # no gravity
    params.setGyroscopeCovariance(gyro**2 * np.eye(3))
    params.setAccelerometerCovariance(acceleration**2 * np.eye(3))
    params.setIntegrationCovariance(np.zeros((3, 3)))
    for _ in range(edges):
        i, j = take(2).astype(int)
        bias, (weight, kernel), steps = bias_of(take(6)), take(2), int(take(1)[0])
        pim = gtsam.PreintegratedImuMeasurementsManifold(params, bias)
        for _ in range(steps):
            s = take(7)
            pim.integrateMeasurement(s[4:], s[1:4], s[0])
        # GTSAM: rotation, position, velocity, errors of the last two in the frame of the end.
        T = np.zeros((9, 9))
        T[0:3, 0:3], T[3:6, 6:9], T[6:9, 3:6] = np.eye(3), pim.deltaRij().matrix(), pim.deltaRij().matrix()
        model = robust(kernel, noiseModel.Gaussian.Covariance(T @ pim.preintMeasCov() @ T.T / weight))
        graph.add(edge_factor(pim, T_bc, gravity, i, j, model))
        t = np.sqrt(pim.deltaTij())
        walk = np.array(3 * [acceleration_walk * t] + 3 * [gyro_walk * t])
        graph.add(gtsam.BetweenFactorConstantBias(B(i), B(j), gtsam.imuBias.ConstantBias(), noiseModel.Diagonal.Sigmas(walk)))
    frame, velocity, bias, weights = int(take(1)[0]), take(3), bias_of(take(6)), take(3)
    graph.add(gtsam.PriorFactorVector(V(frame), velocity, noiseModel.Isotropic.Sigma(3, 1 / weights[0])))
    sigmas = np.array(3 * [1 / weights[2]] + 3 * [1 / weights[1]])
    graph.add(gtsam.PriorFactorConstantBias(B(frame), bias, noiseModel.Diagonal.Sigmas(sigmas)))

    lm = gtsam.LevenbergMarquardtParams()
    lm.setRelativeErrorTol(0), lm.setAbsoluteErrorTol(0), lm.setMaxIterations(60)
    found = gtsam.LevenbergMarquardtOptimizer(graph, start, lm).optimize()
    out = [2 * graph.error(found)]
    for f in range(frames):
        pose, bias = found.atPose3(X(f)).inverse(), found.atConstantBias(B(f))
        out += [*pose.rotation().matrix().flatten(), *pose.translation(), *found.atVector(V(f))]
        out += [*bias.gyroscope(), *bias.accelerometer()]
    for l in range(landmarks):
        out += [*found.atPoint3(L(l))]
    open(target, "w").write(" ".join(repr(float(x)) for x in out) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
