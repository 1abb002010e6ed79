// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A bundle adjustment problem: frames, landmarks and groups of factors, taken from plain views, and their current estimate.
/// levenberg_marquardt.hpp adjusts it, covariance.hpp tells how certain its frames are.

#include <cstddef>
#include <cstdint>
#include <tuple>
#include <type_traits>

#include "../array.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../plain_vector.hpp"
#include "../precompiled.hpp"
#include "assign_by_host.hpp"
#include "assign_resident.hpp"
#include "factors.hpp"
#include "frames.hpp"
#include "problem_check.hpp"
#include "problem_data.hpp"
#include "resident_factors.hpp"
#include "resident_reprojections.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A problem and its current estimate. Make one per thread and use it for every adjustment: its memory is used again.
/// Move-only. See bundle_problem, which names it by a policy.
///
/// \tparam Memory  where it is kept and computed
/// \tparam Frame   what a frame is: pose_frame, self_calibrated_frame or the user's own (frames.hpp)
/// \tparam Groups  reprojections, landmark_factors, frame_factors, frame_pair_factors, in any number and order
///                 (factors.hpp)
template <class Memory, class Frame, class... Groups>
class basic_bundle_problem {
 public:
  /// What is adjusted of a frame.
  using state = typename Frame::template state<double>;
  /// The problem as solvers read it.
  using data_type = problem_data<Memory, Frame, Groups...>;
  static_assert(std::is_trivially_copyable_v<state>, "turbomap: the state of a frame must be trivially copyable");
  static_assert(Frame::landmark_dof >= 1 && Frame::landmark_dof <= Frame::dof,
                "turbomap: landmark_dof of a frame is 1 to its dof, also where no factor has landmarks");

  /// \param ctx  whose memory resource it uses; give the same context to every call
  template <class Policy>
  explicit basic_bundle_problem(context<Policy>& ctx)
      : data_(ctx.resource(), ctx.staging_resource()),
        transfer_(ctx.staging_resource()),
        state_transfer_(ctx.staging_resource()),
        row_transfer_(ctx.staging_resource()) {}

  /// Takes a problem, in place of the one before. Indices of frames and landmarks are places in the two inputs; nothing of
  /// the inputs is kept. O(observations), and in adjust() once O(pairs of frames that see one landmark).
  /// Numbers that are not finite are not refused here: adjust() then ends with adjustment_end::not_finite.
  /// Under CUDA, large arrays of reprojections and landmarks are copied from where they are if that is page-locked memory.
  /// \throws std::invalid_argument  an index, a size or a kernel is wrong, or a quaternion not of unit length; the problem
  ///         is as it was. (std::bad_alloc: it is empty.)
  template <class Policy>
  void assign(context<Policy>& ctx, const frame_input<Frame>& frames, const landmark_input& landmarks,
              const Groups&... groups);

  /// Frames, fixed ones too.
  int frame_count() const { return data_.structure.frames; }
  /// Landmarks, fixed ones too.
  int landmark_count() const { return data_.structure.landmarks; }
  /// Of all groups of factors.
  int observation_count() const { return static_cast<int>(data_.observations); }

  /// The current estimate of the frames, in the order of the input: to the bit what was given where adjust() accepted no
  /// step.
  /// \param result  a std::vector or another list of states
  template <class Policy, class List>
  void frames(context<Policy>& ctx, List& result) const {
    result.resize(static_cast<std::size_t>(frame_count()));
    copy_out(ctx.policy(), result.data(), data_.estimate.states(), result.size() * sizeof(state));
    ctx.synchronize();
  }
  /// The current estimate of the landmarks.
  template <class Policy, class List>
  void landmarks(context<Policy>& ctx, List& result) const {
    const double* const p = ctx.on_host(data_.estimate.landmarks(), numbers_of_landmarks(), transfer_);
    ctx.synchronize();
    unpack(p, result);
  }

  /// chi2 (not robust) and depth (m, in its own camera) of every observation of a group of factors with landmarks, in the
  /// order of its input, at the current estimate: what outliers are told by. Not defined: undefined_chi2, and a depth as it
  /// is (0 for the user's own factors).
  template <std::size_t Group, class Policy, class List>
  void chi2(context<Policy>& ctx, List& chi2, List& depth);

