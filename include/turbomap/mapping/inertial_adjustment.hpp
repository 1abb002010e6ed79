// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stage that adjusts the last keyframes in time with what the IMU measured between them [ORB-SLAM3]: their poses,
/// velocities and biases, and the points that they see, so that reprojection errors and the contradictions to the IMU are
/// smallest together. Until the IMU of the map is initialised it adjusts as local_adjustment.

#include <cstddef>
#include <cstdint>

#include "../adjustment/levenberg_marquardt.hpp"
#include "../adjustment/pose_information.hpp"
#include "../adjustment/problem.hpp"
#include "../config.hpp"
#include "../error.hpp"
#include "../inertial/inertial_edges.hpp"
#include "../inertial/inertial_factors.hpp"
#include "../inertial/inertial_frame.hpp"
#include "../inertial/marginal_prior.hpp"
#include "../map/inertial_traits.hpp"
#include "../math/number_checks.hpp"
#include "../plain_vector.hpp"
#include "adjustment_commit.hpp"
#include "border_prior.hpp"
#include "inertial_adjustment_options.hpp"
#include "inertial_window.hpp"
#include "local_adjustment.hpp"
#include "mirror_inertial_traits.hpp"
#include "stage.hpp"
#include "window_measurements.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Throws std::invalid_argument naming the option that is out of range.
inline void check(const inertial_adjustment_options& o) {
  // Names are made only where something is wrong.
  const auto check_window = [](const argument_name& name, const inertial_window_options& w) {
    if (!(w.keyframes >= 1)) reject(name + ".keyframes", w.keyframes, "must be positive");
    if (!(w.iterations >= 1)) reject(name + ".iterations", w.iterations, "must be positive");
    if (!(w.initial_lambda >= 0 && detail::is_finite(w.initial_lambda)))
      reject(name + ".initial_lambda", w.initial_lambda, "must be finite and not negative");
    if (!(w.robust_chi2 > 0 && detail::is_finite(w.robust_chi2)))
      reject(name + ".robust_chi2", w.robust_chi2, "must be finite and positive");
    if (!(w.oldest_edge_weight > 0 && w.oldest_edge_weight <= 1))
      reject(name + ".oldest_edge_weight", w.oldest_edge_weight, "must be in (0, 1]");
  };
  check_window("options.window", o.window), check_window("options.large", o.large);
  require(o.most_observers >= 0, "options.most_observers", o.most_observers, "must not be negative");
  require(o.fewest_edges >= 0, "options.fewest_edges", o.fewest_edges, "must not be negative");
  require(o.near_depth >= 0, "options.near_depth", o.near_depth, "must not be negative");
  require(o.max_time_error >= 0, "options.max_time_error", o.max_time_error, "must not be negative");
  check_positive("options.max_force", o.max_force);
}

/// As local_adjustment, with inertial_traits<Map>. The window is an inertial_window; its size, iterations and damping are those
/// of the options here, all others those of local_adjustment_options. The adjustment that a local_mapper in inertial mode is
/// given by type.
template <class Map, class Policy, class Methods = adjustment_methods<>>
class inertial_adjustment {
 public:
  /// @{
  /// Types of the map, as its traits name them; `scope` is what a stage is called with.
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  using camera = typename traits::camera;
  using scope = mapping_scope<Map, Policy>;
  /// @}
  static constexpr bool inertial = true;  ///< tells a local_mapper that this stage uses an IMU

  /// One for the scope's map and context: `inertial_adjustment adjust(scope);`.
  explicit inertial_adjustment(const scope& s) : inertial_adjustment(s.ctx) {}
  /// \param ctx  must outlive this
  explicit inertial_adjustment(context<Policy>& ctx)
      : visual_(ctx), measurements_(ctx), problem_(ctx), commit_(window_, measurements_) {
    static_assert(require_inertial_traits<Map>());
  }
  inertial_adjustment(const inertial_adjustment&) = delete;  // the commit refers to the window
  inertial_adjustment& operator=(const inertial_adjustment&) = delete;

