// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Adjusts one loaded problem as often as asked for, with its times: set-up (taking the problem and everything that is
/// computed once) apart from the iterations.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <ctime>
#include <memory_resource>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <turbomap/adjustment/levenberg_marquardt.hpp>
#include <turbomap/adjustment/problem.hpp>
#include <turbomap/context.hpp>
#include <turbomap/io/bal_factor.hpp>

#include "progress.hpp"
#include "recorded_problem.hpp"

namespace turbomap_bundle {

inline double median(std::vector<double> v) {
  std::sort(v.begin(), v.end());
  const std::size_t n = v.size();
  return n == 0 ? 0 : (v[(n - 1) / 2] + v[n / 2]) / 2;
}

/// Milliseconds since it was made; `cpu_ms` of all threads of the process, which others on the machine do not lengthen.
class stopwatch {
 public:
  double cpu_ms() const { return 1e3 * static_cast<double>(std::clock() - cpu_) / CLOCKS_PER_SEC; }
  double ms() const { return std::chrono::duration<double, std::milli>(clock::now() - start_).count(); }

 private:
  using clock = std::chrono::steady_clock;
  clock::time_point start_ = clock::now();
  std::clock_t cpu_ = std::clock();
};

/// Counts what the memory of a policy holds at most.
class counting_resource : public std::pmr::memory_resource {
 public:
  explicit counting_resource(std::pmr::memory_resource* upstream) : upstream_(upstream) {}
  std::size_t peak() const { return peak_; }

 private:
  void* do_allocate(std::size_t bytes, std::size_t alignment) override {
    void* p = upstream_->allocate(bytes, alignment);
    held_ += bytes, peak_ = std::max(peak_, held_);
    return p;
  }
  void do_deallocate(void* p, std::size_t bytes, std::size_t alignment) override {
    upstream_->deallocate(p, bytes, alignment), held_ -= bytes;
  }
  bool do_is_equal(const std::pmr::memory_resource& other) const noexcept override { return this == &other; }

  std::pmr::memory_resource* upstream_;
  std::size_t held_ = 0, peak_ = 0;
};

/// What a run left: the estimate, the summary of the last adjustment, times of all.
template <class State>
struct solution {
  turbomap::adjustment_summary summary;
  std::vector<State> frames;
  std::vector<turbomap::vec3<double>> landmarks;
  // The first set-up; medians of the rest, or of all where there is one only.
  double ms_setup_first = 0, ms_setup = 0, cpu_ms_setup = 0, ms_adjust = 0, cpu_ms_adjust = 0;
  double ms_assign = 0;        ///< of the set-up: taking the problem
  double ms_results = 0;       ///< frames and landmarks back on the host
  std::size_t peak_bytes = 0;  ///< in the policy's memory

