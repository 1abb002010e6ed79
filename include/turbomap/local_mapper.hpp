// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The loop of local mapping over the stages of this library, on the user's own map [TurboMap Fig. 3]. It does nothing that a
/// user who calls the pieces himself could not do.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "config.hpp"
#include "context.hpp"
#include "mapping/appearance_update.hpp"
#include "mapping/local_mapper_options.hpp"
#include "mapping/neighbour_matching.hpp"
#include "mapping/time_budget.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Local mapping: hand it keyframes, one after the other. One thread; tracking and loop closing may use the map meanwhile
/// under the same guard (map_traits::guard), which is held to copy what a search reads and to apply what it found, never
/// during a search: see docs/local_mapping.md for how long. Map, store and context must outlive the mapper.
template <class Map, class Policy>
class local_mapper {
 public:
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  using descriptor = typename traits::descriptor;
  using camera = typename traits::camera;
  using store_type = keyframe_store<descriptor, camera, memory_of_t<Policy>>;
  using hooks_type = local_mapper_hooks<Map>;

  local_mapper(context<Policy>& ctx, Map& map, store_type& store, const local_mapper_options& options = {},
               hooks_type hooks = {})
      : ctx_(ctx),
        map_(map),
        store_(store),
        options_(options),
        hooks_(std::move(hooks)),
        matching_(ctx),
        fusion_(ctx),
        appearance_(ctx) {
    static_assert(require_map_traits<Map>());
    require(options.deadline_ms >= 0, "options.deadline_ms", options.deadline_ms, "must not be negative");
    require(options.stereo_baseline >= 0, "options.stereo_baseline", options.stereo_baseline, "must not be negative");
    detail::check(options.keyframe_culling);
  }

  /// Takes the immutable part of a keyframe into the store: from keyframe_data, or from the user's own type through
  /// keyframe_traits. Takes the guard of the map for a moment, to read the id: do not hold it.
  /// Throws what keyframe_store::insert throws, and std::invalid_argument when the keyframe is none (keyframe{}), is not in
  /// the map, or is in the store already.
  template <class Data>
  void insert(keyframe k, const Data& data) {
    const std::uint64_t id = id_of(k);
    require(!stored_.contains(id), "keyframe id", id, "is in the store already");
    const keyframe_handle handle = store_.insert(data);
    try {
      stored_.add(id, handle);
    } catch (...) {
      store_.erase(handle);
      throw;
    }
  }
  /// For a keyframe that somebody else takes out of the map.
  void remove(std::uint64_t id) {
    store_.erase(stored_.at(id));
    stored_.erase(id);
  }
  /// Puts points that tracking made on probation.
  void watch(span<const point> points) {
    for (const point p : points) recent_.push_back({p, iteration_});
  }

  /// One iteration on a keyframe that is inserted, in the map, and holds its associations. An exception ends the iteration
  /// between two commits: the map is sound, the stages before are done.
  /// \throws std::invalid_argument  the keyframe is not in the map or not inserted: nothing is done
  const mapping_report& process(keyframe current) {
    report_ = {};
    stopped_ = false;
    budget_.start(options_.deadline_ms);
    require(!(current == keyframe{}), "keyframe", "none", "is not a keyframe of the map");
    {
      const timed_guard<Map> guard(map_, report_.held[mapping_stage::process]);
      require(traits::alive(map_, current), "keyframe", "dead", "is not in the map, or no longer");
      stored_.at(traits::id(map_, current));  // throws when it is not there
    }
    stage(mapping_stage::process, current, &local_mapper::update_associated);
    stage(mapping_stage::point_culling, current, &local_mapper::cull_points);
    stage(mapping_stage::search, current, &local_mapper::search);
    stage(mapping_stage::creation, current, &local_mapper::create);
    stage(mapping_stage::fusion, current, &local_mapper::fuse);
    stage(mapping_stage::adjustment, current, &local_mapper::adjust);
    stage(mapping_stage::keyframe_culling, current, &local_mapper::cull);
    matching_.release();
    report_.total_ms = budget_.elapsed_ms();
    ++iteration_;
    return report_;
  }

