// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The same problems in Ceres Solver, as one would write them there: automatic derivatives, Schur ordering, one thread.

#include <cmath>
#include <vector>

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <turbomap/camera/brown_conrady.hpp>

#include "arguments.hpp"
#include "recorded_problem.hpp"
#include "solve.hpp"

namespace turbomap_bundle {

template <class T>
void project_for_ceres(const turbomap::pinhole<double>& c, const T* x, T* pixel) {
  pixel[0] = c.fx * (x[0] / x[2]) + c.cx, pixel[1] = c.fy * (x[1] / x[2]) + c.cy;
}
template <class T>
void project_for_ceres(const turbomap::brown_conrady<double>& c, const T* x, T* pixel) {
  const T a = x[0] / x[2], b = x[1] / x[2], r2 = a * a + b * b;
  const T s = 1.0 + r2 * (c.k1 + r2 * (c.k2 + r2 * c.k3));
  pixel[0] = c.fx * (a * s + 2.0 * c.p1 * a * b + c.p2 * (r2 + 2.0 * a * a)) + c.cx;
  pixel[1] = c.fy * (b * s + c.p1 * (r2 + 2.0 * b * b) + 2.0 * c.p2 * a * b) + c.cy;
}
template <class T>
void project_for_ceres(const turbomap::kannala_brandt<double>& c, const T* x, T* pixel) {
  using std::atan2;
  using std::sqrt;
  const T r = sqrt(x[0] * x[0] + x[1] * x[1] + 1e-30), angle = atan2(r, x[2]), a2 = angle * angle;
  const T s = angle * (1.0 + a2 * (c.k1 + a2 * (c.k2 + a2 * (c.k3 + a2 * c.k4)))) / r;
  pixel[0] = c.fx * s * x[0] + c.cx, pixel[1] = c.fy * s * x[1] + c.cy;
}

/// A pose is qx qy qz qw tx ty tz.
template <class Camera, int Size>
struct ceres_reprojection {
  const turbomap::rig_camera<Camera>& camera;
  turbomap::isometry<double> T_cb;
  turbomap::vec3<double> seen;
  double weight;

  template <class T>
  bool operator()(const T* pose, const T* point, T* e) const {
    const T q[4] = {pose[3], pose[0], pose[1], pose[2]};
    T b[3], x[3], pixel[2];
    ceres::UnitQuaternionRotatePoint(q, point, b);
    for (int i = 0; i < 3; ++i) b[i] += pose[4 + i];
    const double t[3] = {T_cb.t.x, T_cb.t.y, T_cb.t.z};
    for (int i = 0; i < 3; ++i) x[i] = T_cb.R(i, 0) * b[0] + T_cb.R(i, 1) * b[1] + T_cb.R(i, 2) * b[2] + t[i];
    project_for_ceres(camera.camera, x, pixel);
    e[0] = weight * (pixel[0] - seen.x), e[1] = weight * (pixel[1] - seen.y);
    if constexpr (Size == 3) e[2] = weight * (pixel[0] - camera.bf / x[2] - seen.z);
    return true;
  }
};

/// The nine numbers of a BAL camera, in their order.
struct ceres_bal_reprojection {
  turbomap::vec2<double> seen;

  template <class T>
  bool operator()(const T* camera, const T* point, T* e) const {
    T P[3];
    ceres::AngleAxisRotatePoint(camera, point, P);
    for (int i = 0; i < 3; ++i) P[i] += camera[3 + i];
    const T x = -P[0] / P[2], y = -P[1] / P[2], r2 = x * x + y * y;
    const T s = camera[6] * (1.0 + r2 * (camera[7] + camera[8] * r2));
    e[0] = s * x - seen.x, e[1] = s * y - seen.y;
    return true;
  }
};

/// What Ceres did: costs as it reports them (halves), times, how often it linearised.
struct ceres_result {
  double ms_setup = 0, ms_solve = 0, ms_per_iteration = 0, cost_initial = 0, cost_final = 0;
  int iterations = 0, accepted = 0;
  std::vector<double> costs, ms;  ///< after each iteration; ms since the start of the first

