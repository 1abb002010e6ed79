// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A bundle adjustment problem: frames, landmarks and groups of factors, taken from plain views, with its structure.

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "../array.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "factors.hpp"
#include "frames.hpp"
#include "linear_solver.hpp"
#include "resident_groups.hpp"
#include "schur.hpp"
#include "structure.hpp"
#include "uploaded.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Frames and landmarks where the policy computes.
template <class Frame>
struct adjustment_state {
  const typename Frame::template state<double>* states;
  const isometry<double>* poses;  ///< of the states, their quaternions normalised
  const double* landmarks;        ///< landmark_stride numbers each
};

/// Index = frame: its pose as a matrix.
template <class Frame>
struct prepare_poses {
  const typename Frame::template state<double>* states;
  isometry<double>* poses;
  TURBOMAP_HD void operator()(int f) const {
    poses[f] = to_isometry<double>(normalised(Frame::template pose<double>(states[f])));
  }
};

/// A problem and its current estimate. Make one per thread and use it for every adjustment: its memory is used again.
/// Move-only.
///
///     turbomap::bundle_problem<Policy, turbomap::pose_frame, turbomap::reprojections<turbomap::pinhole<double>>>
///     problem(ctx);
///     problem.assign(ctx, {poses, fixed}, {points}, observations);
///     const auto summary = turbomap::adjust(ctx, problem, options);
///     problem.frames(ctx, poses), problem.landmarks(ctx, points);
///
/// \tparam Frame   what a frame is: pose_frame, self_calibrated_frame or one's own (frames.hpp)
/// \tparam Groups  reprojections, landmark_factors, frame_factors, frame_pair_factors, in any number and order
/// (factors.hpp)
template <class Policy, class Frame, class... Groups>
class bundle_problem {
 public:
  using frame_type = Frame;
  using state = typename Frame::template state<double>;
  using memory = memory_of_t<Policy>;
  static constexpr int dof = Frame::dof;
  static constexpr int landmark_dof = Frame::landmark_dof;
  static_assert(std::is_trivially_copyable_v<state>, "turbomap: the state of a frame must be trivially copyable");
  static_assert(landmark_dof <= dof);

  /// \param ctx  whose memory resource it uses; give the same context to every call
  explicit bundle_problem(context<Policy>& ctx)
      : bundle_problem(ctx.resource(), std::index_sequence_for<Groups...>{}) {}

  /// Takes a problem, in place of the one before. Indices of frames and landmarks are places in the two inputs;
  /// nothing of
  /// the inputs is kept. O(observations), and in adjust() once O(pairs of frames that see one landmark).
  /// \throws std::invalid_argument  an index or a size is wrong; the problem is as it was. (std::bad_alloc: it is
  /// empty.)
  /// Numbers that are not finite are not refused here: adjust() then ends with adjustment_end::not_finite.
  void assign(context<Policy>& ctx, const frame_input<Frame>& frames, const landmark_input& landmarks,
              const Groups&... groups) {
    const int frame_count = static_cast<int>(frames.states.size());
    const int landmark_count = static_cast<int>(landmarks.positions.size());
    require(frames.fixed.empty() || frames.fixed.size() == frames.states.size(), "frames.fixed.size()",
            frames.fixed.size(), "must be that of states, or 0");
    require(landmarks.fixed.empty() || landmarks.fixed.size() == landmarks.positions.size(), "landmarks.fixed.size()",
            landmarks.fixed.size(), "must be that of positions, or 0");
    bool finite = true;
    ((finite = resident_group<Groups, Frame, Policy>::check(groups, frame_count, landmark_count) && finite), ...);
    for (const auto& p : landmarks.positions)
      finite = finite && detail::is_finite(p.x) && detail::is_finite(p.y) && detail::is_finite(p.z);
    for (const auto& x : frames.states) {
      const auto& T = Frame::template pose<double>(x);
      finite = finite && detail::is_finite(T.qx + T.qy + T.qz + T.qw) && detail::is_finite(T.tx + T.ty + T.tz);
    }

    finite_ = false, observations_ = 0;  // empty until all is there
    ctx.synchronize();
    try {
      build_structure(frames, landmark_count, groups...);
      place_groups(ctx.policy(), groups...);
      upload_state(ctx, frames, landmarks);
      send_lists(ctx.policy());
      ctx.synchronize();
    } catch (...) {
      structure_.frames = structure_.landmarks = 0;
      throw;
    }
    observations_ = (0 + ... + resident_group<Groups, Frame, Policy>::size(groups));
    finite_ = finite;
    blocks_known_ = blocks_sent_ = workspace_.analysed = false;
  }

