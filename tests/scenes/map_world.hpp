// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A map of any type and its oracle, edited side by side and compared after each edit. Any list of edits is a program:
/// operands are taken modulo what there is.

#include <turbomap/map/map_edit.hpp>
#include <turbomap/mapping/fusion_commit.hpp>
#include <turbomap/mapping/keyframe_culling.hpp>
#include <turbomap/mapping/point_culling.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "map_edits.hpp"
#include "map_pair.hpp"
#include "map_scene.hpp"
#include "reference/culling_oracle.hpp"
#include "reference/fusion_commit_oracle.hpp"
#include "reference/map_oracle.hpp"

namespace turbomap_test {

struct world_options {
  int cameras = 1, levels = 8, keypoints_per_camera = 24;
  std::size_t most_keyframes = 14, most_points = 60;
};

template <class Map, class Edits = library_edits>
class map_world : public map_pair<Map> {
 public:
  using base = map_pair<Map>;
  using typename base::keyframe;
  using typename base::point;
  using typename base::traits;

  explicit map_world(const world_options& o) : options_(o) {}

  /// Throws map_differs.
  void apply(const edit& e) {
    oracle_.changed_points.clear(), oracle_.changed_keyframes.clear();
    dispatch(e);
    for (const oracle_id p : oracle_.changed_points) check_point(p);
    for (const oracle_id k : oracle_.changed_keyframes) check_keyframe(k);
  }

  std::size_t edits_done() const { return done_; }  ///< those that changed something

 private:
  using base::before;
  using base::check_keyframe;
  using base::check_point;
  using base::check_resolve;
  using base::handle;
  using base::handles;
  using base::ids;
  using base::keyframes_;
  using base::map_;
  using base::oracle_;
  using base::points_;
  using base::require;

  template <class Container>
  static std::optional<oracle_id> pick(const Container& ids, std::uint32_t number) {
    if (ids.empty()) return std::nullopt;
    return std::next(ids.begin(), static_cast<std::ptrdiff_t>(number % ids.size()))->first;
  }
  std::size_t size_of(oracle_id k) const { return oracle_.keyframes.at(k).keypoints.size(); }

  void dispatch(const edit& e) {
    const auto k = pick(oracle_.keyframes, e.b), p = pick(oracle_.points, e.a);
    if (e.kind == edit_kind::add_keyframe) return add_keyframe(e);
    if (e.kind == edit_kind::add_point) return add_point(k);
    if (e.kind == edit_kind::forget_replacements) return forget_replacements();
    if (e.kind == edit_kind::cull_points) return cull_points(e);
    if (!k || !p) return;
    switch (e.kind) {
      case edit_kind::erase_keyframe:
        return erase_keyframe(e, *k);
      case edit_kind::erase_point:
        return erase_point(*p);
      case edit_kind::observe:
        return observe(*p, *k, e.c % size_of(*k));
      case edit_kind::merge:
        return merge(*p, *pick(oracle_.points, e.b), rules(e.c));
      case edit_kind::commit:
        return commit(e);
      case edit_kind::cull_keyframes:
        return cull_keyframes(e, *k);
      default:
        break;
    }
    // The rest wants a keypoint that holds a point, mostly.
    oracle_view view{*k, e.c % size_of(*k)};
    const auto& views = oracle_.points.at(*p).views;
    if (!views.empty()) view = *std::next(views.begin(), static_cast<std::ptrdiff_t>(e.b % views.size()));
    if (e.kind == edit_kind::move) return move(view.first, view.second, e.c % size_of(view.first));
    if (e.kind == edit_kind::fade) return fade(view, static_cast<int>(e.c % 4));
    forget(view);
  }