  nlohmann::json json(double scale) const {
    std::vector<double> scaled;
    for (const double cost : costs) scaled.push_back(scale * cost);
    return {{"cost_initial", scale * cost_initial},
            {"cost_final", scale * cost_final},
            {"costs", scaled},
            {"ms", ms},
            {"iterations", iterations},
            {"accepted", accepted},
            {"ms_setup", ms_setup},
            {"ms_adjust", ms_solve},
            {"ms_per_iteration", ms_per_iteration}};
  }
};

inline ceres_result run_ceres(ceres::Problem& problem, const arguments& a, const ceres::ParameterBlockOrdering& order,
                              std::size_t frames, double ms_setup) {
  ceres::Solver::Options o;
  o.max_num_iterations = a.iterations;
  o.linear_solver_type = a.solver == "sparse" ? ceres::SPARSE_SCHUR
                         : a.solver == "pcg"  ? ceres::ITERATIVE_SCHUR
                         : frames > 300       ? ceres::SPARSE_SCHUR
                                              : ceres::DENSE_SCHUR;
  if (a.solver == "pcg") o.preconditioner_type = ceres::SCHUR_JACOBI;
  o.linear_solver_ordering.reset(new ceres::ParameterBlockOrdering(order));
  o.num_threads = 1;
  o.logging_type = ceres::SILENT;
  o.function_tolerance = o.gradient_tolerance = o.parameter_tolerance = 1e-16;  // the same number of iterations
  ceres::Solver::Summary s;
  ceres::Solve(o, &problem, &s);
  ceres_result r;
  r.iterations = static_cast<int>(s.iterations.size()) - 1;  // the first is the evaluation at the start
  r.accepted = s.num_successful_steps - 1;
  r.cost_initial = s.initial_cost, r.cost_final = s.final_cost;
  for (int i = 1; i <= r.iterations; ++i) {
    const auto& step = s.iterations[static_cast<std::size_t>(i)];
    // Of a step that it does not take, Ceres reports the cost where it would have led.
    r.costs.push_back(step.step_is_successful ? step.cost : r.costs.empty() ? r.cost_initial : r.costs.back());
    r.ms.push_back(1e3 * (step.cumulative_time_in_seconds - s.preprocessor_time_in_seconds));
  }
  r.ms_solve = 1e3 * s.minimizer_time_in_seconds, r.ms_setup = ms_setup + 1e3 * s.preprocessor_time_in_seconds;
  r.ms_per_iteration = r.iterations > 0 ? r.ms_solve / r.iterations : 0;
  return r;
}

/// Adjusts `p` in place.
template <class Camera>
ceres_result solve_by_ceres(rig_problem<Camera>& p, const arguments& a) {
  const stopwatch setup;
  ceres::Problem problem;
  ceres::ParameterBlockOrdering order;
  auto& d = p.data;
  for (std::size_t i = 0; i < d.frame.size(); ++i) {
    const std::size_t c = d.camera.empty() ? 0 : d.camera[i];
    const auto T_cb = turbomap::to_isometry<double>(p.rig[c].T_camera_body);
    const double weight = std::sqrt(d.information[i]);
    const bool stereo = d.stereo[i] != 0;
    ceres::CostFunction* cost =
        stereo
            ? static_cast<ceres::CostFunction*>(new ceres::AutoDiffCostFunction<ceres_reprojection<Camera, 3>, 3, 7, 3>(
                  new ceres_reprojection<Camera, 3>{p.rig[c], T_cb, d.pixel[i], weight}))
            : new ceres::AutoDiffCostFunction<ceres_reprojection<Camera, 2>, 2, 7, 3>(
                  new ceres_reprojection<Camera, 2>{p.rig[c], T_cb, d.pixel[i], weight});
    ceres::LossFunction* loss = a.kernel == "none" ? nullptr : new ceres::HuberLoss(std::sqrt(stereo ? 7.815 : 5.991));
    problem.AddResidualBlock(cost, loss, &d.T_cw[static_cast<std::size_t>(d.frame[i])].qx,
                             &d.points[static_cast<std::size_t>(d.landmark[i])].x);
  }
  using manifold = ceres::ProductManifold<ceres::EigenQuaternionManifold, ceres::EuclideanManifold<3>>;
  for (std::size_t f = 0; f < d.T_cw.size(); ++f) {
    double* pose = &d.T_cw[f].qx;
    if (!problem.HasParameterBlock(pose)) continue;
    problem.SetManifold(pose, new manifold);
    if (d.fixed[f] != 0) problem.SetParameterBlockConstant(pose);
    order.AddElementToGroup(pose, 1);
  }
  for (auto& x : d.points)
    if (problem.HasParameterBlock(&x.x)) order.AddElementToGroup(&x.x, 0);
  return run_ceres(problem, a, order, d.T_cw.size(), setup.ms());
}

inline ceres_result solve_by_ceres(turbomap::bal_problem& p, const arguments& a) {
  const stopwatch setup;
  ceres::Problem problem;
  ceres::ParameterBlockOrdering order;
  for (std::size_t i = 0; i < p.pixel.size(); ++i)
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<ceres_bal_reprojection, 2, 9, 3>(new ceres_bal_reprojection{p.pixel[i]}),
        a.kernel == "huber" ? new ceres::HuberLoss(std::sqrt(5.991)) : nullptr,
        &p.cameras[static_cast<std::size_t>(p.camera[i])].rotation.x,
        &p.points[static_cast<std::size_t>(p.point[i])].x);
  for (auto& c : p.cameras) order.AddElementToGroup(&c.rotation.x, 1);
  for (auto& x : p.points) order.AddElementToGroup(&x.x, 0);
  return run_ceres(problem, a, order, p.cameras.size(), setup.ms());
}

}  // namespace turbomap_bundle