  /// Normals and distance ranges of points whose position was changed, e.g. in the adjust hook.
  void update_geometry(span<const point> points) {
    appearance_options options = appearance();
    options.descriptors = false;
    appearance_(ctx_, map_, store_, stored_, points, options, report_.held[mapping_stage::adjustment]);
  }
  /// Descriptors, normals and distance ranges of points whose observations were changed, e.g. in the adjust hook.
  void update_appearance(span<const point> points) { update(points, report_.held[mapping_stage::adjustment]); }

  const mapping_report& report() const { return report_; }
  local_mapper_options& options() { return options_; }
  /// Keyframes that were processed.
  std::int64_t iterations() const { return iteration_; }
  /// The last correspondence search.
  const neighbour_matching<Map, Policy>& matching() const { return matching_; }
  const handle_table& stored() const { return stored_; }

 private:
  /// \throws std::invalid_argument  the keyframe is none, or not in the map
  std::uint64_t id_of(keyframe k) {
    require(!(k == keyframe{}), "keyframe", "none", "is not a keyframe of the map");
    [[maybe_unused]] const auto guard = map_guard(map_);
    require(traits::alive(map_, k), "keyframe", "dead", "is not in the map, or no longer");
    return traits::id(map_, k);
  }

  enum piece : std::size_t { search_a_neighbour, create_all, fuse_a_target, fuse_back, cull_a_keyframe, pieces };

  using stage_function = void (local_mapper::*)(keyframe, guard_times&);

  void stage(mapping_stage s, keyframe current, stage_function run) {
    stage_outcome& outcome = report_.outcome[s];
    if (!options_.enabled[s] || (s == mapping_stage::adjustment && !hooks_.adjust)) return;
    const bool waits = s >= mapping_stage::fusion && hooks_.keyframes_wait && hooks_.keyframes_wait();
    stopped_ = stopped_ || (hooks_.stop && hooks_.stop());
    if (waits || stopped_) {
      outcome = stage_outcome::skipped;
      return;
    }
    const double begin = budget_.elapsed_ms();
    cut_ = false;
    (this->*run)(current, report_.held[s]);
    outcome = cut_ ? stage_outcome::cut : stage_outcome::done;
    report_.cut = report_.cut || cut_;
    report_.ms[s] = budget_.elapsed_ms() - begin;
    if (hooks_.stage_done) hooks_.stage_done(s, report_);
  }

  /// Keyframes that wait may be in the map already: until they are inserted they are not ours to search, nor to count.
  auto stored_only() const {
    return [this](keyframe k) { return stored_.contains(traits::id(map_, k)); };
  }

  /// Runs a piece of work and notes what it took.
  template <class Work>
  void timed(piece p, double amount, Work work) {
    const double begin = budget_.elapsed_ms();
    work();
    budget_.record(p, budget_.elapsed_ms() - begin, amount);
  }
  void cut(piece p) {
    cut_ = true;
    budget_.left_out(p);
  }
  appearance_options appearance() const {
    appearance_options options;
    options.scales = options_.fusion.search.scales;
    return options;
  }
  void update(span<const point> points, guard_times& held) {
    report_.points_updated += appearance_(ctx_, map_, store_, stored_, points, appearance(), held);
  }

  void update_associated(keyframe current, guard_times& held) {
    {
      const timed_guard<Map> guard(map_, held);
      points_.clear();
      for (std::size_t i = 0; i < traits::keypoint_count(map_, current); ++i)
        points_.push_back(traits::point_at(map_, current, i));
    }
    update(points_, held);
  }

  void cull_points(keyframe, guard_times& held) {
    const timed_guard<Map> guard(map_, held);
    report_.points_culled = cull_recent_points(map_, recent_, iteration_, options_.point_culling).dropped;
  }

  void search(keyframe current, guard_times& held) {
    {
      const timed_guard<Map> guard(map_, held);
      const auto& near = neighbourhood_.neighbours(map_, current, options_.neighbourhood, stored_only());
      const std::size_t limit = budget_.fitting(search_a_neighbour, near.size());
      report_.neighbours = matching_.gather(map_, stored_, current, span<const keyframe>(near),
                                            options_.stereo_baseline, options_.baseline_rule, limit);
      if (limit < near.size() && report_.neighbours == limit) cut(search_a_neighbour);
    }
    timed(search_a_neighbour, static_cast<double>(report_.neighbours),
          [&] { matching_.search(ctx_, store_, options_.search); });
  }