  int frame_count() const { return structure_.frames; }
  int landmark_count() const { return structure_.landmarks; }
  int observation_count() const { return observations_; }

  /// The current estimate of the frames, in the order of the input: to the bit what was given where adjust() accepted
  /// no step.
  void frames(context<Policy>& ctx, std::vector<state>& result) const {
    result.resize(static_cast<std::size_t>(structure_.frames));
    copy_out(ctx.policy(), result.data(), states_[current_].data(), result.size() * sizeof(state));
    ctx.synchronize();
  }
  /// The current estimate of the landmarks.
  void landmarks(context<Policy>& ctx, std::vector<vec3<double>>& result) const {
    staging_.resize(static_cast<std::size_t>(structure_.landmarks) * landmark_stride);
    copy_out(ctx.policy(), staging_.data(), landmarks_[current_].data(), staging_.size() * sizeof(double));
    ctx.synchronize();
    result.resize(static_cast<std::size_t>(structure_.landmarks));
    for (std::size_t l = 0; l < result.size(); ++l)
      result[l] = {staging_[4 * l], staging_[4 * l + 1], staging_[4 * l + 2]};
  }

  /// chi2 (not robust) and depth (m, in its own camera) of every observation of a group of factors with landmarks, in
  /// the
  /// order of its input, at the current estimate: what outliers are told by. Not defined: undefined_chi2 and a depth
  /// as it is
  /// (0 for a user's own factors).
  template <std::size_t Group>
  void chi2(context<Policy>& ctx, std::vector<double>& chi2, std::vector<double>& depth) {
    using group_type = std::tuple_element_t<Group, std::tuple<resident_group<Groups, Frame, Policy>...>>;
    static_assert(group_type::with_landmarks);
    chi2.clear(), depth.clear();
    if (observations_ == 0) return;
    const auto& s = structure_.groups[landmark_group_index(Group)];
    const std::size_t n = s.source.size();
    ctx.begin_call();
    double* values = ctx.template scratch<double>(2 * n);
    fill_bytes(ctx.policy(), values, 0, 2 * n * sizeof(double));
    std::get<Group>(groups_).chi2(ctx.policy(), estimate(current_), values, values + n);
    staging_.resize(2 * n);
    copy_out(ctx.policy(), staging_.data(), values, 2 * n * sizeof(double));
    ctx.synchronize();
    const auto count = static_cast<std::size_t>(std::get<Group>(groups_).size());
    chi2.resize(count), depth.resize(count);
    for (const auto& c : s.chunks)
      for (int i = c.begin; i < c.begin + c.count; ++i) {
        const auto e = static_cast<std::size_t>(i), o = static_cast<std::size_t>(s.source[e]);
        chi2[o] = staging_[e], depth[o] = staging_[n + e];
      }
  }

  /// The structure that was made of the inputs, e.g. to look at sizes.
  const adjustment_structure& structure() const { return structure_; }

 private:
  template <class Problem, class G, class A>
  friend class levenberg_marquardt;
  template <class Problem, class G, class A>
  friend class normal_equations;
  template <class Problem>
  friend class covariance_solver;
  using uploaded_indices = uploaded<std::int32_t, memory>;
  static constexpr int list_count = 17, first_block_list = 12;
  static constexpr int chunk_size = std::is_same_v<memory, host_memory> ? 128 : observation_padding;

  template <std::size_t... I>
  bundle_problem(std::pmr::memory_resource* r, std::index_sequence<I...>)
      : groups_(((void)I, r)...),
        pairs_(r),
        neighbours_(r),
        landmark_fixed_(r),
        free_of_frame_(r),
        states_{array<state, memory>(r), array<state, memory>(r)},
        landmarks_{array<double, memory>(r), array<double, memory>(r)},
        poses_{array<isometry<double>, memory>(r), array<isometry<double>, memory>(r)} {
    for (int i = 0; i < list_count; ++i) lists_.emplace_back(r);
  }