  void add_keyframe(const edit& e) {
    if (oracle_.keyframes.size() >= options_.most_keyframes) return;
    const auto keypoints = random_keypoints(e.a, options_.cameras, options_.levels, options_.keypoints_per_camera);
    time_s_ += 0.05 * static_cast<double>(1 + e.b % 8);
    const auto previous = oracle_.keyframes.empty() ? keyframe{} : keyframes_[oracle_.keyframes.rbegin()->first];
    const keyframe k = insert_keyframe(map_, keypoints, time_s_, previous);
    const oracle_id id = keyframes_.size();
    require(traits::id(map_, k) == id, "id of a new keyframe", id);
    keyframes_.push_back(k);
    oracle_.keyframes[id] = {keypoints, time_s_};
    oracle_.changed_keyframes.insert(id);
    ++done_;
  }
  void add_point(const std::optional<oracle_id>& k) {
    if (oracle_.points.size() >= options_.most_points) return;
    const point p = traits::add_point(map_, {1, 2, 3}, k ? keyframes_[*k] : keyframe{});
    const oracle_id id = points_.size();
    require(traits::id(map_, p) == id, "id of a new point", id);
    points_.push_back(p);
    oracle_.points[id] = {k, {}};
    oracle_.changed_points.insert(id);
    recent_.push_back({p, static_cast<std::int64_t>(keyframes_.size())});
    oracle_recent_.push_back({id, static_cast<std::int64_t>(keyframes_.size())});
    ++done_;
  }
  void erase_keyframe(const edit& e, oracle_id k) {
    const int fewest = e.c % 2 == 0 ? 2 : static_cast<int>(e.c / 2 % 4);
    std::vector<point> touched;
    turbomap::erase_keyframe(map_, keyframes_[k], fewest, &touched);
    const auto expected = oracle_.erase_keyframe(k, fewest);
    oracle_.changed_keyframes.insert(k);
    require(ids(touched) == std::multiset<oracle_id>(expected.begin(), expected.end()), "touched by erasing keyframe",
            k);
    ++done_;
  }
  void erase_point(oracle_id p) {
    turbomap::erase_point(map_, points_[p]);
    oracle_.erase_point(p);
    oracle_.changed_points.insert(p);
    ++done_;
  }
  void observe(oracle_id p, oracle_id k, std::size_t i) {
    const bool made = Edits::observe(map_, points_[p], keyframes_[k], i);
    oracle_.changed_points.insert(p), oracle_.changed_keyframes.insert(k);
    require(made == oracle_.observe(p, {k, i}), "observe() of point", p);
    done_ += made ? 1 : 0;
  }
  void forget(const oracle_view& v) {
    const point made = Edits::forget(map_, keyframes_[v.first], v.second);
    oracle_.changed_keyframes.insert(v.first);
    require(made == handle(oracle_.forget(v)), "forget() in keyframe", v.first);
    done_ += made == point{} ? 0 : 1;
  }
  void fade(const oracle_view& v, int fewest) {
    const bool died = turbomap::fade(map_, keyframes_[v.first], v.second, fewest);
    oracle_.changed_keyframes.insert(v.first);
    require(died == oracle_.fade(v, fewest), "fade() in keyframe", v.first);
    ++done_;
  }
  void move(oracle_id k, std::size_t from, std::size_t to) {
    const bool made = Edits::move(map_, keyframes_[k], from, to);
    oracle_.changed_keyframes.insert(k);
    require(made == oracle_.move(k, from, to), "move_observation() in keyframe", k);
    done_ += made ? 1 : 0;
  }
  /// All rules, and for the tolerant one another tolerance now and then.
  static turbomap::fusion_commit_options rules(std::uint32_t number) {
    static constexpr turbomap::merge_rule all[] = {turbomap::merge_rule::refuse, turbomap::merge_rule::refuse_apart,
                                                   turbomap::merge_rule::refuse_apart, turbomap::merge_rule::drop};
    turbomap::fusion_commit_options o;
    o.merges = all[number % 4];
    if (number % 8 == 2) o.tolerance.chi2 = 40, o.tolerance.scale_factor = 1.5F;
    return o;
  }
  static oracle_merge_rule oracle_rule(const turbomap::fusion_commit_options& o) {
    return {o.merges == turbomap::merge_rule::drop, o.merges == turbomap::merge_rule::refuse_apart, o.tolerance.chi2,
            static_cast<double>(o.tolerance.scale_factor)};
  }
  void merge(oracle_id from, oracle_id into, const turbomap::fusion_commit_options& o) {
    const bool made = Edits::merge(map_, points_[from], points_[into], o, scratch_);
    oracle_.changed_points.insert(from), oracle_.changed_points.insert(into);
    require(made == oracle_.merge(from, into, oracle_rule(o)), "merge_points() of point", from);
    if (made) check_resolve(from);
    done_ += made ? 1 : 0;
  }
  /// A plan about few points and keypoints, some of them dead: entries get in each other's way.
  void commit(const edit& e) {
    std::mt19937 random(e.a);
    const auto draw = [&random](std::size_t n) { return static_cast<std::size_t>(random() % n); };
    std::vector<oracle_id> target_ids, point_ids;
    for (int i = 0; i < 3; ++i)
      target_ids.push_back(draw(8) == 0 ? draw(keyframes_.size()) : *pick(oracle_.keyframes, random()));
    for (int i = 0; i < 6; ++i)
      point_ids.push_back(draw(4) == 0 ? draw(points_.size()) : *pick(oracle_.points, random()));
    std::vector<keyframe> targets;
    std::vector<point> points;
    for (const oracle_id k : target_ids) targets.push_back(keyframes_[k]);
    for (const oracle_id p : point_ids) points.push_back(points_[p]);
    std::vector<turbomap::duplicate<std::int32_t>> plan;
    std::vector<oracle_entry> oracle_plan;
    for (std::size_t n = 1 + e.b % 8; n > 0; --n) {
      const std::size_t t = draw(targets.size()), p = draw(points.size());
      const auto alive = oracle_.keyframes.find(target_ids[t]);
      const std::size_t all = alive == oracle_.keyframes.end() ? 1 : alive->second.keypoints.size();
      std::size_t i = draw(all);
      if (draw(3) == 0) i = std::min(all - 1, std::size_t{2});  // several want this one
      plan.push_back({static_cast<std::int32_t>(t), 0, static_cast<std::int32_t>(p), static_cast<std::int32_t>(i), 1});
      oracle_plan.push_back({point_ids[p], {target_ids[t], i}});
    }
    const auto o = rules(e.c);
    const bool lossless = o.merges == turbomap::merge_rule::refuse;
    const auto before = lossless && e.b / 8 % 4 == 0 ? oracle_.holder : std::map<oracle_view, oracle_id>{};
    fusion_.clear();
    const auto summary = fusion_(map_, turbomap::span<const turbomap::duplicate<std::int32_t>>(plan),
                                 turbomap::span<const keyframe>(targets), turbomap::span<const point>(points), o);
    const oracle_commit expected = commit_duplicates(oracle_, oracle_plan, oracle_rule(o));
    require(summary.entries == plan.size() && fusion_.actions().size() == plan.size(), "entries of a commit", e.a);
    for (std::size_t i = 0; i < plan.size(); ++i)
      require(static_cast<int>(fusion_.actions()[i]) == expected.actions[i], "action of a commit", i);
    require(fusion_.touched() == handles(expected.gained), "points touched by a commit", e.a);
    require(fusion_.survivors() == handles(expected.survivors), "survivors of a commit", e.a);
    for (const auto& [view, unused] : before)  // no observation is lost
      require(!(traits::point_at(map_, keyframes_[view.first], view.second) == point{}),
              "a commit lost an observation of", view.first);
    for (const oracle_id p : point_ids) oracle_.changed_points.insert(p), check_resolve(p);
    ++done_;
  }
  void cull_keyframes(const edit& e, oracle_id current) {
    std::mt19937 random(e.a);
    turbomap::keyframe_culling_options o;
    o.redundant_share = static_cast<float>(random() % 10) / 10;
    o.observers = static_cast<int>(random() % 4), o.octave_slack = static_cast<int>(random() % 3);
    o.max_depth = random() % 2 == 0 ? 0.F : 6.F;
    o.fewest_measurements = static_cast<int>(random() % 4);
    if constexpr (turbomap::detail::map_has_v<Map, turbomap::detail::map_temporal_member>)
      o.temporal_guards = random() % 2 == 0;
    o.keep_keyframes = static_cast<int>(random() % 8), o.keep_last = static_cast<int>(random() % 3);
    o.max_gap = 0.6, o.max_old_gap = 1.2, o.inertial_initialised = random() % 2 == 0;
    oracle_culling_rules rules{o.redundant_share, o.observers, o.octave_slack, o.max_depth, o.fewest_measurements};
    rules.guards = o.temporal_guards, rules.keep_keyframes = o.keep_keyframes, rules.keep_last = o.keep_last;
    rules.max_gap = o.max_gap, rules.max_old_gap = o.max_old_gap, rules.initialised = o.inertial_initialised;
    rules.first_stays = turbomap::detail::map_has_v<Map, turbomap::detail::map_may_erase_member>;
    std::vector<oracle_id> candidate_ids;
    for (std::uint32_t n = e.c % 4; n > 0; --n) candidate_ids.push_back(*pick(oracle_.keyframes, random()));
    std::vector<keyframe> candidates;
    for (const oracle_id k : candidate_ids) candidates.push_back(keyframes_[k]), oracle_.changed_keyframes.insert(k);
    std::vector<turbomap::culling_record<keyframe>> records;
    std::vector<point> touched;
    turbomap::cull_keyframes(map_, keyframes_[current], turbomap::span<const keyframe>(candidates), o, records,
                             &touched);
    // Duplicated names: the second time the keyframe is dead, and its record without an id.
    std::multiset<oracle_id> survivors;
    const auto expected = cull_keyframes_by_definition(oracle_, current, candidate_ids, rules, survivors);
    require(records.size() == expected.size(), "records of culling", records.size());
    for (std::size_t i = 0; i < records.size(); ++i) {
      const auto verdict = !expected[i].looked_at ? turbomap::culling_verdict::protected_
                           : expected[i].erased   ? turbomap::culling_verdict::erased
                                                  : turbomap::culling_verdict::needed;
      require(records[i].verdict == verdict, "verdict of culling", expected[i].keyframe);
      require(records[i].count.points == expected[i].points && records[i].count.redundant == expected[i].redundant,
              "count of culling", expected[i].keyframe);
      done_ += expected[i].erased ? 1 : 0;
    }
    // A point may have died by a later removal: compared by the handles.
    std::multiset<point, bool (*)(const point&, const point&)> names(&map_world::before);
    for (const oracle_id p : survivors) names.insert(points_[p]);
    std::sort(touched.begin(), touched.end(), &map_world::before);
    require(touched == std::vector<point>(names.begin(), names.end()), "touched by culling", e.a);
  }
  void cull_points(const edit& e) {
    turbomap::map_point_culling_options o;
    o.fewest_measurements = static_cast<int>(e.a % 4), o.patience = static_cast<int>(e.b % 3);
    o.probation = o.patience + static_cast<int>(e.c % 2);
    const auto now = static_cast<std::int64_t>(keyframes_.size());
    const std::size_t size = recent_.size();
    const auto summary = turbomap::cull_recent_points(map_, recent_, now, o);
    const auto dead =
        cull_points_by_definition(oracle_, oracle_recent_, now, {}, 0, o.fewest_measurements, o.patience, o.probation);
    oracle_.changed_points.insert(dead.begin(), dead.end());
    require(summary.dropped == dead.size(), "dropped points", summary.dropped);
    require(summary.released + summary.dropped + recent_.size() <= size, "released points", summary.released);
    require(recent_.size() == oracle_recent_.size(), "points on probation", recent_.size());
    for (std::size_t i = 0; i < recent_.size(); ++i)
      require(recent_[i].point == points_[oracle_recent_[i].point] && recent_[i].since == oracle_recent_[i].since,
              "point on probation", oracle_recent_[i].point);
    ++done_;
  }
  void forget_replacements() {
    if constexpr (std::is_same_v<Map, flat_map>) {
      map_.forget_replacements();
      oracle_.merged_into.clear();
      ++done_;
    }
  }

  world_options options_;
  std::vector<turbomap::recent_point<point>> recent_;
  std::vector<oracle_recent> oracle_recent_;
  turbomap::fusion_commit<Map> fusion_;
  std::vector<std::pair<keyframe, std::size_t>> scratch_;
  double time_s_ = 0;
  std::size_t done_ = 0;
};

struct world_failure {
  std::size_t edit;  ///< its number; that of edits when the last look at everything failed
  std::string what;
};

/// Runs edits from an empty map; looks at everything each `full_check` edits and at the end.
template <class Map, class Edits = library_edits>
std::optional<world_failure> run_edits(const std::vector<edit>& edits, const world_options& options,
                                       std::size_t full_check = 1000, std::size_t* done = nullptr) {
  map_world<Map, Edits> world(options);
  std::size_t i = 0;
  try {
    for (; i < edits.size(); ++i) {
      world.apply(edits[i]);
      if (i % full_check == full_check - 1) world.check_all();
    }
    world.check_all();
  } catch (const std::exception& e) {
    return world_failure{i, e.what()};
  }
  if (done != nullptr) *done += world.edits_done();
  return std::nullopt;
}

}  // namespace turbomap_test