  /// The map is left as it is in the cases of local_adjustment, and where meanwhile somebody changed a velocity or a bias of a
  /// free keyframe, or took out a keyframe between two of them (summary.stale). A result that is not finite, or costs more than
  /// the start, is none: solve.accepted is 0.
  /// \throws std::invalid_argument  an option out of range, a keyframe that is not in the store, gravity or T_bc that cannot be;
  ///         inconsistent_map as local_adjustment, and for what is inertial as inertial_window, unless the scope notes faults
  local_adjustment_summary operator()(const scope& s, keyframe current, const local_adjustment_options& options,
                                      const inertial_adjustment_options& inertial = {}) {
    local_adjustment_summary summary;
    (*this)(s, current, options, inertial, summary);
    return summary;
  }
  /// The same. \param summary  overwritten; after an exception it has what was done before
  void operator()(const scope& s, keyframe current, const local_adjustment_options& options,
                  const inertial_adjustment_options& inertial, local_adjustment_summary& summary) {
    summary = {};
    snapshot(s, current, options, inertial, summary);
    if (summary.stale) return;
    if (!summary.inertial)
      visual_(s, current, options, summary);
    else if (compute(s, options, summary))
      commit(s, options, summary);
  }

  /// The window. summary.inertial is false where the map is not initialised: there is no window then.
  void snapshot(const scope& s, keyframe current, const local_adjustment_options& options,
                const inertial_adjustment_options& inertial, local_adjustment_summary& summary) {
    commit_.clear(), visual_.forget();  // its points may be gone by now
    check(options);
    check(inertial);
    s.in_parts([&] { choose(s, current, inertial, summary); },
               [&] {
                 if (!window_.moved(s)) return;
                 summary.stale = true;
                 summary.solve.end = adjustment_end::no_observations;
                 window_.clear();
               },
               [&](std::size_t most) { return summary.inertial && !summary.stale && window_.read(s, most); });
    if (!summary.inertial || summary.stale) return;
    count_window(window_, summary);
    summary.inertial_edges = window_.joined();
  }

  /// Adjusts it. \return whether there is something to write
  bool compute(const scope& s, const local_adjustment_options& options, local_adjustment_summary& summary) {
    if (!has_work(summary)) return false;
    measurements_.gather(s, window_, options.scales);
    problem_.assign(s.ctx, {window_.states(), window_.fixed(), window_.held()}, {window_.positions(), {}},
                    measurements_.rows(window_, options), window_.edges().plain(factor_),
                    window_.edges().robust(factor_, used_), window_.edges().walks(), prior_of_border());
    adjustment_options solve = options.solve;
    solve.max_iterations = used_.iterations;
    solve.damping = used_.damping, solve.initial_lambda = used_.initial_lambda;
    summary.solve = adjust<Methods>(s.ctx, problem_, solve);
    if (summary.solve.accepted == 0) return false;
    problem_.template results<0>(s.ctx, states_, commit_.positions, commit_.chi2, commit_.depth);
    commit_.T_cw.clear();
    for (const auto& x : states_) commit_.T_cw.push_back(x.T_cw);
    return true;
  }

  /// Writes what was found: see adjustment_commit; velocities and biases with the poses.
  void commit(const scope& s, const local_adjustment_options& options, local_adjustment_summary& summary) {
    local_adjustment_options gates = options;
    gates.near_depth = near_depth_;
    commit_(s, gates, summary, moving_frame{window_, states_});
    if (!keeps_prior_ || summary.stale) return;
    seen_.assign(window_.chain(), {});
    sum_pose_information(measurements_.rows(window_, options), commit_.rows_beyond_gates(), commit_.T_cw,
                         commit_.positions, seen_);
    border_.keep(window_, states_, seen_, factor_, used_);
  }
  /// Nothing that was learnt in earlier windows is used in the next one: local_mapper::reset() asks for it.
  void forget() { border_.forget(); }

  /// \name What a local_mapper in inertial mode asks for besides. The caller holds the guard
  /// @{

  /// Whether the IMU of the map is initialised.
  static bool is_initialised(const Map& map) { return inertial_traits<Map>::initialised(map); }
  /// A keyframe is about to be erased: joins the motions before and after it.
  static void erasing(Map& map, const keyframe& redundant, const inertial_adjustment_options& options) {
    bridge_motion(map, redundant, options.max_force);
  }
  /// @}

  /// As of local_adjustment.
  const list_of<point>& points() const { return is_inertial_ ? window_.points() : visual_.points(); }
  /// As of local_adjustment.
  bool wrote() const { return is_inertial_ ? commit_.wrote() : visual_.wrote(); }
  /// As of local_adjustment.
  const list_of<point>& points_that_lost_views() const {
    return is_inertial_ ? commit_.points_that_lost_views() : visual_.points_that_lost_views();
  }

 private:
  using edges = inertial_edges;
  using border_factors = frame_factors<marginal_prior_factor>;

