// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The factor groups of a problem as it keeps them: checked, in the order of the structure, where the policy computes.

#include <cstdint>
#include <vector>

#include "../context.hpp"
#include "../error.hpp"
#include "factors.hpp"
#include "linearise_factors.hpp"
#include "linearise_frame_factors.hpp"
#include "linearise_reprojections.hpp"
#include "structure.hpp"
#include "uploaded.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

inline void require_indices(span<const std::int32_t> index, int end, const char* name) {
  for (const auto i : index) require(i >= 0 && i < end, name, i, "is no such frame or landmark");
}

/// Where a group's sums go.
struct group_place {
  int first_partial, first_cost, first_factor_partial, first_square;
};

}  // namespace detail

template <class Group, class Frame, class Policy>
class resident_group;

template <class Camera, class Kernel, class Frame, class Policy>
class resident_group<reprojections<Camera, Kernel>, Frame, Policy> {
 public:
  static_assert(require_camera<Camera>());
  using group_type = reprojections<Camera, Kernel>;
  using memory = memory_of_t<Policy>;
  static constexpr bool with_landmarks = true, between_frames = false;
  static constexpr int lanes = std::is_same_v<memory, host_memory> ? host_lanes : 1;

  explicit resident_group(std::pmr::memory_resource* r)
      : cameras_(r), chunks_(r), landmark_(r), row_(r), coupling_(r), u_(r), v_(r), u_right_(r), information_(r) {}

  static int size(const group_type& g) { return static_cast<int>(g.frame.size()); }

  /// Throws std::invalid_argument; changes nothing. \return whether all numbers are finite
  static bool check(const group_type& g, int frames, int landmarks) {
    const std::size_t n = g.frame.size();
    require(g.landmark.size() == n, "landmark.size()", g.landmark.size(), "must be that of frame");
    require(g.pixel.size() == n, "pixel.size()", g.pixel.size(), "must be that of frame");
    require(g.information.size() == n, "information.size()", g.information.size(), "must be that of frame");
    require(g.camera.empty() || g.camera.size() == n, "camera.size()", g.camera.size(), "must be that of frame, or 0");
    require(g.stereo.empty() || g.stereo.size() == n, "stereo.size()", g.stereo.size(), "must be that of frame, or 0");
    detail::require_indices(g.frame, frames, "frame");
    detail::require_indices(g.landmark, landmarks, "landmark");
    validate_rig(g.rig);
    require_correlation(g.stereo_correlation, "stereo_correlation");
    require(g.rig.count <= 127, "rig.count", g.rig.count, "must be below 128");
    for (const auto c : g.camera) require(c < g.rig.count, "camera", static_cast<int>(c), "is not in the rig");
    for (std::size_t i = 0; i < g.stereo.size(); ++i)
      require(g.stereo[i] == 0 || g.rig[g.camera.empty() ? 0 : g.camera[i]].bf > 0, "stereo", i,
              "is a row whose camera has no right image (bf = 0)");
    bool finite = true;
    for (std::size_t i = 0; i < n; ++i) {
      require(!(g.information[i] < 0), "information", g.information[i], "must not be negative");
      finite = finite && detail::is_finite(g.pixel[i].x) && detail::is_finite(g.pixel[i].y) &&
               detail::is_finite(g.information[i]) &&
               (g.stereo.empty() || g.stereo[i] == 0 || detail::is_finite(g.pixel[i].z));
    }
    return finite;
  }

  landmark_group_input structure_input(const group_type& g) {
    kind_.resize(g.frame.size());
    for (std::size_t i = 0; i < kind_.size(); ++i) {
      const int c = g.camera.empty() ? 0 : g.camera[i];
      const bool seen_right = g.pixel[i].z >= 0 && detail::is_finite(g.pixel[i].z) && g.rig[c].bf > 0;
      const bool stereo = g.stereo.empty() ? seen_right : g.stereo[i] != 0;
      kind_[i] = static_cast<std::uint8_t>(2 * c + (stereo ? 1 : 0));
    }
    return {g.frame, g.landmark, kind_.data(), 2 * g.rig.count};
  }

  void assign(const Policy& policy, const group_type& g, const group_structure& s, const detail::group_place& place) {
    place_ = place;
    count_ = static_cast<int>(g.frame.size());
    kernel_[0] = g.mono_kernel, kernel_[1] = g.stereo_kernel, undefined_chi2_ = g.undefined_chi2;
    cameras_.host().clear();
    for (int c = 0; c < g.rig.count; ++c) cameras_.host().emplace_back(g.rig[c], g.stereo_correlation);
    const std::size_t n = s.source.size();
    for (auto* a : {&u_, &v_, &u_right_, &information_}) a->host().resize(n);
    for (const auto& c : s.chunks)
      for (int i = c.begin;
           i < c.begin + (c.count + observation_padding - 1) / observation_padding * observation_padding; ++i) {
        const auto e = static_cast<std::size_t>(i), o = static_cast<std::size_t>(s.source[e]);
        u_.host()[e] = g.pixel[o].x, v_.host()[e] = g.pixel[o].y;
        u_right_.host()[e] = c.kind % 2 == 1 ? g.pixel[o].z : 0;
        information_.host()[e] = i < c.begin + c.count ? g.information[o] : 0;
      }
    cameras_.send(policy), u_.send(policy), v_.send(policy), u_right_.send(policy), information_.send(policy);
    chunks_.send_from(policy, s.chunks.data(), s.chunks.size());
    landmark_.send_from(policy, s.landmark.data(), n);
    row_.send_from(policy, s.row.data(), n);
    coupling_.send_from(policy, s.coupling.data(), n);
    chunk_count_ = static_cast<int>(s.chunks.size());
  }

