// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The loop of local mapping over the stages of this library, on the user's own map [TurboMap Fig. 3]. A SLAM system hands it
/// keyframes; it finds new map points, fuses duplicate ones, adjusts poses and points, and takes out what is redundant. It
/// does nothing that a user who calls the stages themselves could not do. Longer than other headers, so that the whole loop
/// can be read in one place: begin at process(), which names the stages in their order.

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "config.hpp"
#include "context.hpp"
#include "mapping/due_appearances.hpp"
#include "mapping/keyframe_culling.hpp"
#include "mapping/local_mapper_check.hpp"
#include "mapping/local_mapper_hooks.hpp"
#include "mapping/local_mapper_options.hpp"
#include "mapping/look_again.hpp"
#include "mapping/map_point_creation.hpp"
#include "mapping/mapper_adjustment.hpp"
#include "mapping/mapping_progress.hpp"
#include "mapping/named_points.hpp"
#include "mapping/neighbour_search.hpp"
#include "mapping/neighbourhood_fusion.hpp"
#include "mapping/options_of_stages.hpp"
#include "mapping/point_culling.hpp"
#include "mapping/refused_mapper.hpp"
#include "mapping/stage.hpp"
#include "mapping/stored_keyframes.hpp"
#include "mapping/working_map.hpp"
#include "named_range.hpp"
#include "plain_vector.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Local mapping: hand it keyframes, one after the other. One thread; tracking and loop closing may use the map meanwhile
/// under the same guard (map_traits::guard), which is held to copy what a search reads and to apply what it found, never
/// during a search: see docs/local_mapping.md for how long. Map, store and context must outlive the mapper.
///
/// \tparam Adjustment  the stage that adjusts: local_adjustment with the precisions and solvers that options may name,
///                     inertial_adjustment for maps with an IMU (docs/inertial.md), or no_adjustment
template <class Map, class Policy, class Adjustment = default_adjustment<Map, Policy>>
class local_mapper {
 public:
  using traits = map_traits<Map>;                  ///< how the map is read and changed.
  using keyframe = typename traits::keyframe;      ///< the name of a keyframe.
  using point = typename traits::point;            ///< the name of a map point.
  using descriptor = typename traits::descriptor;  ///< of keypoints and points.
  using camera = typename traits::camera;          ///< of the rigs in the store.
  using store_type = store_of<Map, Policy>;        ///< the store that searches read.
  using hooks_type = local_mapper_hooks<Map>;      ///< what the rest of the system is asked and told.
  /// What stages read and commits change: the map, or, if it is mirrored, a map_mirror, whose commits write to the map.
  using stage_map = typename working_map<Map>::type;
  using scope = mapping_scope<stage_map, Policy>;  ///< what a stage works on.

  /// Refers to context, map and store. Throws std::invalid_argument naming an option that makes no sense, and where store and stages
  /// have different pyramids.
  local_mapper(context<Policy>& ctx, Map& map, store_type& store, const local_mapper_options& options = {},
               hooks_type hooks = {})
      : ctx_(ctx),
        map_(map),
        working_(map),
        stored_(map, store),
        options_(options),
        hooks_(std::move(hooks)),
        search_(ctx),
        creation_(ctx),
        fusion_(ctx),
        adjustment_(ctx),
        due_(ctx) {
    static_assert(require_map_traits<Map>());
    check_options();
  }

  /// Another store than the map's: says so.
  template <class Store, class... Rest, class = std::enable_if_t<!std::is_same_v<Store, store_type>>>
  local_mapper(context<Policy>& ctx, Map& map, Store&, Rest&&...)
      : local_mapper(ctx, map, *static_cast<store_type*>(nullptr)) {
    static_assert(sizeof(Store) == 0,
                  "turbomap: the store must be a turbomap::store_of<Map, Policy>: the descriptor and camera of "
                  "map_traits<Map>, in "
                  "the memory of the policy");
  }