  /// frames(), landmarks() and chi2() together: waits once.
  template <std::size_t Group, class Policy, class States, class Positions, class List>
  void results(context<Policy>& ctx, States& frames, Positions& landmarks, List& chi2, List& depth);

  /// The structure that was made of the inputs, e.g. to look at sizes. Where the policy made its lists, they are not here.
  const adjustment_structure& structure() const { return data_.structure; }

  /// For solvers: everything they work on.
  data_type& data() { return data_; }

 private:
  structure_input describe(const frame_input<Frame>& frames, const landmark_input& landmarks, const Groups&... groups) {
    inputs_.landmark_groups.clear(), inputs_.frame_groups.clear();
    std::apply([&](auto&... g) { (g.describe(groups, inputs_), ...); }, data_.groups);
    return {static_cast<int>(frames.states.size()),
            static_cast<int>(landmarks.positions.size()),
            frames.fixed,
            span<const landmark_group_input>(inputs_.landmark_groups),
            span<const frame_group_input>(inputs_.frame_groups),
            observation_shape<Memory>::chunk};
  }

  std::size_t numbers_of_landmarks() const { return static_cast<std::size_t>(landmark_count()) * landmark_stride; }
  /// From landmarks in the order that solvers have to the order of the input.
  template <class List>
  void unpack(const double* p, List& result) const {
    result.resize(static_cast<std::size_t>(landmark_count()));
    for (std::size_t l = 0; l < result.size(); ++l, p += landmark_stride)
      result[static_cast<std::size_t>(data_.order.source()[l])] = {p[0], p[1], p[2]};
  }
  /// chi2 of every row, then their depths, where the policy computes. Null: there are none.
  template <std::size_t Group, class Policy>
  const double* launch_chi2(context<Policy>& ctx) {
    const auto& group = std::get<Group>(data_.groups);
    static_assert(std::decay_t<decltype(group)>::with_landmarks);
    if (data_.observations == 0) return nullptr;
    const std::size_t n = group.entries().size(), rows = group.size();
    ctx.begin_call();
    double* values = ctx.template scratch<double>(2 * n);
    double* of_rows = ctx.template scratch<double>(2 * rows);
    fill_bytes(ctx.policy(), values, 0, 2 * n * sizeof(double));
    group.chi2(ctx.policy(), data_.estimate.current(), values, values + n);
    launch_return_rows(ctx.policy(), group.entries(), values, n, of_rows, rows);
    return of_rows;
  }
  /// What launch_chi2() made, on the host.
  template <class List>
  static void unpack(const double* told, std::size_t rows, List& chi2, List& depth) {
    chi2.resize(rows), depth.resize(rows);
    for (std::size_t i = 0; i < rows; ++i) chi2[i] = told[i], depth[i] = told[rows + i];
  }

  data_type data_;
  structure_builder builder_;
  structure_inputs inputs_;
  mutable array<double, host_memory> transfer_;  ///< what is on its way to the policy or back
  array<state, host_memory> state_transfer_;
  array<double, host_memory> row_transfer_;
};

// Out of the class, so that a file that finds them precompiled does not compile them.

template <class Memory, class Frame, class... Groups>
template <class Policy>
void basic_bundle_problem<Memory, Frame, Groups...>::assign(context<Policy>& ctx, const frame_input<Frame>& frames,
                                                            const landmark_input& landmarks, const Groups&... groups) {
  detail::check_sizes(frames, landmarks);
  const auto frame_total = static_cast<int>(frames.states.size());
  const auto landmark_total = static_cast<int>(landmarks.positions.size());
  (resident_group<Groups, Frame, Memory>::check(groups, frame_total, landmark_total), ...);
  detail::check_rotations(frames);
  data_.finite = false, data_.observations = 0;  // empty until all is there
  data_.structure.elsewhere = data_.structure.groups_elsewhere = false;
  ctx.synchronize();
  bool finite = detail::all_finite(frames), assigned = false;
  try {
    const structure_input in = describe(frames, landmarks, groups...);
    if constexpr (data_type::orders_there) {
      const auto there = assign_resident(ctx, data_, builder_, in, frames, landmarks, groups...);
      assigned = there.done, finite = finite && there.finite;
    }
    if (!assigned) {
      assign_by_host(ctx, data_, builder_, in, frames, landmarks, transfer_, groups...);
      finite = finite && detail::all_finite(landmarks);
      ((finite = finite && resident_group<Groups, Frame, Memory>::all_finite(groups)), ...);
    }
  } catch (...) {
    ctx.settle();  // the caller may free what is being copied
    data_.structure.frames = data_.structure.landmarks = 0;
    throw;
  }
  std::apply([&](auto&... g) { data_.observations = (std::size_t{0} + ... + g.size()); }, data_.groups);
  data_.finite = finite;
  data_.forget_blocks();
}

