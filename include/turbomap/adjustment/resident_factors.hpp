// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Groups of the user's own factors as a problem keeps them: with landmarks, of one frame, between two.

#include <cstddef>
#include <cstdint>
#include <optional>

#include "../config.hpp"
#include "../error.hpp"
#include "../packed_inputs.hpp"
#include "factors.hpp"
#include "linearise_frame_factors.hpp"
#include "linearise_landmark_factors.hpp"
#include "resident_group.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Factors between a frame and a landmark.
template <class Factor, class Kernel, class Frame, class Memory>
class resident_group<landmark_factors<Factor, Kernel>, Frame, Memory> {
 public:
  /// @{
  /// See the list of members at resident_group.
  using group_type = landmark_factors<Factor, Kernel>;
  static constexpr bool with_landmarks = true, own_landmark_factors = true, reprojects = false;
  /// @}

  /// \param r  memory of the policy; must outlive this
  resident_group(std::pmr::memory_resource* r, std::pmr::memory_resource*) : entries_(r), rows_(r) {}

  /// @{
  /// See the list of members at resident_group.
  static void check(const group_type& g, int frames, int landmarks) {
    require(g.landmark.size() == g.frame.size(), "landmark.size()", g.landmark.size(), "must be that of frame");
    require(g.rows.size() == g.frame.size(), "rows.size()", g.rows.size(), "must be that of frame");
    detail::require_indices(g.frame, frames, "frame");
    detail::require_indices(g.landmark, landmarks, "landmark");
    detail::require_kernel(g.kernel, "kernel");
    detail::require_undefined_chi2(g.undefined_chi2);
  }
  static bool all_finite(const group_type&) { return true; }  // residuals tell
  void describe(const group_type& g, structure_inputs& to) {
    to.landmark_groups.push_back({g.frame, g.landmark, nullptr, 1});
  }
  /// @}

  /// @{
  /// See the list of members at resident_group.
  template <class Policy>
  void assign(const Policy& policy, const group_type& g, const adjustment_structure& structure, group_place& place) {
    const group_structure& s = structure.groups[static_cast<std::size_t>(place.landmark_group)];
    landmark_group_ = place.landmark_group++;
    size_ = g.frame.size();
    rows_.host().resize(s.source.size());
    for (const auto& c : s.chunks)
      for (int i = c.begin; i < c.begin + c.count; ++i) {
        const auto e = static_cast<std::size_t>(i);
        rows_.host()[e] = g.rows[static_cast<std::size_t>(s.source[e])];
      }
    rows_.send(policy);
    entries_.send(policy, s);
    view_.emplace(landmark_factor_view<Factor, Kernel>{nullptr, nullptr, nullptr, nullptr, rows_.data(), g.factor,
                                                       g.kernel, g.undefined_chi2, place.first_chunk, 0});
    entries_.point(*view_);
    place.first_chunk += view_->chunk_count;
  }

  template <class G, class Policy, class A>
  void linearise(const Policy& policy, const estimate_view<Frame>& x, const factor_sums<A>& sums,
                 const cost_sums& costs) const {
    launch_linearise_landmark_factors(policy, *view_, x, sums);
    if (costs.cost != nullptr) cost<G>(policy, x, costs);
  }
  template <class G, class Policy>
  void cost(const Policy& policy, const estimate_view<Frame>& x, const cost_sums& sums) const {
    launch_evaluate_landmark_factors(policy, *view_, x, sums, nullptr);
  }
  template <class Policy>
  void chi2(const Policy& policy, const estimate_view<Frame>& x, double* chi2, double*) const {
    launch_evaluate_landmark_factors(policy, *view_, x, {}, chi2);
  }
  /// @}

  /// See resident_reprojections.hpp. A residual that is not finite spoils its frame.
  template <class Rows>
  TURBOMAP_ONE_BODY void list_rows(const adjustment_structure& structure,
                                   const typename Frame::template state<double>* states, const vec3<double>* landmarks,
                                   Rows& rows) const {
    constexpr int V = Frame::landmark_dof, n = Factor::size;
    const group_structure& s = structure.groups[static_cast<std::size_t>(landmark_group_)];
    for (const auto& c : s.chunks)
      for (int i = c.begin; i < c.begin + c.count; ++i) {
        double e[n], d_frame[n * V], d_landmark[n * 3], rho, w;
        const auto k = static_cast<std::size_t>(i);
        const auto l = s.landmark[k];
        if (!turbomap::linearise<Frame>(view_->factor, states[static_cast<std::size_t>(c.frame)],
                                        landmarks[static_cast<std::size_t>(l)], rows_.host()[k], e, d_frame,
                                        d_landmark))
          continue;
        view_->kernel(detail::squared_length<n>(e), rho, w);
        rows.add(n, w, V, {l, d_landmark}, {c.free, d_frame});
      }
  }

  /// Its entries, where the policy computes.
  const resident_entries<Memory>& entries() const { return entries_; }
  /// Observations, as the caller gave them.
  std::size_t size() const { return size_; }

 private:
  resident_entries<Memory> entries_;
  uploaded<typename Factor::row, Memory> rows_;
  std::optional<landmark_factor_view<Factor, Kernel>>
      view_;  ///< once assigned: a factor may have no default constructor
  std::size_t size_ = 0;
  int landmark_group_ = 0;
};

namespace detail {

/// What groups of one frame and between two share.
template <class Group, class Frame, class Memory, bool Pair>
class resident_frame_group {
 public:
  using group_type = Group;
  using factor = decltype(Group::factor);
  using kernel = decltype(Group::kernel);
  static constexpr bool with_landmarks = false, own_landmark_factors = false, reprojects = false;

  resident_frame_group(std::pmr::memory_resource* r, std::pmr::memory_resource*) : first_(r), second_(r), rows_(r) {}