  static constexpr std::size_t landmark_group_index(std::size_t group) {
    constexpr bool with[] = {resident_group<Groups, Frame, Policy>::with_landmarks..., false};
    std::size_t index = 0;
    for (std::size_t g = 0; g < group; ++g) index += with[g] ? 1 : 0;
    return index;
  }

  void build_structure(const frame_input<Frame>& frames, int landmark_count, const Groups&... groups) {
    landmark_inputs_.clear(), pair_groups_ = 0;
    std::apply([&](auto&... resident) { (add_structure_input(resident, groups), ...); }, groups_);
    builder_.build(landmark_count, frames.fixed, static_cast<int>(frames.states.size()),
                   span<const landmark_group_input>(landmark_inputs_), chunk_size, structure_);
  }
  template <class Resident, class Group>
  void add_structure_input(Resident& resident, const Group& group) {
    if constexpr (Resident::with_landmarks) {
      landmark_inputs_.push_back(resident.structure_input(group));
    } else if constexpr (Resident::between_frames) {  // kept: blocks are found later
      if (pair_first_.size() == pair_groups_) pair_first_.emplace_back();
      auto& [first, second] = pair_first_[pair_groups_++];
      first.assign(group.first.begin(), group.first.end()), second.assign(group.second.begin(), group.second.end());
    }
  }

  void place_groups(const Policy& policy, const Groups&... groups) {
    detail::group_place next{0, structure_.partials, 0, 0};
    std::size_t landmark_group = 0;
    factor_frame_.clear();
    std::apply([&](auto&... resident) { (place_group(policy, resident, groups, next, landmark_group), ...); }, groups_);
    costs_ = next.first_cost, factor_partials_ = next.first_factor_partial, squares_ = next.first_square;
    builder_.list_by_frame(factor_frame_, structure_.free_frames, frame_factor_, frame_factor_list_);
    list_neighbours();
  }
  /// Factors between two free frames, by each of them.
  void list_neighbours() {
    auto& all = all_neighbours_;
    auto& of = frame_of_neighbour_;
    all.clear(), of.clear();
    std::int32_t factor = 0;
    for (const auto& [first, second] : pair_first_)
      for (std::size_t i = 0; i < first.size(); ++i, ++factor) {
        const std::int32_t a = structure_.free_of_frame[static_cast<std::size_t>(first[i])];
        const std::int32_t b = structure_.free_of_frame[static_cast<std::size_t>(second[i])];
        of.push_back(b >= 0 ? a : -1), all.push_back({factor, b, 1});
        of.push_back(a >= 0 ? b : -1), all.push_back({factor, a, 0});
      }
    builder_.list_by_frame(of, structure_.free_frames, frame_pair_, neighbour_order_);
    neighbours_.host().clear();
    for (const auto i : neighbour_order_) neighbours_.host().push_back(all[static_cast<std::size_t>(i)]);
  }
  template <class Resident, class Group>
  void place_group(const Policy& policy, Resident& resident, const Group& group, detail::group_place& next,
                   std::size_t& landmark_group) {
    const int n = Resident::size(group);
    if constexpr (Resident::with_landmarks) {
      const auto& s = structure_.groups[landmark_group++];
      resident.assign(policy, group, s, next);
      next.first_partial += static_cast<int>(s.chunks.size());
    } else {
      resident.assign(policy, group, next);
      for (int i = 0; i < n; ++i) {
        const auto o = static_cast<std::size_t>(i);
        factor_frame_.push_back(structure_.free_of_frame[static_cast<std::size_t>(Resident::first_of(group)[o])]);
        if constexpr (Resident::between_frames)
          factor_frame_.push_back(structure_.free_of_frame[static_cast<std::size_t>(group.second[o])]);
      }
      next.first_cost += n;
      next.first_factor_partial += Resident::between_frames ? 2 * n : n;
      next.first_square += Resident::between_frames ? n : 0;
    }
  }

