// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stage that adjusts all poses and points of a map together: full bundle adjustment. Local windows hold what they do not
/// contain, so they press the drift of a round into the few keyframes where a place is seen again; this stage spreads it over
/// the whole way. SLAM systems run it after a loop was closed, and at the end of a session [ORB-SLAM3].

#include <cstddef>

#include "../config.hpp"
#include "../error.hpp"
#include "../map/map_traits.hpp"
#include "../span.hpp"
#include "global_adjustment_options.hpp"
#include "local_adjustment.hpp"
#include "stage.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// adjust() on a user's map, or on keyframes that the user names: see local_adjustment. Of one context, its own or that of
/// other stages; not kept busy, it may be made for one call. Its result is written like that of local_adjustment, so mapping
/// must not move keyframes meanwhile: let it wait, or call local_mapper::adjust_globally() on its thread. Keyframes
/// and points that tracking adds meanwhile are not moved.
template <class Map, class Policy, class Methods = adjustment_methods<>>
class global_adjustment : private local_adjustment<Map, Policy, Methods> {
  using base = local_adjustment<Map, Policy, Methods>;

 public:
  using base::commit;
  using base::compute;
  using base::points;
  using base::points_that_lost_views;
  using base::wrote;
  /// @{
  /// As of local_adjustment.
  using typename base::camera;
  using typename base::keyframe;
  using typename base::point;
  using typename base::scope;
  using typename base::traits;
  /// @}

  /// One for the scope's map and context: `global_adjustment adjust(scope);`.
  explicit global_adjustment(const scope& s) : global_adjustment(s.ctx) {}
  /// \param ctx  must outlive this
  explicit global_adjustment(context<Policy>& ctx) : base(ctx) {}

  /// Adjusts the map that a keyframe is part of: all keyframes that are connected with it through shared points, directly or
  /// by others, and all their points. Fixed is the origin of the map (see adjustment_window), or the oldest keyframe of them.
  /// Of a monocular map the scale is not determined; it stays about what it is.
  /// The map is left as it is, partly or all, for the same reasons as by local_adjustment.
  /// \throws as local_adjustment
  /// \return what was done; no such keyframe: stale
  local_adjustment_summary operator()(const scope& s, keyframe anyone, const global_adjustment_options& options) {
    local_adjustment_summary summary;
    (*this)(s, anyone, options, summary);
    return summary;
  }
  /// The same. \param summary  overwritten; after an exception it has what was done before
  void operator()(const scope& s, keyframe anyone, const global_adjustment_options& options,
                  local_adjustment_summary& summary) {
    summary = {};
    snapshot(s, anyone, options, summary);
    finish(s, options, summary);
  }
  /// Adjusts these keyframes and their points. Fixed are other keyframes that see these points, and the origin.
  local_adjustment_summary operator()(const scope& s, span<const keyframe> keyframes,
                                      const global_adjustment_options& options) {
    local_adjustment_summary summary;
    snapshot(s, keyframes, options, summary);
    finish(s, options, summary);
    return summary;
  }

  /// The window of the first form, read in parts (points_read_per_guard of the scope). Waits for no other stage. What others add
  /// to what has been read does not take part.
  void snapshot(const scope& s, keyframe anyone, const global_adjustment_options& options,
                local_adjustment_summary& summary) {
    this->nothing_is_written();
    check(options);
    s.in_parts(
        [&] {
          this->begin(summary, anyone == keyframe{} || !traits::alive(s.map, anyone));
          if (summary.stale) return;
          s.stored.at(traits::id(s.map, anyone));  // throws when it is not there
          this->window_.choose_connected(s, anyone);
        },
        [&] { this->window_.resume(s); }, [&](std::size_t most) { return this->window_.read_connected(s, most); });
    count_window(this->window_, summary);
  }
  /// That of the second. Keyframes that are dead, or not in the store, are passed over; none: stale.
  void snapshot(const scope& s, span<const keyframe> keyframes, const global_adjustment_options& options,
                local_adjustment_summary& summary) {
    this->nothing_is_written();
    check(options);
    s.in_parts(
        [&] {
          this->begin(summary, false);
          this->window_.choose_these(s, keyframes);
          if (this->window_.frames().size() == 0) this->begin(summary, true);
        },
        [&] { this->window_.resume(s); }, [&](std::size_t most) { return this->window_.read(s, most); });
    count_window(this->window_, summary);
  }

 private:
  void finish(const scope& s, const global_adjustment_options& options, local_adjustment_summary& summary) {
    if (!summary.stale && this->compute(s, options, summary)) this->commit(s, options, summary);
  }
};

/// Of a scope's map and policy.
template <class Map, class Policy>
global_adjustment(const mapping_scope<Map, Policy>&) -> global_adjustment<Map, Policy>;

TURBOMAP_END_NAMESPACE