  double ms_per_iteration() const { return summary.iterations > 0 ? ms_adjust / summary.iterations : 0; }
};

/// `assign(ctx, problem)` gives the problem its inputs.
template <class Problem, class Methods = turbomap::every_adjustment_method, class Policy, class Assign>
solution<typename Problem::state> solve(const Policy& policy, int repeat, const turbomap::adjustment_options& options,
                                        Assign assign) {
  counting_resource counted(turbomap::default_resource(turbomap::memory_of_t<Policy>{}));
  turbomap::context<Policy> ctx(policy, &counted);
  Problem problem(ctx);
  solution<typename Problem::state> s;
  std::vector<double> setup, cpu_setup, adjust, cpu_adjust, taking, results;
  auto nothing = options;
  nothing.max_iterations = 0;  // whatever is computed once and late
  std::optional<turbomap_program::progress> bar;
  if (repeat > 1) bar.emplace("adjustments", static_cast<std::size_t>(repeat));
  for (int i = 0; i < repeat; ++i) {
    const stopwatch first;
    assign(ctx, problem);
    taking.push_back(first.ms());
    turbomap::adjust<Methods>(ctx, problem, nothing);
    setup.push_back(first.ms()), cpu_setup.push_back(first.cpu_ms());
    const stopwatch second;
    s.summary = turbomap::adjust<Methods>(ctx, problem, options);
    adjust.push_back(second.ms()), cpu_adjust.push_back(second.cpu_ms());
    const stopwatch third;
    problem.frames(ctx, s.frames);
    problem.landmarks(ctx, s.landmarks);
    results.push_back(third.ms());
    if (bar) bar->advance();
  }
  s.ms_setup_first = setup.front();
  if (repeat > 1)
    for (auto* times : {&setup, &cpu_setup, &adjust, &cpu_adjust, &taking, &results}) times->erase(times->begin());
  s.ms_setup = median(setup), s.cpu_ms_setup = median(cpu_setup);
  s.ms_adjust = median(adjust), s.cpu_ms_adjust = median(cpu_adjust);
  s.ms_assign = median(taking), s.ms_results = median(results);
  s.peak_bytes = counted.peak();
  return s;
}

/// Huber's kernel of a squared delta. Infinite: plain least squares, by the same templates.
inline turbomap::huber huber_of(double delta2) {
  turbomap::huber kernel;
  kernel.delta2 = delta2 < 1e300 ? delta2 : 1e300;
  return kernel;
}

/// A copy of a list in the memory that copies to the policy's begin from (--page-locked). Empty where it is not wanted.
template <class T>
class staged_list {
 public:
  template <class Policy>
  staged_list(const Policy&, const std::vector<T>& from, bool wanted)
      : from_(from), to_(turbomap::default_staging_resource(turbomap::memory_of_t<Policy>{})) {
    if (!wanted) return;
    to_.resize_discard(from.size());
    std::copy(from.begin(), from.end(), to_.data());
  }
  /// The copy, or the list.
  turbomap::span<const T> operator()() const {
    return to_.size() != 0 ? turbomap::span<const T>(to_.data(), to_.size()) : turbomap::span<const T>(from_);
  }

 private:
  const std::vector<T>& from_;
  turbomap::array<T, turbomap::host_memory> to_;
};

/// Poses and points of a rig problem. \param page_locked  what is adjusted lies in page-locked memory
template <class Policy, class Camera>
solution<turbomap::rigid_transform<double>> solve_rig(const Policy& policy, int repeat,
                                                      const turbomap::adjustment_options& options,
                                                      const rig_problem<Camera>& p, double mono_delta2 = 5.991,
                                                      double stereo_delta2 = 7.815, bool page_locked = false) {
  using problem = turbomap::bundle_problem<Policy, turbomap::pose_frame, turbomap::reprojections<Camera>>;
  auto observations = reprojections_of(p, huber_of(mono_delta2), huber_of(stereo_delta2));
  const auto& d = p.data;
  const staged_list frame(policy, d.frame, page_locked), landmark(policy, d.landmark, page_locked);
  const staged_list pixel(policy, d.pixel, page_locked);
  const staged_list information(policy, d.information, page_locked);
  const staged_list points(policy, d.points, page_locked);
  observations.frame = frame(), observations.landmark = landmark();
  observations.pixel = pixel(), observations.information = information();
  return solve<problem>(policy, repeat, options, [&](auto& ctx, auto& to) {
    to.assign(ctx, {{d.T_cw.data(), d.T_cw.size()}, {d.fixed.data(), d.fixed.size()}}, {points()}, observations);
  });
}

/// A BAL problem; none of its cameras is fixed: damping holds the gauge.
template <class Policy>
solution<turbomap::self_calibrated_state<double>> solve_bal(const Policy& policy, int repeat,
                                                            const turbomap::adjustment_options& options,
                                                            const turbomap::bal_problem& p, double delta2 = HUGE_VAL) {
  using group = turbomap::landmark_factors<turbomap::bal_reprojection, turbomap::huber>;
  using problem = turbomap::bundle_problem<Policy, turbomap::self_calibrated_frame, group>;
  std::vector<turbomap::self_calibrated_state<double>> states;
  for (const auto& c : p.cameras) states.push_back(turbomap::bal_state(c));
  const group observations{{},
                           {p.camera.data(), p.camera.size()},
                           {p.point.data(), p.point.size()},
                           {p.pixel.data(), p.pixel.size()},
                           huber_of(delta2)};
  return solve<problem>(policy, repeat, options, [&](auto& ctx, auto& to) {
    to.assign(ctx, {{states.data(), states.size()}}, {{p.points.data(), p.points.size()}}, observations);
  });
}

}  // namespace turbomap_bundle