  /// Takes the immutable part of a keyframe into the store: from keyframe_data, or from the user's own type through
  /// keyframe_traits. Takes the guard of the map for a moment, to read the id: do not hold it.
  /// Throws what keyframe_store::insert throws, and std::invalid_argument when the keyframe is none (keyframe{}), is not in
  /// the map, is in the store already, has a pose that is not one (is_pose), or another number of keypoints than the data.
  template <class Data>
  void insert(keyframe k, const Data& data) {
    stored_.insert(k, data);
  }
  /// For a keyframe that another part of the system takes out of the map, or whose store was cleared.
  /// Throws std::invalid_argument when it was not inserted, or has been removed.
  void remove(std::uint64_t id) {
    stored_.remove(id);
    working_.removed(id);
  }
  /// For a system that starts anew: all that was inserted leaves the store, and nothing that was learnt of the map is used again;
  /// it may have been emptied before, ids and all. Options and hooks stay, and the memory that stages work in: lists there
  /// keep names of keyframes and points until the next call. Not within a hook.
  void reset() {
    require_idle("reset");
    stored_.clear();
    working_.reset();
    probation_.clear(), due_.clear(), fusion_.clear(), culling_.clear(), points_.clear();
    watched_.clear(), moved_.clear(), changed_.clear();
    if constexpr (inertial) adjustment_.forget();
    progress_ = {}, report_ = {}, iteration_ = 0;
  }
  /// Puts points that tracking made on probation. A list of slots will do: names of no point (point{}) are passed over.
  void watch(span<const point> points) {
    if constexpr (is_mirrored_v<Map>)
      watched_.add(points);
    else
      probation_.watch(points, iteration_);
  }

  /// For maps that are mirrored (`mirrored` in map_traits): other parts of the system say what they changed. Tracking
  /// need not report the keyframe that is about to be processed. What is not reported is found by a sample check in time, and
  /// costs quality until then, never soundness. From any thread, with or without the guard. See docs/local_mapping.md.
  void changed(const point& p) { working_.changed(p); }
  /// The same of a keyframe: its pose or its slots.
  void changed(const keyframe& k) { working_.changed(k); }
  /// Everything may have changed: after a loop was closed, a global adjustment, a map that was loaded. From any thread, before the
  /// guard is released under which the map was moved: a stage that takes it next must know. Everything is read anew after each
  /// call: of a move in parts say it once, at the last part.
  void refresh() { working_.refresh(); }

  /// One iteration on a keyframe that is inserted, in the map, and holds its associations. Keyframes, points and observations
  /// that cannot be used (map_fault) are passed over, and listed in report().refused; options.strict makes them an exception.
  /// An exception ends the iteration between two commits: the map is sound, the stages before are done, nothing is pinned.
  /// \throws std::invalid_argument  the keyframe is not in the map or not inserted, an option that was changed makes no sense, or this
  ///         is a hook: nothing is done
  const mapping_report& process(keyframe current) {
    require_idle("process");
    check_options();
    const named_range range("keyframe");
    report_ = {};
    has_pose_ = false;
    progress_.start(options_.deadline_ms);
    {
      const auto guard = scope_of(mapping_stage::process).guard();
      const std::uint64_t id = stored_.require_stored(current);
      has_pose_ = is_pose(pose_of(map_, current));
      if (!has_pose_) faults()({map_fault::bad_pose, id, 0, 0});
    }
    const in_progress processing(*this);
    const stage_keyframe k = read_mirror(current);
    if (options_.enabled[mapping_stage::process]) report_.ms[mapping_stage::process] = progress_.elapsed_ms();
    stage(mapping_stage::process, k, &local_mapper::update_associated);
    stage(mapping_stage::point_culling, k, &local_mapper::cull_points);
    if (!options_.enabled[mapping_stage::point_culling]) probation_.release(iteration_, options_.point_culling);
    stage(mapping_stage::search, k, &local_mapper::search);
    stage(mapping_stage::creation, k, &local_mapper::create);
    stage(mapping_stage::fusion, k, &local_mapper::fuse);
    stage(mapping_stage::adjustment, k, &local_mapper::adjust);
    repeat_fusion(k);
    stage(mapping_stage::keyframe_culling, k, &local_mapper::cull);
    search_.release();
    update_due(due_stage());
    report_.total_ms = progress_.elapsed_ms();
    ++iteration_;
    return report_;
  }

