// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The inertial edges of a window, as the groups of factors that a bundle_problem of inertial frames takes: those that count in
/// full, those with a robust kernel, and the walks of the biases.

#include <cstddef>
#include <cstdint>

#include "../adjustment/factors.hpp"
#include "../config.hpp"
#include "../error.hpp"
#include "../plain_vector.hpp"
#include "inertial_factors.hpp"
#include "inertial_window_options.hpp"
#include "marginal_prior.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Collects edges. Keep one and use it again. The groups are views of it.
class inertial_edges {
 public:
  using factors = frame_pair_factors<inertial_factor>;                ///< edges that count in full
  using robust_factors = frame_pair_factors<inertial_factor, huber>;  ///< edges with a robust kernel
  using walk_factors = frame_pair_factors<bias_walk_factor>;          ///< walks of the biases

  /// No edges; the memory stays.
  void clear() {
    for (auto* list : {&first_, &second_, &robust_first_, &robust_second_, &walk_first_, &walk_second_}) list->clear();
    rows_.clear(), robust_rows_.clear(), walks_.clear();
  }

  /// What the IMU measured from a frame to the next one.
  /// \param first,second  places of the frames in the problem   \param oldest  whether no edge of the window comes before it
  /// \param walk_alone  add the walk of the biases where its covariance has no inverse, so that there is no inertial factor
  /// \return false where its covariance has no inverse (a single step of the sensor, no noise)
  /// \throws std::invalid_argument  an option is out of range
  bool add(std::int32_t first, std::int32_t second, const preintegration<double>& motion, bool oldest,
           const inertial_window_options& options, bool walk_alone = true) {
    require(options.oldest_edge_weight > 0 && options.oldest_edge_weight <= 1, "options.oldest_edge_weight",
            options.oldest_edge_weight, "must be in (0, 1]");
    inertial_factor::row row;
    const bool is_told = make_inertial_row(motion, oldest ? options.oldest_edge_weight : 1, row);
    bias_walk_factor::row walk;
    if ((is_told || walk_alone) && make_walk_row(motion, walk))
      walk_first_.push_back(first), walk_second_.push_back(second), walks_.push_back(walk);
    if (!is_told) return false;
    const bool robust = oldest || options.all_robust;
    (robust ? robust_first_ : first_).push_back(first);
    (robust ? robust_second_ : second_).push_back(second);
    (robust ? robust_rows_ : rows_).push_back(row);
    return true;
  }

  /// What the IMU says of a frame that leaves and of the next one: adds the edges between them to `out`, with the
  /// weights that their kernel gives them at these states. \return whether there is an inertial one that is defined
  bool marginalise(std::int32_t first, std::int32_t second, const inertial_state<double>& leaves,
                   const inertial_state<double>& stays, const inertial_factor& factor,
                   const inertial_window_options& options, state_marginaliser& out) const {
    bool found = false;
    for_each_between(first, second, first_, second_,
                     [&](std::size_t i) { found = out.add(factor, rows_[i], leaves, stays) || found; });
    for_each_between(first, second, robust_first_, robust_second_, [&](std::size_t i) {
      double e[inertial_factor::size], rho, weight;
      factor.residual(leaves, stays, robust_rows_[i], e);
      huber{options.robust_chi2}(detail::squared_length<inertial_factor::size>(e), rho, weight);
      found = out.add(factor, robust_rows_[i], leaves, stays, weight) || found;
    });
    for_each_between(first, second, walk_first_, walk_second_,
                     [&](std::size_t i) { out.add(bias_walk_factor{}, walks_[i], leaves, stays); });
    return found;
  }

  /// The edges that count in full; valid until edges are added.
  factors plain(const inertial_factor& factor) const { return {factor, first_, second_, rows_, {}, 1e6}; }
  /// The edges whose chi2 a Huber kernel of options.robust_chi2 bounds.
  robust_factors robust(const inertial_factor& factor, const inertial_window_options& options) const {
    return {factor, robust_first_, robust_second_, robust_rows_, huber{options.robust_chi2}, 1e6};
  }
  /// The walks of the biases.
  walk_factors walks() const { return {{}, walk_first_, walk_second_, walks_, {}, 1e6}; }

 private:
  template <class Visit>
  static void for_each_between(std::int32_t first, std::int32_t second, const plain_vector<std::int32_t>& firsts,
                               const plain_vector<std::int32_t>& seconds, Visit visit) {
    for (std::size_t i = 0; i < firsts.size(); ++i)
      if (firsts[i] == first && seconds[i] == second) visit(i);
  }

  plain_vector<std::int32_t> first_, second_, robust_first_, robust_second_, walk_first_, walk_second_;
  plain_vector<inertial_factor::row> rows_, robust_rows_;
  plain_vector<bias_walk_factor::row> walks_;
};

TURBOMAP_END_NAMESPACE
