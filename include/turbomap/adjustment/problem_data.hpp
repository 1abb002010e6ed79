// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What the solvers of a problem work on: its structure, its factors, its estimate. bundle_problem fills it; adjust() and
/// frame_covariance() are handed it.

#include <cstddef>
#include <cstdint>
#include <memory_resource>
#include <tuple>

#include "../array.hpp"
#include "../config.hpp"
#include "../span.hpp"
#include "cholesky_solver.hpp"
#include "factor_sums.hpp"
#include "landmark_order.hpp"
#include "resident_group.hpp"
#include "resident_structure.hpp"
#include "structure.hpp"
#include "structure_builder.hpp"
#include "uploaded.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The current estimate of frames and landmarks, and a trial one beside it.
template <class Frame, class Memory>
class estimates {
 public:
  using state = typename Frame::template state<double>;  ///< of a frame

  /// Empty. \param r  memory of the policy; must outlive this
  explicit estimates(std::pmr::memory_resource* r) : pair_{one(r), one(r)} {}

  /// Room for frames and landmarks; what was there is lost.
  void resize(std::size_t frames, std::size_t landmarks) {
    current_ = 0;
    for (one& x : pair_) {
      x.states.resize_discard(frames), x.poses.resize_discard(frames);
      x.landmarks.resize_discard(landmark_stride * landmarks);
    }
  }
  /// The trial becomes the current one.
  void accept() { current_ = 1 - current_; }

  /// What the last accepted step left.
  estimate_view<Frame> current() { return pair_[current_].view(); }
  /// Where the next step is tried.
  estimate_view<Frame> trial() { return pair_[1 - current_].view(); }
  /// States of the current estimate, one per frame.
  const state* states() const { return pair_[current_].states.data(); }
  /// Landmarks of the current estimate, landmark_stride numbers each.
  const double* landmarks() const { return pair_[current_].landmarks.data(); }

 private:
  struct one {
    explicit one(std::pmr::memory_resource* r) : states(r), poses(r), landmarks(r) {}
    estimate_view<Frame> view() { return {states.data(), poses.data(), landmarks.data()}; }

    array<state, Memory> states;
    array<isometry<double>, Memory> poses;
    array<double, Memory> landmarks;
  };

  one pair_[2];
  int current_ = 0;
};

/// All that belongs to one problem. \tparam Memory  of the policy   \tparam Groups  of factors, as the caller names them
template <class Memory, class FrameType, class... Groups>
struct problem_data {
  using frame = FrameType;                                  ///< kind of frame
  static constexpr int dof = frame::dof;                    ///< unknowns of a frame
  static constexpr int landmark_dof = frame::landmark_dof;  ///< of which landmarks depend on the first so many
  /// Whether no group of the user's own has landmarks: couplings can then be made of rows. Of frames with a pose, which
  /// reprojections need: a problem without landmarks may have others.
  static constexpr bool reprojections_only =
      landmark_dof >= 6 && !(resident_group<Groups, frame, Memory>::own_landmark_factors || ...);

  /// Whether the policy makes the lists of observations, where they are not too long: see order_observations.hpp.
  /// Of one group with landmarks, the first, which is reprojections.
  static constexpr bool orders_there =
      !is_host_accessible_v<Memory> &&
      (0 + ... + (resident_group<Groups, frame, Memory>::with_landmarks ? 1 : 0)) == 1 &&
      std::tuple_element_t<0, std::tuple<resident_group<Groups, frame, Memory>...>>::reprojects;

  /// \param staging  see context::staging_resource()
  problem_data(std::pmr::memory_resource* r, std::pmr::memory_resource* staging)
      : groups(resident_group<Groups, frame, Memory>(r, staging)...),
        lists(r),
        landmark_fixed(r),
        held(r),
        inputs(r),
        estimate(r),
        workspace(staging) {}

  adjustment_structure structure;  ///< order of observations, and lists of what is summed into what
  landmark_order order;            ///< numbers of landmarks here are places in it
  std::tuple<resident_group<Groups, frame, Memory>...> groups;  ///< the factors
  resident_structure<Memory> lists;                             ///< the lists where the policy computes
  uploaded<std::uint8_t, Memory> landmark_fixed;                ///< empty: all move
  uploaded<std::uint32_t, Memory> held;  ///< [free frame] masks of unknowns that stay; empty: none
  array<std::byte, Memory> inputs;       ///< what was given, in one block: where the policy orders it
  estimates<frame, Memory> estimate;     ///< states and landmarks
  solver_workspace<dof> workspace;       ///< of the solvers
  std::size_t observations = 0;          ///< 0: there is nothing to adjust
  bool finite = false;                   ///< of all numbers that were given

  /// Masks of the free frames; none where no unknown is held. \param of_frames  [frame] masks; empty: none
  void hold(span<const std::uint32_t> of_frames) {
    auto& masks = held.host();
    masks.clear();
    std::uint32_t any = 0;
    for (const auto f : structure.frame_of_free)
      if (!of_frames.empty()) masks.push_back(of_frames[static_cast<std::size_t>(f)]), any |= masks.back();
    if (any == 0) masks.clear();
  }
  /// Those masks where the policy computes; null: none.
  const std::uint32_t* held_masks() const { return held.host().empty() ? nullptr : held.data(); }
  /// Whether any landmark that is seen moves.
  bool landmarks_move() const {
    const auto& row = structure.landmark_row;
    const auto& fixed = landmark_fixed.host();
    if (fixed.empty()) return structure.rows() > 0;
    if (structure.elsewhere) return structure.sizes.moving > 0;
    for (std::size_t l = 0; l < fixed.size(); ++l)
      if (fixed[l] == 0 && row[l + 1] > row[l]) return true;
    return false;
  }
  /// The lists of the blocks, where the policy computes: made when the first solver asks for them.
  template <class Policy>
  void need_blocks(const Policy& policy) {
    need_lists(policy);
    if (!blocks_known_) finder_.find(structure);
    blocks_known_ = true;
    if (!blocks_sent_) lists.send_blocks(policy, structure);
    blocks_sent_ = true;
  }
  /// Blocks of the reduced matrix that are not diagonal ones.
  template <class Policy>
  std::int64_t count_blocks(const Policy& policy) {
    need_lists(policy);
    return finder_.count_blocks(structure);
  }
  /// The lists of slots on the host too: fetched, where the policy made them. Waits then.
  template <class Policy>
  void need_lists(const Policy& policy) {
    if constexpr (orders_there) {
      if (!structure.elsewhere) return;
      lists.fetch(policy, structure);
      turbomap::synchronize(policy);
      structure.elsewhere = false;
    }
  }
  /// Those and the observations themselves, with their rows.
  template <class Policy>
  void need_rows(const Policy& policy) {
    need_lists(policy);
    if constexpr (orders_there) {
      if (!structure.groups_elsewhere) return;
      std::get<0>(groups).fetch(policy, structure);
      structure.groups_elsewhere = false;
    }
  }
  /// After a change of the structure.
  void forget_blocks() { blocks_known_ = blocks_sent_ = workspace.analysed = false; }

 private:
  block_finder finder_;
  bool blocks_known_ = false, blocks_sent_ = false;
};

TURBOMAP_END_NAMESPACE