  static void check(const Group& g, int frames, int) {
    const auto [first, second] = frames_of(g);
    require(g.rows.size() == first.size(), "rows.size()", g.rows.size(), "must be the number of factors");
    require_indices(first, frames, Pair ? "first" : "frame");
    require_kernel(g.kernel, "kernel");
    require_undefined_chi2(g.undefined_chi2);
    if (!Pair) return;
    require(second.size() == first.size(), "second.size()", second.size(), "must be that of first");
    require_indices(second, frames, "second");
    for (std::size_t i = 0; i < first.size(); ++i)
      require(first[i] != second[i], "second", second[i], "must not be the first frame");
  }
  static bool all_finite(const Group&) { return true; }  // residuals tell
  void describe(const Group& g, structure_inputs& to) { to.frame_groups.push_back(frames_of(g)); }

  template <class Policy>
  void assign(const Policy& policy, const Group& g, const adjustment_structure&, group_place& place) {
    keep(g);
    first_.send(policy), second_.send(policy), rows_.send(policy);
    enter(g, place);
  }

  /// Places in a block that is sent at once.
  struct slots {
    input_slot<std::int32_t> first, second;
    input_slot<typename factor::row> rows;
  };
  /// Reserves them.
  static slots reserve(packed_inputs& inputs, const Group& g) {
    const auto [first, second] = frames_of(g);
    const auto of_first = inputs.place<std::int32_t>(first.size()),
               of_second = inputs.place<std::int32_t>(second.size());
    return {of_first, of_second, inputs.place<typename factor::row>(g.rows.size())};
  }
  /// assign() by such a block, of which enter() is the second half. \param block  a block_sender
  template <class Block>
  void put(Block& block, const slots& s, const Group& g) {
    keep(g);
    first_.adopt(block.put(s.first, first_.host().data()));
    second_.adopt(block.put(s.second, second_.host().data()));
    rows_.adopt(block.put(s.rows, rows_.host().data()));
  }
  void enter(const Group& g, group_place& place) {
    const int n = static_cast<int>(size_);
    view_.emplace(frame_factor_view<factor, kernel>{first_.data(), second_.data(), rows_.data(), g.factor, g.kernel,
                                                    g.undefined_chi2, place, n});
    place.first_cost += n;
    place.first_factor_partial += Pair ? 2 * n : n;
    place.first_square += Pair ? n : 0;
  }

  template <class G, class Policy, class A>
  void linearise(const Policy& policy, const estimate_view<Frame>& x, const factor_sums<A>& sums,
                 const cost_sums& costs) const {
    launch_linearise_frame_factors<Pair>(policy, *view_, x, sums.factor_partial, sums.factor_square);
    if (costs.cost != nullptr) cost<G>(policy, x, costs);
  }
  template <class G, class Policy>
  void cost(const Policy& policy, const estimate_view<Frame>& x, const cost_sums& sums) const {
    launch_evaluate_frame_factors<Pair>(policy, *view_, x, sums);
  }

  /// See resident_reprojections.hpp. A residual that is not finite spoils its frames.
  template <class State, class Rows>
  TURBOMAP_ONE_BODY void list_rows(const adjustment_structure& structure, const State* states, const vec3<double>*,
                                   Rows& rows) const {
    constexpr int n = factor::size, D = Frame::dof;
    for (std::size_t i = 0; i < size_; ++i) {
      double e[n], d[2][n * D], rho, w;
      const auto a = static_cast<std::size_t>(first_.host()[i]);
      int other = -1;
      bool defined;
      if constexpr (Pair) {
        const auto b = static_cast<std::size_t>(second_.host()[i]);
        other = structure.free_of_frame[b];
        defined = turbomap::linearise<Frame>(view_->factor, states[a], states[b], rows_.host()[i], e, d[0], d[1]);
      } else {
        defined = turbomap::linearise<Frame>(view_->factor, states[a], rows_.host()[i], e, d[0]);
      }
      if (!defined) continue;
      view_->kernel(squared_length<n>(e), rho, w);
      rows.add(n, w, D, {}, {structure.free_of_frame[a], d[0]}, {other, d[1]});
    }
  }

  std::size_t size() const { return size_; }

 private:
  static frame_group_input frames_of(const Group& g) {
    if constexpr (Pair)
      return {g.first, g.second};
    else
      return {g.frame, {}};
  }

  /// On the host: list_rows() reads it.
  void keep(const Group& g) {
    const auto [first, second] = frames_of(g);
    first_.host().assign(first.begin(), first.end());
    second_.host().assign(second.begin(), second.end());
    rows_.host().assign(g.rows.begin(), g.rows.end());
    size_ = first.size();
  }

  uploaded<std::int32_t, Memory> first_, second_;
  uploaded<typename factor::row, Memory> rows_;
  std::optional<frame_factor_view<factor, kernel>> view_;
  std::size_t size_ = 0;
};

}  // namespace detail

template <class Factor, class Kernel, class Frame, class Memory>
class resident_group<frame_factors<Factor, Kernel>, Frame, Memory>
    : public detail::resident_frame_group<frame_factors<Factor, Kernel>, Frame, Memory, false> {
  using detail::resident_frame_group<frame_factors<Factor, Kernel>, Frame, Memory, false>::resident_frame_group;
};

template <class Factor, class Kernel, class Frame, class Memory>
class resident_group<frame_pair_factors<Factor, Kernel>, Frame, Memory>
    : public detail::resident_frame_group<frame_pair_factors<Factor, Kernel>, Frame, Memory, true> {
  using detail::resident_frame_group<frame_pair_factors<Factor, Kernel>, Frame, Memory, true>::resident_frame_group;
};

TURBOMAP_END_NAMESPACE