  void create(keyframe, guard_times& held) {
    if (report_.outcome[mapping_stage::search] == stage_outcome::off ||
        report_.outcome[mapping_stage::search] == stage_outcome::skipped)
      return;
    if (!budget_.fits(create_all)) return cut(create_all);
    timed(create_all, 1, [&] {
      points_.clear();
      report_.matches = matching_.create(ctx_, map_, options_.creation, appearance(), points_, held);
      report_.points_created = points_.size();
      report_.points_updated += points_.size();
      watch(points_);
    });
  }

  void fuse(keyframe current, guard_times& held) {
    std::vector<keyframe>& targets = keyframes_;
    {
      const timed_guard<Map> guard(map_, held);
      targets = neighbourhood_.targets(map_, current, options_.neighbourhood, stored_only());
    }
    const std::size_t fitting = budget_.fitting(fuse_a_target, targets.size());
    if (fitting < targets.size()) cut(fuse_a_target);
    targets.resize(fitting);
    report_.fusion_targets = fitting;
    fusion_.begin();
    timed(fuse_a_target, static_cast<double>(fitting), [&] {
      report_.fused += fusion_.forward(ctx_, map_, store_, stored_, current, targets, options_.fusion, held);
    });
    if (!budget_.fits(fuse_back)) {
      cut(fuse_back);
    } else {
      timed(fuse_back, 1, [&] {
        report_.fused += fusion_.backward(ctx_, map_, store_, stored_, current, targets, options_.fusion, held);
      });
    }
    update(fusion_.touched(), held);
  }

  void adjust(keyframe current, guard_times&) {
    const double left = options_.deadline_ms > 0 ? options_.deadline_ms - budget_.elapsed_ms()
                                                 : std::numeric_limits<double>::infinity();
    if (left > 0)
      hooks_.adjust(map_, current, left);
    else
      cut_ = true;
  }

  void cull(keyframe current, guard_times& held) {
    {
      const timed_guard<Map> guard(map_, held);
      keyframes_ = neighbourhood_.covisible_keyframes(map_, current, options_.neighbourhood, stored_only());
    }
    points_.clear();  // that lose a view and live on
    for (const keyframe k : keyframes_) {
      if (!budget_.fits(cull_a_keyframe)) {
        cut(cull_a_keyframe);
        break;
      }
      timed(cull_a_keyframe, 1, [&] {
        const timed_guard<Map> guard(map_, held);
        if (!traits::alive(map_, k)) return;
        records_.clear();
        report_.keyframes_culled.reserve(report_.keyframes_culled.size() + 1);
        cull_keyframes(map_, current, span<const keyframe>(&k, 1), options_.keyframe_culling, records_, &points_,
                       hooks_.erasing);
        for (const auto& record : records_) {
          if (record.verdict != culling_verdict::erased) continue;
          report_.keyframes_culled.push_back(record.id);
          if (stored_.contains(record.id)) remove(record.id);
        }
      });
    }
    if (!points_.empty()) update(points_, held);
  }

  context<Policy>& ctx_;
  Map& map_;
  store_type& store_;
  local_mapper_options options_;
  hooks_type hooks_;

  handle_table stored_;
  neighbourhood<Map> neighbourhood_;
  neighbour_matching<Map, Policy> matching_;
  duplicate_fusion<Map, Policy> fusion_;
  appearance_update<Map, Policy> appearance_;
  std::vector<recent_point<point>> recent_;
  std::int64_t iteration_ = 0;
  time_budget<pieces> budget_;
  mapping_report report_;
  bool cut_ = false;
  bool stopped_ = false;

  std::vector<keyframe> keyframes_;
  std::vector<point> points_;
  std::vector<culling_record<keyframe>> records_;
};

TURBOMAP_END_NAMESPACE