template <class Memory, class Frame, class... Groups>
template <std::size_t Group, class Policy, class List>
void basic_bundle_problem<Memory, Frame, Groups...>::chi2(context<Policy>& ctx, List& chi2, List& depth) {
  chi2.clear(), depth.clear();
  const double* const of_rows = launch_chi2<Group>(ctx);
  if (of_rows == nullptr) return;
  const std::size_t rows = std::get<Group>(data_.groups).size();
  const double* const told = ctx.on_host(of_rows, 2 * rows, transfer_);
  ctx.synchronize();
  unpack(told, rows, chi2, depth);
}

template <class Memory, class Frame, class... Groups>
template <std::size_t Group, class Policy, class States, class Positions, class List>
void basic_bundle_problem<Memory, Frame, Groups...>::results(context<Policy>& ctx, States& frames, Positions& landmarks,
                                                             List& chi2, List& depth) {
  const double* const of_rows = launch_chi2<Group>(ctx);
  const auto n = static_cast<std::size_t>(frame_count());
  const std::size_t rows = of_rows == nullptr ? 0 : std::get<Group>(data_.groups).size();
  if constexpr (!is_host_accessible_v<Memory>) {  // before the first copy: none is under way where memory runs out
    state_transfer_.resize_discard(n), transfer_.resize_discard(numbers_of_landmarks());
    row_transfer_.resize_discard(2 * rows);
  }
  const state* const x = ctx.on_host(data_.estimate.states(), n, state_transfer_);
  const double* const p = ctx.on_host(data_.estimate.landmarks(), numbers_of_landmarks(), transfer_);
  const double* const told = ctx.on_host(of_rows, 2 * rows, row_transfer_);
  ctx.synchronize();
  frames.resize(n);
  for (std::size_t f = 0; f < n; ++f) frames[f] = x[f];
  unpack(p, landmarks);
  unpack(told, rows, chi2, depth);
}

/// A problem that is computed under a policy. Problems of all host policies are one type.
///
///     using rows = turbomap::reprojections<turbomap::pinhole<double>>;
///     turbomap::bundle_problem<Policy, turbomap::pose_frame, rows> problem(ctx);
///     problem.assign(ctx, {poses, fixed}, {points}, observations);
///     const auto summary = turbomap::adjust(ctx, problem, options);
///     problem.frames(ctx, poses), problem.landmarks(ctx, points);
template <class Policy, class Frame, class... Groups>
using bundle_problem = basic_bundle_problem<memory_of_t<Policy>, Frame, Groups...>;

#define TURBOMAP_INSTANTIATE(Camera, Policy)                                                                        \
  TURBOMAP_INSTANCE void basic_bundle_problem<memory_of_t<Policy>, pose_frame, reprojections<Camera>>::assign(      \
      context<Policy>&, const frame_input<pose_frame>&, const landmark_input&, const reprojections<Camera>&);       \
  TURBOMAP_INSTANCE void basic_bundle_problem<memory_of_t<Policy>, pose_frame, reprojections<Camera>>::chi2<0>(     \
      context<Policy>&, plain_vector<double>&, plain_vector<double>&);                                              \
  TURBOMAP_INSTANCE void basic_bundle_problem<memory_of_t<Policy>, pose_frame, reprojections<Camera>>::results<0>(  \
      context<Policy>&, plain_vector<rigid_transform<double>>&, plain_vector<vec3<double>>&, plain_vector<double>&, \
      plain_vector<double>&);
TURBOMAP_PRECOMPILED_ADJUSTMENTS(TURBOMAP_INSTANTIATE)
#undef TURBOMAP_INSTANTIATE

TURBOMAP_END_NAMESPACE