  void upload_state(context<Policy>& ctx, const frame_input<Frame>& frames, const landmark_input& landmarks) {
    current_ = 0;
    const std::size_t n = frames.states.size(), m = landmarks.positions.size();
    for (int k = 0; k < 2; ++k) {
      states_[k].resize_discard(n), poses_[k].resize_discard(n);
      landmarks_[k].resize_discard(landmark_stride * m);
    }
    staging_.resize(landmark_stride * m);
    for (std::size_t l = 0; l < m; ++l) {
      const vec3<double>& p = landmarks.positions[l];
      staging_[4 * l] = p.x, staging_[4 * l + 1] = p.y, staging_[4 * l + 2] = p.z, staging_[4 * l + 3] = 0;
    }
    copy_in(ctx.policy(), states_[0].data(), frames.states.data(), n * sizeof(state));
    copy_in(ctx.policy(), landmarks_[0].data(), staging_.data(), staging_.size() * sizeof(double));
    has_fixed_landmarks_ = !landmarks.fixed.empty();
    landmark_fixed_.host().assign(landmarks.fixed.begin(), landmarks.fixed.end());
    landmark_fixed_.send(ctx.policy());
    for_each_index(ctx.policy(), static_cast<int>(n), prepare_poses<Frame>{states_[0].data(), poses_[0].data()});
  }

  void send_lists(const Policy& policy) {
    const std::vector<std::int32_t>* lists[] = {
        &structure_.landmark_row, &structure_.landmark_slot, &structure_.slot_coupling,
        &structure_.slot_frame,   &structure_.slot_landmark, &structure_.frame_partial,
        &structure_.partial_list, &structure_.frame_slot,    &structure_.slot_list,
        &frame_factor_,           &frame_factor_list_,       &frame_pair_};
    for (std::size_t i = 0; i < std::size(lists); ++i) lists_[i].send_from(policy, lists[i]->data(), lists[i]->size());
    neighbours_.send(policy);
    free_of_frame_.send_from(policy, structure_.free_of_frame.data(), structure_.free_of_frame.size());
  }

  /// The lists of the blocks: made when the first solver asks for them.
  void find_blocks() {
    if (blocks_known_) return;
    pair_inputs_.clear();
    for (const auto& p : pair_first_) pair_inputs_.push_back({p.first, p.second});
    builder_.find_blocks(span<const frame_pair_input>(pair_inputs_), structure_);
    blocks_known_ = true;
  }
  void send_blocks(const Policy& policy) {
    if (blocks_sent_) return;
    const std::vector<std::int32_t>* lists[] = {&structure_.block_row, &structure_.block_column, &structure_.block_pair,
                                                &structure_.block_factor, &structure_.factor_list};
    for (std::size_t i = 0; i < std::size(lists); ++i)
      lists_[first_block_list + i].send_from(policy, lists[i]->data(), lists[i]->size());
    pairs_.send_from(policy, structure_.pairs.data(), structure_.pairs.size());
    blocks_sent_ = true;
  }

  adjustment_state<Frame> estimate(int which) const {
    return {states_[which].data(), poses_[which].data(), landmarks_[which].data()};
  }

  std::tuple<resident_group<Groups, Frame, Policy>...> groups_;
  adjustment_structure structure_;
  structure_builder builder_;
  std::vector<landmark_group_input> landmark_inputs_;
  std::vector<std::pair<std::vector<std::int32_t>, std::vector<std::int32_t>>> pair_first_;
  std::vector<frame_pair_input> pair_inputs_;
  std::vector<frame_neighbour> all_neighbours_;
  std::vector<std::int32_t> factor_frame_, frame_factor_, frame_factor_list_, frame_pair_, neighbour_order_,
      frame_of_neighbour_;
  std::vector<uploaded_indices> lists_;  ///< in the order of send_lists(), then of send_blocks()
  uploaded<slot_pair, memory> pairs_;
  uploaded<frame_neighbour, memory> neighbours_;
  uploaded<std::uint8_t, memory> landmark_fixed_;
  uploaded_indices free_of_frame_;
  array<state, memory> states_[2];
  array<double, memory> landmarks_[2];
  array<isometry<double>, memory> poses_[2];
  reduced_workspace<Frame::dof> workspace_;
  mutable std::vector<double> staging_;
  std::size_t pair_groups_ = 0;
  int current_ = 0, observations_ = 0, costs_ = 0, factor_partials_ = 0, squares_ = 0;
  bool finite_ = false, has_fixed_landmarks_ = false, blocks_known_ = false, blocks_sent_ = false;
};

TURBOMAP_END_NAMESPACE