  /// Adjusts the whole map that a keyframe is part of, on request: after a loop was closed, at the end of a session. See
  /// global_adjustment for what moves and what is thrown. The pyramid is that of the mapper, all other options are its own. Then the
  /// appearances of what moved are computed. For the thread that calls process(), between two calls; held, ms (by the appearances),
  /// refused and points_updated of the last report() grow. An inertial mapper adjusts visually here too: velocities, biases and
  /// gravity are neither used nor changed (docs/inertial.md).
  /// \return what was done; stale: the keyframe is not in the map, or somebody moved a keyframe meanwhile
  local_adjustment_summary adjust_globally(const keyframe& anyone, global_adjustment_options options) {
    options.scales = options_.adjustment.scales;
    static_assert(adjusts, "turbomap: this local_mapper compiles no solver (no_adjustment)");
    require_idle("adjust_globally");
    check_options();
    const in_progress adjusting(*this);
    const scope s = scope_of(mapping_stage::adjustment);
    stage_keyframe k;
    {
      const auto guard = s.guard();
      working_.begin();  // a mirror hears what was reported
      k = working_.number(anyone);
    }
    typename detail::global_on<Adjustment, stage_map>::type adjustment(ctx_);
    local_adjustment_summary summary;
    noted([&] { adjustment(s, k, options, summary); },
          [&] {
            if (adjustment.wrote()) note_adjusted(adjustment);
          });
    update_due(mapping_stage::adjustment);
    return summary;
  }

  /// Looks for duplicates between a keyframe's points and those of its neighbourhood, both ways, as the stage `fusion` does:
  /// after poses were corrected, so that points on the two sides of a loop are found to be one [ORB-SLAM3]. The
  /// neighbourhood is that of covisible keyframes: some points must have been merged already for the two sides to be it
  /// (docs/adjustment.md). For the thread that calls process(), between two calls. No deadline holds. Appearances follow;
  /// fused, held, ms (by the appearances), refused and points_updated of the last report() grow. After an exception the map
  /// is sound, and report().fused has what was done before it.
  /// \throws std::invalid_argument  as process()
  fusion_summary fuse_around(const keyframe& k) {
    require_idle("fuse_around");
    check_options();
    const in_progress fusing(*this);
    const scope s = scope_of(mapping_stage::fusion);
    stage_keyframe current;
    {
      const auto guard = s.guard();
      stored_.require_stored(k);
      working_.begin();
      current = working_.number(k);
      if (!s.can_use(current)) return {};
    }
    progress_.start(0);  // the deadline of the last process() has passed
    fusion_.choose_targets(s, current, options_.neighbours.neighbourhood, progress_);
    fuse_with_targets(current, s);
    update_due(mapping_stage::fusion);
    return fusion_.done();
  }

  /// Normals and distance ranges of points whose position was changed, e.g. in the adjust hook: during process(),
  /// adjust_globally() and fuse_around() they are computed at its end, with all that is due by then, otherwise at once.
  void update_geometry(span<const point> points) {
    if constexpr (is_mirrored_v<Map>)
      moved_.add(points);
    else
      due_.moved(points);
    if (!processing_) update_due(mapping_stage::adjustment);
  }
  /// Descriptors, normals and distance ranges of points whose observations were changed: likewise.
  void update_appearance(span<const point> points) {
    if constexpr (is_mirrored_v<Map>)
      changed_.add(points);
    else
      due_.changed(points);
    if (!processing_) update_due(mapping_stage::adjustment);
  }

  /// Of the last process().
  const mapping_report& report() const { return report_; }
  /// May be changed between two keyframes; they are checked as in the constructor when they are used next.
  local_mapper_options& options() { return options_; }
  /// Keyframes that were processed.
  std::int64_t iterations() const { return iteration_; }
  /// The last correspondence search.
  const neighbour_search<stage_map, Policy>& last_search() const { return search_; }
  /// Which keyframes are in the store.
  const handle_table& stored() const { return stored_.handles(); }

 private:
  /// While process(), adjust_globally() or fuse_around() runs. At its end, also with an exception, no keyframe stays pinned.
  struct in_progress {
    explicit in_progress(local_mapper& mapper) : mapper_(mapper) { mapper.processing_ = true; }
    in_progress(const in_progress&) = delete;
    in_progress& operator=(const in_progress&) = delete;
    ~in_progress() {
      mapper_.processing_ = false;
      mapper_.search_.release();
    }

   private:
    local_mapper& mapper_;
  };

