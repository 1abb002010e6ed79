// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Chains of inertial states without landmarks, and the windows that slide over them with a marginal prior, under
/// every policy: the optimum of all frames at once, and what thrust::seq makes of each window.

#include <doctest/doctest.h>

#include <thrust/detail/seq.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <type_traits>
#include <vector>

#include <turbomap/inertial/marginal_prior.hpp>

#include "adjustment/adjustment_results.hpp"
#include "inertial_scene.hpp"
#include "inertial_state_distance.hpp"
#include "reference/larger_or_nan.hpp"

namespace turbomap_test {

using turbomap::marginal_prior_factor;
using turbomap::state_marginaliser;
using chain_states = std::vector<inertial_state<double>>;

/// Six residuals of a pose that something else measured: rotation and position of the camera.
struct pose_factor {
  static constexpr int size = 6;
  struct row {
    turbomap::rigid_transform<double> measured;
    double rotation, position;  ///< 1 / sigma
  };
  template <class S, class = turbomap::detail::this_target>
  TURBOMAP_HD bool residual(const inertial_state<S>& x, const row& r, S* e) const {
    inertial_state<double> at;
    at.T_cw = r.measured;
    S d[15];
    marginal_prior_factor::difference(x, at, d);
    for (int k = 0; k < 6; ++k) e[k] = S(k < 3 ? r.rotation : r.position) * d[k];
    return true;
  }
};

/// What goes into the problems: states, edges, walks; a pose measurement per frame; something of the first frame.
struct inertial_chain {
  inertial_scene s;
  std::vector<pose_factor::row> poses;
  inertial_prior_factor::row first;
};

inline inertial_chain make_chain(unsigned seed, int frames) {
  inertial_chain c;
  c.s = make_inertial_scene(frames, 0, seed);
  std::mt19937_64 random(seed);
  for (const auto& x : c.s.truth) {
    double step[15] = {};
    std::normal_distribution<double> normal;
    for (int k = 0; k < 6; ++k) step[k] = (k < 3 ? 1e-3 : 1e-2) * normal(random);
    c.poses.push_back({turbomap::move_state(step, x).T_cw, 1e3, 1e2});
  }
  c.first = {c.s.truth[0].velocity + random_vector(random, 0.1), c.s.truth[0].bias, 10, 100, 10};
  turbomap::make_inertial_row(c.s.edges[0].motion, 1, c.s.edges[0]);  // in full
  return c;
}

inline turbomap::adjustment_options steps_of(int iterations) {
  turbomap::adjustment_options options;
  options.numbers = turbomap::precision::float64, options.max_iterations = iterations;
  return options;
}

/// The best states of frames [from, to) of a chain: with what is known of frame 0 where it is among them, else with a
/// prior.
template <class Policy>
chain_states best_states(const Policy& policy, const inertial_chain& c, int from, int to, const chain_states& start,
                         const marginal_prior_factor::row* prior,
                         const turbomap::adjustment_options& options = steps_of(50)) {
  using factors = turbomap::frame_pair_factors<inertial_factor>;
  using walks = turbomap::frame_pair_factors<bias_walk_factor>;
  using poses = turbomap::frame_factors<pose_factor>;
  using known = turbomap::frame_factors<inertial_prior_factor>;
  using marginal = turbomap::frame_factors<marginal_prior_factor>;
  using methods = turbomap::adjustment_methods<turbomap::solver_list<turbomap::reduced_solver::dense>,
                                               turbomap::precision_list<turbomap::precision::float64>>;
  turbomap::context<Policy> ctx{policy};
  turbomap::bundle_problem<Policy, inertial_frame, factors, walks, poses, known, marginal> problem(ctx);
  std::vector<std::int32_t> first, second, all;
  for (int f = from; f < to; ++f) {
    all.push_back(f - from);
    if (f + 1 < to) first.push_back(f - from), second.push_back(f + 1 - from);
  }
  const auto at = static_cast<std::size_t>(from), edges = first.size();
  const std::int32_t oldest = 0;
  inertial_factor factor;
  factor.T_bc = c.s.T_bc, factor.gravity = c.s.gravity;
  const std::size_t priors = prior != nullptr ? 1 : 0, knowns = prior == nullptr ? 1 : 0;
  problem.assign(ctx, {start, {}, {}}, {}, factors{factor, first, second, {c.s.edges.data() + at, edges}, {}, 1e6},
                 walks{{}, first, second, {c.s.walks.data() + at, edges}, {}, 1e6},
                 poses{{}, all, {c.poses.data() + at, all.size()}, {}, 1e6},
                 known{{}, {&oldest, knowns}, {&c.first, knowns}, {}, 1e6},
                 marginal{{}, {&oldest, priors}, {prior, priors}, {}, 1e6});
  turbomap::adjust<methods>(ctx, problem, options);
  chain_states states;
  problem.frames(ctx, states);
  return states;
}

/// In standard deviations of a prior: how far apart two states are.
inline double apart(const inertial_state<double>& a, const inertial_state<double>& b) {
  double d[15], worst = 0;
  marginal_prior_factor::difference(a, b, d);
  const double scale[5] = {1e3, 1e2, 1e2, 1e4, 1e2};
  for (int k = 0; k < 15; ++k) worst = larger_or_nan(worst, std::abs(d[k]) * scale[k / 3]);
  return worst;
}

/// What frame `frame` says of the next one.
inline marginal_prior_factor::row marginalised(const inertial_chain& c, int frame, const inertial_state<double>& leaves,
                                               const inertial_state<double>& stays,
                                               const marginal_prior_factor::row* prior) {
  inertial_factor factor;
  factor.T_bc = c.s.T_bc, factor.gravity = c.s.gravity;
  const auto k = static_cast<std::size_t>(frame);
  state_marginaliser out;
  if (prior != nullptr) REQUIRE(out.add(marginal_prior_factor{}, *prior, leaves));
  if (prior == nullptr) REQUIRE(out.add(inertial_prior_factor{}, c.first, leaves));
  REQUIRE(out.add(pose_factor{}, c.poses[k], leaves));
  REQUIRE(out.add(factor, c.s.edges[k], leaves, stays));
  REQUIRE(out.add(bias_walk_factor{}, c.s.walks[k], leaves, stays));
  return out.prior(stays);
}

/// Linearised at the optimum of all frames, the prior keeps that optimum: its windows, disturbed, come back to it.
template <class Policy>
void check_chain_optimum(const Policy& policy) {
  for (unsigned seed = 1; seed < 6; ++seed) {
    CAPTURE(seed);
    const inertial_chain c = make_chain(seed, 6);
    const auto all = best_states(policy, c, 0, 6, c.s.states, nullptr);
    marginal_prior_factor::row prior;
    for (int f = 0; f + 1 < 6; ++f) {
      const auto i = static_cast<std::size_t>(f);
      prior = marginalised(c, f, all[i], all[i + 1], f == 0 ? nullptr : &prior);
      chain_states start(all.begin() + f + 1, all.end());
      double step[15];
      for (int k = 0; k < 15; ++k) step[k] = k < 9 ? 1e-3 : 1e-5;
      for (auto& x : start) x = turbomap::move_state(step, x);
      const auto rest = best_states(policy, c, f + 1, 6, start, &prior);
      for (std::size_t k = 0; k < rest.size(); ++k) CHECK(apart(rest[k], all[i + 1 + k]) < 1e-4);
    }
  }
}

/// A window of three frames that slides over twelve. \param slid  called with (seed, states of the last window, of
/// all frames at once, whether the prior was kept)
template <class Policy, class Slid>
void slide(const Policy& policy, const turbomap::adjustment_options& options, const Slid& slid) {
  for (unsigned seed = 1; seed < 6; ++seed) {
    constexpr int frames = 12, window = 3;
    const inertial_chain c = make_chain(seed, frames);
    const auto all = best_states(policy, c, 0, frames, c.s.states, nullptr, options);
    for (const bool keeps : {true, false}) {
      marginal_prior_factor::row prior, nothing{c.s.states[0], {}, {}};
      chain_states states(c.s.states.begin(), c.s.states.begin() + window);
      for (int f = 0;; ++f) {
        states = best_states(policy, c, f, f + window, states, f == 0 ? nullptr : keeps ? &prior : &nothing, options);
        if (f + window == frames) break;
        prior = marginalised(c, f, states[0], states[1], f == 0 ? nullptr : &prior);
        states.erase(states.begin());
        states.push_back(c.s.states[static_cast<std::size_t>(f + window)]);
      }
      slid(seed, states, all, keeps);
    }
  }
}

/// It is near to all frames at once; one that forgets is not.
template <class Policy>
void check_sliding_window(const Policy& policy) {
  double with = 0, without = 0;
  slide(policy, steps_of(50), [&](unsigned, const chain_states& states, const chain_states& all, bool keeps) {
    double& worst = keeps ? with : without;
    worst = larger_or_nan(worst, apart(states.back(), all.back()));
  });
  MESSAGE("last frame, in standard deviations of the measurements: " << with << " with the prior, " << without
                                                                     << " without");
  CHECK(with < 0.05);
  CHECK(without > 10 * with);
}

/// The same windows as under thrust::seq in all numbers of their states, within 1e-9 (distance(): metres, m/s, rad/s,
/// m/s^2, relative beyond 1), and the same bits each time. In a few steps each: at the optimum rounding decides
/// whether one more is taken, which moves states by up to 4e-9. After four, -ffp-contract=off and fused multiply-add
/// differ by 3e-12.
template <class Policy>
void check_windows_as_on_host(const Policy& policy) {
  const auto options = steps_of(4);
  std::vector<chain_states> windows, again, host;
  const auto note = [](std::vector<chain_states>& to) {
    return [&to](unsigned, const chain_states& states, const chain_states& all, bool) {
      to.push_back(states), to.push_back(all);
    };
  };
  slide(policy, options, note(windows)), slide(policy, options, note(again));
  slide(std::decay_t<decltype(thrust::seq)>{}, options, note(host));
  REQUIRE(windows.size() == host.size());
  for (std::size_t k = 0; k < windows.size(); ++k) {
    CAPTURE(k);
    CHECK(same_bits(windows[k], again[k]));
    CHECK(distance(windows[k], host[k]) <= 1e-9);
  }
}

}  // namespace turbomap_test
