// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Mapper, tracking and loop closing on one map in three threads; made for the thread sanitizer. TURBOMAP_TEST_SECONDS in the
/// environment lets the threads run for longer than two seconds.

#include <turbomap/local_mapper.hpp>
#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/validate.hpp>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <mutex>
#include <random>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "scenes/mapping_scene.hpp"
#include "support/environment.hpp"
#include "support/policies.hpp"

namespace turbomap_test {

/// Parts of every size that the options have, so that others may enter often.
inline turbomap::local_mapper_options in_small_parts(turbomap::local_mapper_options o) {
  o.fusion.commit.entries_per_guard = 8;
  o.adjustment.points_per_guard = 64;
  o.points_read_per_guard = 64;  // so keyframes are culled in parts too
  o.adjustment.solve.max_iterations = 3;
  return o;
}
/// Room for some of the keyframes only.
inline turbomap::keyframe_store_options little_memory() {
  turbomap::keyframe_store_options o;
  o.chunk_bytes = std::size_t{1} << 16, o.byte_budget = std::size_t{3} << 20;
  return o;
}

/// What tracking knows of a keyframe besides its image: nothing.
struct camera_alone {
  /// Keyframe `n` has its associations. The caller holds the guard.
  template <class Run>
  void tracked(Run&, typename Run::keyframe, int) const {}
  /// It has been processed. The guard is free.
  template <class Run>
  void processed(Run&, typename Run::keyframe, int) const {}
  /// Reads what the map has of a keyframe besides. The caller holds the guard.
  template <class Map, class Keyframe>
  double read(const Map&, const Keyframe&) const {
    return 0;
  }
};

/// How a mirror is told of an edit of observations. Either side is enough. Of a point it reads what it needs when a stage next asks
/// for the point, until then the slots of its keyframes are what they were.
enum class told { by_points, by_keyframes };

/// Mapper, tracking and loop closing on one map: the mapper's thread is this one.
template <class Run, class More = camera_alone>
class mapper_threads {
 public:
  using traits = typename Run::traits;
  using keyframe = typename Run::keyframe;
  using point = typename Run::point;
  using map_type = std::remove_reference_t<decltype(std::declval<Run&>().map)>;
  static constexpr bool mirrored = turbomap::is_mirrored_v<map_type>;

  mapper_threads(const mapping_scene<pinhole_camera>& scene, Run& run, More more = {}, told by = told::by_keyframes)
      : scene_(scene), run_(run), more_(std::move(more)), told_(by) {
    run_.notes_creation = false;  // that would read the map without the guard
  }

  /// At least so many keyframes, and until the time is over. Then, when all is quiet, the map is sound, and a mirror is what it is.
  void check(int least) {
    using clock = std::chrono::steady_clock;
    const auto end = clock::now() + std::chrono::seconds(static_cast<long>(environment("TURBOMAP_TEST_SECONDS", 2)));
    const auto latest = end + std::chrono::seconds(60);  // a busy machine lets the others in seldom
    const auto enough = [this] { return reads_ > 5 && moves_ > 3 && matches_ > 0 && accepted_ > 0; };
    {
      const others running(*this);
      for (; keyframes_ < least || clock::now() < end || (!enough() && clock::now() < latest); ++keyframes_) {
        const keyframe k = map_next();
        if (mirrored && keyframes_ % 8 == 7) {
          const std::lock_guard<std::mutex> quiet(edits_);
          compare(k);
        }
      }
    }
    CAPTURE(keyframes_);
    CAPTURE(stale_);
    CHECK(reads_ > 5);
    CHECK(moves_ > 3);
    CHECK(matches_ > 0);  // a move before the commit keeps points from being made of them
    CHECK(accepted_ > 0);
    CHECK(run_.store.statistics().pinned_sets == 0);
    if (!mirrored) return;
    const keyframe k = map_next();
    compare(k);
    move_all(run_.map, 1);  // and nobody says so: the comparison finds it, of what the mirror has of the map by then
    CHECK(differences(k).points > 1);
  }
  std::size_t inertial_edges() const { return inertial_edges_; }

 private:
  /// Tracking and loop closing run as long as this lives, also where a check of the mapper's throws.
  class others {
   public:
    explicit others(mapper_threads& t)
        : all_(t), tracking_([&t] { t.track(); }), loop_closing_([&t] { t.close_loops(); }) {}
    others(const others&) = delete;
    others& operator=(const others&) = delete;
    ~others() {
      all_.done_ = true;
      tracking_.join(), loop_closing_.join();
    }

   private:
    mapper_threads& all_;
    std::thread tracking_, loop_closing_;
  };