  using stage_traits = map_traits<stage_map>;
  using stage_keyframe = typename stage_traits::keyframe;
  using stage_point = typename stage_traits::point;
  using stage_adjustment = typename detail::adjustment_on<Adjustment, stage_map>::type;
  using stage_function = void (local_mapper::*)(stage_keyframe, const scope&);
  static constexpr bool adjusts = !std::is_same_v<Adjustment, no_adjustment>;
  static constexpr bool inertial = detail::is_inertial<Adjustment>::value;

  void check_options() const {
    check(options_);
    check_same_pyramid("store.options().packing.pyramid", stored_.store().options().packing.pyramid,
                       options_.search.scales);
    detail::check_stages<Map>(options_);
    if constexpr (adjusts)
      if (options_.enabled[mapping_stage::adjustment] && !hooks_.adjust)
        detail::check_adjustment<Adjustment, stage_map>(options_);
  }
  void require_idle(const char* call) const {
    require(!processing_, call, "in a hook", "must wait until the call that runs has ended");
  }
  fault_sink faults() { return options_.strict ? fault_sink() : fault_sink(report_.refused); }
  scope scope_of(mapping_stage s) {
    return {ctx_,
            working_.get(),
            stored_.store(),
            stored_.handles(),
            report_.held[s],
            faults(),
            options_.points_read_per_guard};
  }
  /// Whether a stage reads the pose of the keyframe that is processed.
  static bool needs_pose(mapping_stage s) { return s >= mapping_stage::search && s <= mapping_stage::adjustment; }

  /// What stages call the keyframe. A mirror hears what was reported, and reads the keyframe anew when a stage asks for it.
  stage_keyframe read_mirror(const keyframe& current) {
    if constexpr (!is_mirrored_v<Map>) {
      return current;
    } else {
      const scope s = scope_of(mapping_stage::process);
      stage_keyframe k;
      std::size_t slot = 0;
      working_.keep_room();
      s.in_parts(
          [&] {
            working_.begin();
            k = working_.number(current);
          },
          [] {}, [&](std::size_t most) { return working_.take_associations(k, slot, most); });
      const auto guard = s.guard();
      report_.healed = working_.check_sample(options_.checked_share);  // what tracking need not report is known by now
      probation_.watch(watched_.take(working_), iteration_);
      return k;
    }
  }

  // ---- running a stage ----

  void stage(mapping_stage s, stage_keyframe current, stage_function run) {
    stage_outcome& outcome = report_.outcome[s];
    if (!options_.enabled[s] || (s == mapping_stage::adjustment && !adjusts && !hooks_.adjust)) return;
    if (progress_.must_skip(s, hooks_)) {
      outcome = stage_outcome::skipped;
      return;
    }
    if (!has_pose_ && needs_pose(s)) {
      outcome = stage_outcome::refused;
      return;
    }
    run_stage(s, current, run);
  }
  void run_stage(mapping_stage s, stage_keyframe current, stage_function run) {
    progress_.run(s, report_, hooks_, [&] { (this->*run)(current, scope_of(s)); });
  }

  /// work(), then note() what it did: also where it throws, since what it wrote before stays in the map.
  template <class Work, class Note>
  static void noted(Work work, Note note) {
    try {
      work();
    } catch (...) {
      note();
      throw;
    }
    note();
  }

  // ---- the stages, in their order ----

  void update_associated(stage_keyframe current, const scope& s) {
    points_.clear();
    {
      const auto guard = s.guard();
      look_again(s.map, current);
      if (!stage_traits::alive(s.map, current)) return progress_.stop();  // erased meanwhile
      for (std::size_t i = 0; i < keypoint_count_of(s.map, current); ++i)
        points_.push_back(stage_traits::point_at(s.map, current, i));
    }
    due_.changed(points_);
    report_.points_updated += due_.update(s, appearance());
  }

  void cull_points(stage_keyframe, const scope& s) {
    report_.points_culled = probation_(s, iteration_, options_.point_culling).dropped;
  }

  void search(stage_keyframe current, const scope& s) {
    const bool shortened = search_.snapshot(s, current, options_.neighbours, [this](std::size_t n) {
      return progress_.fitting(mapping_piece::search_neighbour, n);
    });
    if (shortened) progress_.cut(mapping_piece::search_neighbour);
    if (search_.selection().size() == 0) return progress_.stop();  // erased meanwhile: nothing is left to do for it
    report_.neighbours = search_.neighbour_count();
    progress_.timed(mapping_piece::search_neighbour, static_cast<double>(report_.neighbours),
                    [&] { search_.compute(s, detail::search_of(options_)); });
    if (search_.stopped()) progress_.cut();
  }