  template <class G, class A, class State>
  void linearise(const Policy& policy, const State& x, const landmark_sums<A>& sums, double*, double*) const {
    for_each_index(
        policy, chunk_count_,
        linearise_reprojections<Camera, Kernel, G, A, lanes, Frame::landmark_dof>{view(), x.poses, x.landmarks, sums});
  }
  template <class G, class State>
  void cost(const Policy& policy, const State& x, double* cost, double* undefined) const {
    for_each_index(policy, chunk_count_,
                   cost_of_reprojections<Camera, Kernel, G, lanes>{view(), x.poses, x.landmarks, cost, undefined});
  }
  template <class State>
  void chi2(const Policy& policy, const State& x, double* chi2, double* depth) const {
    for_each_index(policy, chunk_count_,
                   chi2_of_reprojections<Camera, Kernel>{view(), x.poses, x.landmarks, chi2, depth});
  }
  int size() const { return count_; }

 private:
  reprojection_view<Camera, Kernel> view() const {
    return {chunks_.data(), cameras_.data(), landmark_.data(),    row_.data(),         coupling_.data(),
            u_.data(),      v_.data(),       u_right_.data(),     information_.data(), kernel_[0],
            kernel_[1],     undefined_chi2_, place_.first_partial};
  }

  uploaded<adjustment_camera<Camera>, memory> cameras_;
  uploaded<observation_chunk, memory> chunks_;
  uploaded<std::int32_t, memory> landmark_, row_, coupling_;
  uploaded<double, memory> u_, v_, u_right_, information_;
  std::vector<std::uint8_t> kind_;
  Kernel kernel_[2] = {};
  double undefined_chi2_ = 0;
  detail::group_place place_{};
  int chunk_count_ = 0, count_ = 0;
};

template <class Factor, class Kernel, class Frame, class Policy>
class resident_group<landmark_factors<Factor, Kernel>, Frame, Policy> {
 public:
  using group_type = landmark_factors<Factor, Kernel>;
  using memory = memory_of_t<Policy>;
  static constexpr bool with_landmarks = true, between_frames = false;

  explicit resident_group(std::pmr::memory_resource* r) : chunks_(r), landmark_(r), row_(r), coupling_(r), rows_(r) {}

  static int size(const group_type& g) { return static_cast<int>(g.frame.size()); }
  static bool check(const group_type& g, int frames, int landmarks) {
    require(g.landmark.size() == g.frame.size(), "landmark.size()", g.landmark.size(), "must be that of frame");
    require(g.rows.size() == g.frame.size(), "rows.size()", g.rows.size(), "must be that of frame");
    detail::require_indices(g.frame, frames, "frame");
    detail::require_indices(g.landmark, landmarks, "landmark");
    return true;
  }
  landmark_group_input structure_input(const group_type& g) { return {g.frame, g.landmark, nullptr, 1}; }

  void assign(const Policy& policy, const group_type& g, const group_structure& s, const detail::group_place& place) {
    group_.clear();
    group_.push_back(g), place_ = place;
    const std::size_t n = s.source.size();
    rows_.host().resize(n);
    for (const auto& c : s.chunks)
      for (int i = c.begin; i < c.begin + c.count; ++i) {
        const auto e = static_cast<std::size_t>(i);
        rows_.host()[e] = g.rows[static_cast<std::size_t>(s.source[e])];
      }
    rows_.send(policy);
    chunks_.send_from(policy, s.chunks.data(), s.chunks.size());
    landmark_.send_from(policy, s.landmark.data(), n);
    row_.send_from(policy, s.row.data(), n);
    coupling_.send_from(policy, s.coupling.data(), n);
    chunk_count_ = static_cast<int>(s.chunks.size()), count_ = static_cast<int>(g.frame.size());
  }

  template <class G, class A, class State>
  void linearise(const Policy& policy, const State& x, const landmark_sums<A>& sums, double*, double*) const {
    if (chunk_count_ == 0) return;
    for_each_index(policy, chunk_count_,
                   linearise_landmark_factors<Frame, Factor, Kernel, A>{view(), x.states, x.landmarks, sums});
  }
  template <class G, class State>
  void cost(const Policy& policy, const State& x, double* cost, double* undefined) const {
    evaluate(policy, x, cost, undefined, nullptr);
  }
  template <class State>
  void chi2(const Policy& policy, const State& x, double* chi2, double*) const {
    evaluate(policy, x, nullptr, nullptr, chi2);
  }
  int size() const { return count_; }