  /// The frames of the window. The caller holds the guard.
  void choose(const scope& s, keyframe current, const inertial_adjustment_options& inertial,
              local_adjustment_summary& summary) {
    window_.clear();
    summary.stale = current == keyframe{} || !traits::alive(s.map, current);
    is_inertial_ = summary.inertial = !summary.stale && inertial_traits<Map>::initialised(s.map);
    if (summary.stale) summary.solve.end = adjustment_end::no_observations;
    keeps_prior_ = inertial.marginal_prior;
    if (!keeps_prior_ || (!summary.inertial && !summary.stale)) forget();
    if (!summary.inertial) return;
    s.stored.at(traits::id(s.map, current));  // throws when it is not there
    const rigid_transform<double> T_bc = inertial_traits<Map>::T_bc(s.map);
    check_pose("T_bc", T_bc);
    factor_.T_bc = to_isometry<double>(normalised(T_bc));
    factor_.gravity = inertial_traits<Map>::gravity(s.map);
    require(detail::is_finite(factor_.gravity), "gravity", factor_.gravity.x, "must be finite");
    used_ = is_strong(s.map, current, inertial) ? inertial.large : inertial.window;
    used_.all_robust = used_.all_robust || !is_refined(s.map);
    near_depth_ = inertial.near_depth;
    if (keeps_prior_) border_.forget_unless(factor_);
    window_.choose(s, current, used_, inertial, keeps_prior_ ? &border_ : nullptr);
  }
  /// The factor of the border, if something is known of it.
  border_factors prior_of_border() {
    const std::size_t count = window_.prior() == nullptr ? 0 : 1;
    border_frame_ = static_cast<std::int32_t>(window_.chain()) - 1;
    return {{}, {&border_frame_, count}, {count == 0 ? nullptr : &window_.prior()->row, count}, {}, 1e6};
  }
  /// Velocity and biases of a free frame.
  struct moving_frame {
    const inertial_window<Map>& window;
    const plain_vector<inertial_state<double>>& adjusted;

    bool moves(std::size_t f) const {
      return (window.held()[f] & inertial_frame::visual_only) != inertial_frame::visual_only;
    }
    bool unchanged(const Map& map, const keyframe& k, std::size_t f) const {
      using inertial = inertial_traits<Map>;
      if (f + 1 < window.chain() && !(traits::previous(map, k) == window.frames()[f + 1])) return false;
      if (!moves(f)) return true;
      const inertial_state<double>& then = window.states()[f];
      const vec3<double> now = inertial::velocity(map, k);
      return now.x == then.velocity.x && now.y == then.velocity.y && now.z == then.velocity.z &&
             same_bias<double>(inertial::bias(map, k), then.bias);
    }
    void write(Map& map, const keyframe& k, std::size_t f) {
      using inertial = inertial_traits<Map>;
      if (!moves(f)) return;
      inertial::set_velocity(map, k, adjusted[f].velocity);
      inertial::set_bias(map, k, adjusted[f].bias);
      if constexpr (detail::inertial_has_v<Map, detail::inertial_bias_member>) {
        const keyframe after = traits::next(map, k);
        if (!(after == keyframe{})) inertial::bias_changed(map, after, adjusted[f].bias);
      }
    }
  };

  static bool is_strong(const Map& map, keyframe current, const inertial_adjustment_options& options) {
    if (options.strong_points < 0) return false;
    int seen = 0;
    const std::size_t keypoints = keypoint_count_of(map, current);
    for (std::size_t i = 0; i < keypoints && seen < options.strong_points; ++i)
      seen += traits::point_at(map, current, i) == point{} ? 0 : 1;
    return seen >= options.strong_points;
  }

  local_adjustment<Map, Policy, Methods> visual_;
  inertial_window<Map> window_;
  inertial_window_options used_;
  inertial_factor factor_;
  double near_depth_ = 0;
  bool is_inertial_ = false, keeps_prior_ = false;
  std::int32_t border_frame_ = 0;
  border_prior border_;
  plain_vector<pose_information> seen_;  ///< by frame of the chain
  window_measurements<Map, Policy> measurements_;
  bundle_problem<Policy, inertial_frame, reprojections<camera>, edges::factors, edges::robust_factors,
                 edges::walk_factors, border_factors>
      problem_;
  plain_vector<inertial_state<double>> states_;  ///< by frame, adjusted
  adjustment_commit<Map, Policy> commit_;
};

/// Of a scope's map and policy.
template <class Map, class Policy>
inertial_adjustment(const mapping_scope<Map, Policy>&) -> inertial_adjustment<Map, Policy>;

TURBOMAP_END_NAMESPACE