  void create(stage_keyframe, const scope& s) {
    const stage_outcome searched = report_.outcome[mapping_stage::search];
    if (searched != stage_outcome::done && searched != stage_outcome::cut) return;
    if (!progress_.fits(mapping_piece::create_points)) return progress_.cut(mapping_piece::create_points);
    progress_.timed(mapping_piece::create_points, 1, [&] {
      // What was inserted is watched, and its appearance is due, also where a later part throws.
      const auto note = [this] {
        report_.matches = creation_.matches();
        report_.creation = creation_.summary();
        report_.points_created = creation_.created().size();
        report_.points_updated += creation_.created().size();
        due_.changed(creation_.due());
        probation_.watch(creation_.created(), iteration_);
      };
      noted([&] { creation_(s, search_, options_.creation, appearance()); }, note);
      if (!due_.empty()) report_.points_updated += due_.update(s, appearance());  // fusion reads it
    });
  }

  void fuse(stage_keyframe current, const scope& s) {
    report_.fusion_targets = fusion_.choose_targets(s, current, options_.neighbours.neighbourhood, progress_);
    fuse_with_targets(current, s);
  }
  /// What was applied is reported, and its appearance is due, also where a later part throws.
  void fuse_with_targets(stage_keyframe current, const scope& s) {
    noted([&] { fusion_.fuse(s, current, detail::fusion_of(options_), progress_); },
          [this] {
            report_.fused += fusion_.done();
            due_.changed(fusion_.touched());
          });
  }

  void adjust(stage_keyframe current, const scope& s) {
    const double left = progress_.left_ms();
    if (!(left > 0)) {
      progress_.cut();
    } else if (hooks_.adjust) {
      noted([&] { hooks_.adjust(map_, working_.name(current), left); }, [this] { working_.forget_poses(); });
    } else if constexpr (adjusts) {
      const local_adjustment_options options = detail::adjustment_of(options_, left);
      const std::size_t outliers = report_.adjustment.outliers, points_erased = report_.adjustment.points_erased;
      bool ended = false;
      const auto work = [&] {
        if constexpr (inertial)
          adjustment_(s, current, options, options_.inertial, report_.adjustment);
        else
          adjustment_(s, current, options, report_.adjustment);
        ended = true;
      };
      noted(work, [&] {
        report_.adjustment.outliers += outliers;
        report_.adjustment.points_erased += points_erased;
        if (ended || adjustment_.wrote()) note_adjusted(adjustment_);
      });
    }
  }

  /// Its points have moved, and lost outliers.
  template <class Adjusted>
  void note_adjusted(const Adjusted& adjusted) {
    due_.moved(adjusted.points());
    due_.changed(adjusted.points_that_lost_views());
  }

  /// Adjustment has moved the keyframe: links that its pose hid are found now, and move it on. A round for which no time is
  /// left is not begun, and cuts nothing: the stages are done without it.
  void repeat_fusion(stage_keyframe current) {
    const auto is_done = [&](mapping_stage s) { return report_.outcome[s] == stage_outcome::done; };
    for (int round = 0; round < options_.extra_rounds; ++round) {
      if (!is_done(mapping_stage::fusion) || !is_done(mapping_stage::adjustment)) return;
      if (progress_.must_skip(mapping_stage::fusion, hooks_)) return;
      if (!progress_.fits(mapping_piece::fuse_target, static_cast<double>(report_.fusion_targets)) ||
          !progress_.fits(mapping_piece::fuse_back))
        return;
      update_due(mapping_stage::adjustment);  // fusion reads it
      const std::size_t links = report_.fused.observations_added + report_.fused.merged;
      run_stage(mapping_stage::fusion, current, &local_mapper::fuse);
      if (report_.fused.observations_added + report_.fused.merged == links) return;
      if (progress_.must_skip(mapping_stage::adjustment, hooks_) || !(progress_.left_ms() > 0)) return;
      run_stage(mapping_stage::adjustment, current, &local_mapper::adjust);
    }
  }

