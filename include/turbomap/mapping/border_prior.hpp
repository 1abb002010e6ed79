// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What is known of the keyframe before a window, its *border*, from all that left the window before it. A window that was
/// adjusted is remembered; when the next one begins later, its older frames are marginalised one after the other: what is
/// known of one, what is seen from it and the edge to the next give what is known of that one.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "../adjustment/pose_information.hpp"
#include "../config.hpp"
#include "../inertial/inertial_edges.hpp"
#include "../inertial/inertial_factors.hpp"
#include "../inertial/inertial_frame.hpp"
#include "../inertial/inertial_window_options.hpp"
#include "../inertial/marginal_prior.hpp"
#include "../math/rotation.hpp"
#include "../plain_vector.hpp"
#include "../types.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Remembers one window by the ids of its keyframes: none is kept alive for it. Frames are counted back in time, as in
/// inertial_window.
class border_prior {
 public:
  /// Of one keyframe.
  struct knowledge {
    marginal_prior_factor::row row;  ///< of all 15 unknowns
    std::uint32_t held = 0;          ///< unknowns that are not to move: those that hold the gauge where the map begins
    bool first = false;              ///< the map begins with it: nothing is known, and that is all there is to know
  };

  /// Nothing is known of any keyframe.
  void forget() { ids_.clear(), states_.clear(), seen_.clear(), held_.clear(), known_.reset(); }

  /// Of another gravity or T_bc nothing is known either.
  void forget_unless(const inertial_factor& factor) {
    const vec3<double>&g = factor.gravity, &t = factor.T_bc.t;
    bool same = g.x == factor_.gravity.x && g.y == factor_.gravity.y && g.z == factor_.gravity.z &&
                t.x == factor_.T_bc.t.x && t.y == factor_.T_bc.t.y && t.z == factor_.T_bc.t.z;
    for (int k = 0; k < 9; ++k) same = same && factor.T_bc.R.m[k] == factor_.T_bc.R.m[k];
    if (!same) forget();
  }

  /// A window was adjusted, and written to the map. Where memory ends, nothing is known. O(frames and edges of its chain)
  /// \param states  by frame, as adjusted   \param seen  by frame of the chain, at these states
  template <class Window>
  void keep(const Window& window, const plain_vector<inertial_state<double>>& states,
            const plain_vector<pose_information>& seen, const inertial_factor& factor,
            const inertial_window_options& options) {
    forget();
    const std::size_t count = window.chain();
    if (count < 2) return;  // of a keyframe alone nothing was learnt
    states_.append(states.data(), count);
    held_.append(window.held().data(), count), seen_ = seen;
    if (window.prior() != nullptr)
      known_ = *window.prior();
    else if (window.fixed()[count - 1] == 0)
      known_ = knowledge{{states[count - 1], {}, {}}, held_[count - 1], true};
    edges_ = window.edges(), factor_ = factor, options_ = options;
    ids_.append(window.frames().ids().data(), count);  // last: of what has no id here nothing is known
  }

  /// What is known of a keyframe that is the border now. Empty: nothing is, since it was not in the window that was kept,
  /// since an interval before it was not measured, or since its state is not the one that was written: who moves keyframes,
  /// e.g. closes a loop, changes what is known of them. O(frames that left, times edges)
  std::optional<knowledge> of(std::uint64_t id, const inertial_state<double>& x) {
    std::size_t f = 0;
    while (f < ids_.size() && ids_[f] != id) ++f;
    if (f == ids_.size() || !is_near(states_[f], x)) return {};
    std::optional<knowledge> known = known_;
    for (std::size_t at = ids_.size() - 1; at > f; --at)
      if (!advance(at, known)) return {};  // a hole in the chain: nothing is known beyond it
    return known;
  }

 private:
  /// From what is known of frame `at` to what is known of the next one. False: no edge is between them.
  bool advance(std::size_t at, std::optional<knowledge>& known) {
    const inertial_state<double>&leaves = states_[at], &stays = states_[at - 1];
    out_.clear(known ? held_[at] : inertial_frame::hold_pose | inertial_frame::visual_only);
    marginal_prior_factor::row pose;
    if (known) out_.add(marginal_prior_factor{}, known->row, leaves);
    if (make_pose_prior(leaves, seen_[at], pose)) out_.add(marginal_prior_factor{}, pose, leaves);
    if (!edges_.marginalise(static_cast<std::int32_t>(at), static_cast<std::int32_t>(at - 1), leaves, stays, factor_,
                            options_, out_))
      return false;
    known = knowledge{out_.prior(stays), 0};
    return true;
  }
  /// A map may round states to float.
  static bool is_near(const inertial_state<double>& x, const inertial_state<double>& at) {
    double d[15];
    marginal_prior_factor::difference(x, at, d);
    const double size[5] = {1, 1 + norm(translation(at.T_cw)), 1 + norm(at.velocity), 1, 1};
    for (int k = 0; k < 15; ++k)
      if (!(std::abs(d[k]) < 1e-5 * size[k / 3])) return false;
    return true;
  }

  plain_vector<std::uint64_t> ids_;              ///< [frame]
  plain_vector<inertial_state<double>> states_;  ///< [frame] as adjusted
  plain_vector<std::uint32_t> held_;             ///< [frame]
  plain_vector<pose_information> seen_;          ///< [frame]
  std::optional<knowledge> known_;               ///< of the last frame; none: it was fixed
  inertial_edges edges_;
  inertial_factor factor_;
  inertial_window_options options_;
  state_marginaliser out_;
};

TURBOMAP_END_NAMESPACE