 private:
  template <class State>
  void evaluate(const Policy& policy, const State& x, double* cost, double* undefined, double* chi2) const {
    if (chunk_count_ == 0) return;
    for_each_index(
        policy, chunk_count_,
        cost_of_landmark_factors<Frame, Factor, Kernel>{view(), x.states, x.landmarks, cost, undefined, chi2});
  }
  landmark_factor_view<Factor, Kernel> view() const {
    const group_type& g = group_.front();
    return {chunks_.data(), landmark_.data(), row_.data(),      coupling_.data(),    rows_.data(),
            g.factor,       g.kernel,         g.undefined_chi2, place_.first_partial};
  }

  uploaded<observation_chunk, memory> chunks_;
  uploaded<std::int32_t, memory> landmark_, row_, coupling_;
  uploaded<typename Factor::row, memory> rows_;
  /// one, once assigned: a factor need not be default-constructible. Its views are not used
  std::vector<group_type> group_;
  detail::group_place place_{};
  int chunk_count_ = 0, count_ = 0;
};

namespace detail {

/// What groups of one frame and between two share.
template <class Group, class Frame, class Policy, bool Pair>
class resident_frame_group {
 public:
  using group_type = Group;
  using memory = memory_of_t<Policy>;
  using factor = decltype(Group::factor);
  using kernel = decltype(Group::kernel);
  static constexpr bool with_landmarks = false, between_frames = Pair;

  explicit resident_frame_group(std::pmr::memory_resource* r) : first_(r), second_(r), rows_(r) {}

  static span<const std::int32_t> first_of(const Group& g) {
    if constexpr (Pair)
      return g.first;
    else
      return g.frame;
  }
  static int size(const Group& g) { return static_cast<int>(first_of(g).size()); }
  static bool check(const Group& g, int frames, int) {
    const auto first = first_of(g);
    require(g.rows.size() == first.size(), "rows.size()", g.rows.size(), "must be the number of factors");
    require_indices(first, frames, Pair ? "first" : "frame");
    if constexpr (Pair) {
      require(g.second.size() == first.size(), "second.size()", g.second.size(), "must be that of first");
      require_indices(g.second, frames, "second");
      for (std::size_t i = 0; i < first.size(); ++i)
        require(first[i] != g.second[i], "second", g.second[i], "must not be the first frame");
    }
    return true;
  }

  void assign(const Policy& policy, const Group& g, const group_place& place) {
    group_.clear();
    group_.push_back(g), place_ = place;
    const auto first = first_of(g);
    first_.host().assign(first.begin(), first.end());
    if constexpr (Pair) second_.host().assign(g.second.begin(), g.second.end());
    rows_.host().assign(g.rows.begin(), g.rows.end());
    first_.send(policy), second_.send(policy), rows_.send(policy);
    count_ = static_cast<int>(first.size());
  }
  template <class G, class A, class State>
  void linearise(const Policy& policy, const State& x, const landmark_sums<A>&, double* partial, double* square) const {
    if (count_ == 0) return;
    for_each_index(policy, count_, linearise_frame_factors<Frame, factor, kernel>{view(), x.states, partial, square});
  }
  template <class G, class State>
  void cost(const Policy& policy, const State& x, double* cost, double* undefined) const {
    if (count_ == 0) return;
    for_each_index(policy, count_, cost_of_frame_factors<Frame, factor, kernel>{view(), x.states, cost, undefined});
  }
  int size() const { return count_; }

 private:
  frame_factor_view<factor, kernel> view() const {
    const Group& g = group_.front();
    return {
        first_.data(),     Pair ? second_.data() : nullptr, rows_.data(),       g.factor, g.kernel, g.undefined_chi2,
        place_.first_cost, place_.first_factor_partial,     place_.first_square};
  }

  uploaded<std::int32_t, memory> first_, second_;
  uploaded<typename factor::row, memory> rows_;
  std::vector<Group> group_;
  group_place place_{};
  int count_ = 0;
};

}  // namespace detail

template <class Factor, class Kernel, class Frame, class Policy>
class resident_group<frame_factors<Factor, Kernel>, Frame, Policy>
    : public detail::resident_frame_group<frame_factors<Factor, Kernel>, Frame, Policy, false> {
  using detail::resident_frame_group<frame_factors<Factor, Kernel>, Frame, Policy, false>::resident_frame_group;
};
template <class Factor, class Kernel, class Frame, class Policy>
class resident_group<frame_pair_factors<Factor, Kernel>, Frame, Policy>
    : public detail::resident_frame_group<frame_pair_factors<Factor, Kernel>, Frame, Policy, true> {
  using detail::resident_frame_group<frame_pair_factors<Factor, Kernel>, Frame, Policy, true>::resident_frame_group;
};

TURBOMAP_END_NAMESPACE