  /// Points that lost a view are due also where a later part throws.
  void cull(stage_keyframe current, const scope& s) {
    noted([&] { cull_covisible(current, s); }, [this] { due_.changed(culling_.touched()); });
  }
  /// Of a keyframe that leaves the map: its successor's begins earlier. Without an IMU there is none.
  void merge_motion([[maybe_unused]] const stage_keyframe& leaving) {
    if constexpr (inertial) stage_adjustment::erasing(working_.get(), leaving, options_.inertial);
  }
  void cull_covisible(stage_keyframe current, const scope& s) {
    keyframe_culling_options options = options_.keyframe_culling;
    if constexpr (inertial) {
      const auto guard = s.guard();
      options.inertial_initialised = stage_adjustment::is_initialised(s.map);
    }
    for (const stage_keyframe& k :
         culling_.snapshot(s, current, options_.neighbours.neighbourhood, options.most_candidates)) {
      if (options.most_erased > 0 && report_.keyframes_culled.size() >= static_cast<std::size_t>(options.most_erased))
        break;
      if (!progress_.fits(mapping_piece::cull_keyframe)) {
        progress_.cut(mapping_piece::cull_keyframe);
        break;
      }
      progress_.timed(mapping_piece::cull_keyframe, 1, [&] {
        report_.keyframes_culled.reserve(report_.keyframes_culled.size() + 1);
        culling_.commit(
            s, current, k, options,
            [this](const stage_keyframe& redundant) {
              if (hooks_.erasing) hooks_.erasing(working_.name(redundant));
            },
            [this](const stage_keyframe& leaving) { merge_motion(leaving); },
            [this](std::uint64_t id) {
              report_.keyframes_culled.push_back(id);
              if (stored().contains(id)) remove(id);
            });
      });
    }
  }

  // ---- appearances that are due ----

  appearance_options appearance() const { return detail::appearance_of<Map>(options_); }
  /// Appearances are read by fusion, and by tracking after process(). So what fusion, adjustment and culling change is
  /// computed once, at the end, and its time is that of the stage that touches most points.
  mapping_stage due_stage() const {
    for (const auto s : {mapping_stage::adjustment, mapping_stage::fusion})
      if (report_.outcome[s] == stage_outcome::done || report_.outcome[s] == stage_outcome::cut) return s;
    return mapping_stage::keyframe_culling;
  }
  void update_due(mapping_stage s) {
    if (due_.empty() && moved_.empty() && changed_.empty()) return;
    const named_range range("appearances");
    const double begin = progress_.elapsed_ms();
    take_reported();
    report_.points_updated += due_.update(scope_of(s), appearance());
    report_.ms[s] += progress_.elapsed_ms() - begin;
  }

  /// What was given to update_geometry() and update_appearance() is due.
  void take_reported() {
    if (moved_.empty() && changed_.empty()) return;
    const auto guard = scope_of(mapping_stage::adjustment).guard();
    const auto moved = moved_.take(working_);
    for (const stage_point& p : moved) working_.forget(p);
    due_.moved(moved);
    const auto changed = changed_.take(working_);
    for (const stage_point& p : changed) working_.forget(p);
    due_.changed(changed);
  }

  context<Policy>& ctx_;
  Map& map_;
  working_map<Map> working_;
  stored_keyframes<Map, Policy> stored_;
  local_mapper_options options_;
  hooks_type hooks_;

  point_culling<stage_map, Policy> probation_;
  neighbour_search<stage_map, Policy> search_;
  map_point_creation<stage_map, Policy> creation_;
  neighbourhood_fusion<stage_map, Policy> fusion_;
  stage_adjustment adjustment_;
  keyframe_culling<stage_map, Policy> culling_;
  due_appearances<stage_map, Policy> due_;

  std::int64_t iteration_ = 0;
  mapping_progress progress_;
  mapping_report report_;
  bool has_pose_ = false;  ///< the keyframe that is processed
  list_of<stage_point> points_;
  named_points<Map> watched_, moved_, changed_;  ///< by the user, of a map that is mirrored
  bool processing_ = false;
};

template <class Map, class Policy>
class local_mapper<Map, Policy, detail::refused_traits> : public detail::refused_mapper {
  static_assert(require_map_traits<Map>());

 public:
  using detail::refused_mapper::refused_mapper;
};
/// From a context, a map and a store, whatever is given besides.
template <class Policy, class Map, class... Rest>
local_mapper(context<Policy>&, Map&, Rest&&...) -> local_mapper<Map, Policy>;

TURBOMAP_END_NAMESPACE