  /// Reads the newest keyframes and their points, and searches the newest keyframes in the store.
  void track() {
    turbomap::context<sequential> ctx;
    double sum = 0;
    while (!done_) {
      std::vector<turbomap::keyframe_handle> handles;
      {
        const auto guard = turbomap::map_guard(run_.map);
        handles = newest_;
        traits::for_each_point(run_.map, [&](point p) {
          sum += traits::position(run_.map, p).x + traits::max_distance(run_.map, p) +
                 traits::descriptor_data(run_.map, p)[0];
          traits::for_each_observation(run_.map, p,
                                       [&](keyframe k, std::size_t) { sum += traits::pose(run_.map, k).tx; });
        });
        traits::for_each_keyframe(run_.map, [&](keyframe k) { sum += more_.read(run_.map, k); });
      }
      try {
        const auto pinned =
            run_.store.pin(ctx, turbomap::span<const turbomap::keyframe_handle>(handles.data(), handles.size()));
        for (std::size_t i = 0; i < handles.size(); ++i)
          for (int k = 0; k < pinned[i].keypoint_count; ++k)
            sum += pinned[i].descriptor_of(k)[0] + pinned[i].pixel[k].x;
      } catch (const turbomap::stale_handle&) {  // culled since
      }
      ++reads_;
      std::this_thread::yield();
    }
    CHECK(std::isfinite(sum));
  }
  /// Moves the whole map, merges and erases. A mirror is told of it as docs/local_mapping.md says.
  void close_loops() {
    std::mt19937 random(11);
    std::vector<std::pair<keyframe, std::size_t>> scratch;
    std::vector<point> points;
    std::vector<keyframe> observers;
    while (!done_) {
      {
        const std::lock_guard<std::mutex> editing(edits_);
        const auto guard = turbomap::map_guard(run_.map);
        // After a move all of a mirror is read anew: seldom, so that it is old where points are merged and erased.
        if (random() % (mirrored ? 32 : 4) == 0) {
          move_all(run_.map, random() % 2 == 0 ? 1e-3 : -1e-3), ++moves_;
          if (mirrored) run_.mapper.refresh();
        }
        points.clear();
        traits::for_each_point(run_.map, [&](point p) { points.push_back(p); });
        for (int n = 0; n < 3 && points.size() > 10; ++n) {
          const point p = points[random() % points.size()], q = points[random() % points.size()];
          if (!traits::alive(run_.map, p) || !traits::alive(run_.map, q)) continue;
          observers.clear();
          for (const point& one : {p, q})
            traits::for_each_observation(run_.map, one, [&](keyframe k, std::size_t) { observers.push_back(k); });
          if (random() % 4 == 0)
            turbomap::erase_point(run_.map, p);
          else
            turbomap::merge_points(run_.map, p, q, turbomap::merge_rule::refuse, scratch);
          if (!mirrored) continue;
          if (told_ == told::by_points)
            run_.mapper.changed(p), run_.mapper.changed(q);
          else
            for (const keyframe& k : observers) run_.mapper.changed(k);
        }
      }
      std::this_thread::yield();
    }
  }

  /// The next keyframe, from tracking to the end of mapping.
  keyframe map_next() {
    keyframe k;
    {
      const auto guard = turbomap::map_guard(run_.map);
      k = run_.add();
    }
    const std::size_t n = run_.keyframes().size() - 1;
    const auto& view = run_.view(n);
    run_.mapper.insert(k, scene_.template data<typename Run::descriptor>(view));  // takes the guard itself
    {
      const auto guard = turbomap::map_guard(run_.map);
      run_.associate(k, view);
      more_.tracked(run_, k, static_cast<int>(n));
      newest_.clear();
      for (std::size_t i = run_.keyframes().size(); i-- > 0 && newest_.size() < 3;) {
        turbomap::keyframe_handle handle;
        const keyframe one = run_.keyframes()[i];
        if (traits::alive(run_.map, one) && run_.mapper.stored().find(traits::id(run_.map, one), handle))
          newest_.push_back(handle);
      }
    }
    const auto& report = run_.mapper.process(k);
    matches_ += report.matches, accepted_ += report.adjustment.solve.accepted > 0 ? 1 : 0;
    stale_ += report.adjustment.stale ? 1 : 0;
    inertial_edges_ += report.adjustment.inertial_edges;
    CHECK(report.refused.empty());
    more_.processed(run_, k, static_cast<int>(n));
    const auto guard = turbomap::map_guard(run_.map);
    REQUIRE(turbomap::validate(run_.map).empty());
    return k;
  }
  struct found {
    std::size_t points = 0, keyframes = 0;
  };
  /// Compares the whole mirror with the map: process() without its stages compares all points that the mirror holds, and the next
  /// keyframe. Nobody edits the map meanwhile. \return how many are not what the map has; one of `points` may be a keyframe
  found differences(keyframe k) {
    const turbomap::local_mapper_options before = run_.mapper.options();
    auto& o = run_.mapper.options();
    for (std::size_t s = 0; s < turbomap::mapping_stages; ++s)
      o.enabled[static_cast<turbomap::mapping_stage>(s)] = false;
    o.checked_share = 1;
    found f;
    f.points = run_.mapper.process(k).healed;
    o.checked_share = 1e-9;  // a point: they have been compared
    for (std::size_t n = 0; n < run_.keyframes().size(); ++n) f.keyframes += run_.mapper.process(k).healed;
    o = before;
    return f;
  }
  /// All is quiet: the mirror is what the map is, but for slots that it has not been asked for since it was told of a point.
  void compare(keyframe k) {
    const found f = differences(k);
    CHECK(f.points <= (told_ == told::by_points ? 1 : 0));
    if (told_ == told::by_keyframes) CHECK(f.keyframes == 0);
  }

  const mapping_scene<pinhole_camera>& scene_;
  Run& run_;
  More more_;
  told told_;
  std::mutex edits_;  ///< held by whom edits the map, but for the mapper and tracking: before the guard
  std::vector<turbomap::keyframe_handle> newest_;  ///< under the guard
  std::atomic<bool> done_{false};
  std::atomic<long> reads_{0}, moves_{0};
  std::size_t matches_ = 0, accepted_ = 0, stale_ = 0, inertial_edges_ = 0;
  int keyframes_ = 0;
};

}  // namespace turbomap_test
