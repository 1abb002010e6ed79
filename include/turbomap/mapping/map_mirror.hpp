// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A flat copy of a user's map, which the stages of a local_mapper read in its place. A map of objects with locks and getters that
/// copy makes every read expensive, and stages read each point many times. The mirror reads a keyframe or a point through the
/// user's map_traits when it is first asked for, and keeps it in arrays. It is a map itself (map_mirror_traits.hpp): a stage
/// does not know the difference, and what a commit writes goes to the user's map and to the mirror.
///
/// What others change is read anew when they report it (changed(), refresh()), when a commit looks again (look_again.hpp), or
/// when a sample check finds it. Until then it costs quality at most: commits decide by what they have looked at again.
///
/// Longer than other headers: what is kept and what is read anew have to be seen together.

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <type_traits>
#include <utility>
#include <vector>

#include "../config.hpp"
#include "../map/map_edit.hpp"
#include "../map/map_traits.hpp"
#include "../map/observation_counts.hpp"
#include "../map/simple_map/map_ids.hpp"
#include "../map/simple_map/observation_pool.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "../types.hpp"
#include "id_numbers.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Numbers of keyframes and points are those of a simple_map: an index, dense, and a generation. All members but changed() and
/// refresh() are for the thread of the mapper, under the map's guard. Memory per point: some 160 bytes, its name and descriptor,
/// four bytes per pyramid level, 8 to 16 per observation, 24 for a covariance: about 350 for an ORB point with eight
/// observations. Per keypoint of a keyframe 36 bytes.
template <class Map>
class map_mirror {
 public:
  /// @{
  /// Types of the user's map, as its traits name them; `keyframe` and `point` are the mirror's own names.
  using user_traits = map_traits<Map>;
  using user_keyframe = typename user_traits::keyframe;
  using user_point = typename user_traits::point;
  using descriptor = typename user_traits::descriptor;
  using element = typename descriptor::element;
  using keyframe = map_keyframe_id;
  using point = map_point_id;
  /// @}

  /// Empty. \param map  must outlive this
  explicit map_mirror(Map& map) : map_(map) {
    take_point(user_point{}, 0), point_places_.retire(gone);  // place 0 stands for whatever is not alive
    take_keyframe(user_keyframe{}, 0), keyframe_places_.retire(gone);
    keyframes_[gone].has_keypoints = true;  // none
  }
  map_mirror(const map_mirror&) = delete;
  map_mirror& operator=(const map_mirror&) = delete;

  /// The user's map.
  Map& map() const { return map_; }

  // ---- what others report; from any thread, with or without the guard; heard when the next keyframe is processed ----

  /// The point is another than it was: position, observations, whatever it has.
  void changed(const user_point& p) {
    const std::lock_guard<std::mutex> lock(mutex_);
    changed_points_.push_back(p);
  }
  /// The keyframe is another than it was: its pose, its slots.
  void changed(const user_keyframe& k) {
    const std::lock_guard<std::mutex> lock(mutex_);
    changed_keyframes_.push_back(k);
  }
  /// Everything may have changed.
  void refresh() {
    const std::lock_guard<std::mutex> lock(mutex_);
    all_changed_ = true;
  }

  // ---- for the mapper ----

  /// Nothing is known any more, and no name is kept: the user's map starts anew, perhaps with ids that were there before. The
  /// user's map is not asked.
  void reset() {
    for (const std::int32_t p : merged_) point_places_.give_back(p);
    merged_.clear();
    for (std::size_t p = 1; p < points_.size(); ++p) {
      names_[p] = user_point{};
      if (!point_places_.alive(static_cast<std::int32_t>(p))) continue;
      point_numbers_.erase(points_[p].id);
      lists_.close(p);
      point_places_.give_back(static_cast<std::int32_t>(p));
    }
    for (std::size_t k = 1; k < keyframes_.size(); ++k) {
      keyframes_[k].name = user_keyframe{};
      if (!keyframe_places_.alive(static_cast<std::int32_t>(k))) continue;
      keyframe_numbers_.erase(keyframes_[k].id);
      plain_vector<map_point_id>().swap(keyframes_[k].slots);
      plain_vector<keypoint>().swap(keyframes_[k].keypoints);
      keyframe_places_.give_back(static_cast<std::int32_t>(k));
    }
    next_point_ = next_keyframe_ = 0;
    const std::lock_guard<std::mutex> lock(mutex_);
    changed_points_.clear(), changed_keyframes_.clear();
    all_changed_ = false;
  }

  /// Before a keyframe is processed: numbers of merged points are free again, names of what is gone are let go, and what was
  /// reported is heard.
  void begin() {
    for (const std::int32_t p : merged_) {
      names_[static_cast<std::size_t>(p)] = user_point{};
      point_places_.give_back(p);
    }
    merged_.clear();
    for (std::size_t k = 1; k < keyframes_.size(); ++k)
      if (!keyframe_places_.alive(static_cast<std::int32_t>(k))) keyframes_[k].name = user_keyframe{};
    hear();
  }
  /// What was reported is to be read anew.
  void hear() {
    list_of<user_point> points;
    list_of<user_keyframe> keyframes;
    bool all = false;
    {  // the user's map is asked without the lock: who reports may hold locks of objects
      const std::lock_guard<std::mutex> lock(mutex_);
      points.swap(changed_points_), keyframes.swap(changed_keyframes_);
      std::swap(all, all_changed_);
    }
    try {
      if (all) forget_all();
      for (const user_point& p : points) forget(number(p));
      for (const user_keyframe& k : keyframes) read_again(number(k));
    } catch (...) {
      refresh();
      throw;
    }
  }
  /// Compares one keyframe and a share of all points with the user's map, the next ones at each call, and reads anew those that
  /// differ. \return how many did
  std::size_t check_sample(double share) {
    if (!(share > 0)) return 0;
    std::size_t stale = 0;
    const double wanted = share * static_cast<double>(points_.size());
    std::size_t points =
        wanted < static_cast<double>(points_.size()) ? static_cast<std::size_t>(wanted) + 1 : points_.size();
    for (; points > 0 && points_.size() > 1; --points) {
      next_point_ = next_point_ + 1 < points_.size() ? next_point_ + 1 : 1;
      if (!point_places_.alive(static_cast<std::int32_t>(next_point_))) continue;
      if (points_[next_point_].read == 0) {  // nobody may ever ask for it again
        if (!user_traits::alive(map_, names_[next_point_])) read_point(next_point_);
        continue;
      }
      if (is_current(next_point_)) continue;
      ++stale;
      read_point(next_point_);
    }
    if (keyframes_.size() > 1) {
      next_keyframe_ = next_keyframe_ + 1 < keyframes_.size() ? next_keyframe_ + 1 : 1;
      const auto k = static_cast<std::int32_t>(next_keyframe_);
      if (keyframe_places_.alive(k)) {
        if (keyframes_[next_keyframe_].read != 0)
          stale += read_keyframe(next_keyframe_) ? 1 : 0;
        else if (!user_traits::alive(map_, keyframes_[next_keyframe_].name))
          lose_keyframe(next_keyframe_);
      }
    }
    return stale;
  }
  /// All poses may have changed.
  void forget_poses() {
    for (std::size_t k = 1; k < keyframes_.size(); ++k) keyframes_[k].pose_read = 0;
  }
  /// The keyframe is out of the map.
  void removed(std::uint64_t id) {
    const std::int32_t k = keyframe_numbers_.find(id);
    if (k != id_numbers::none) lose_keyframe(static_cast<std::size_t>(k));
  }
  /// Everything is to be read anew when it is next asked for.
  void forget_all() const {
    for (std::size_t p = 1; p < points_.size(); ++p) points_[p].read = 0;
    for (std::size_t k = 1; k < keyframes_.size(); ++k) keyframes_[k].read = 0;
  }
  /// Is to be read anew when it is next asked for.
  void forget(point p) const {
    if (known(p)) points_[at(p)].read = 0;
  }
  /// Reads pose and slots of a keyframe that tracking hands over: its points are observed by it. That is all that tracking is
  /// taken to have changed of points that have been read before.
  void take_associations(keyframe k) const {
    if (!known(k)) return;
    const user_keyframe name = keyframes_[at(k)].name;
    keyframes_[at(k)].read = 0;  // until all of it is
    look_at_pose(at(k), name);
    keypoints(at(k));
    for (std::size_t i = 0; i < keyframes_[at(k)].slots.size(); ++i) {
      const point before = keyframes_[at(k)].slots[i], now = number(user_traits::point_at(map_, name, i));
      if (now == before) continue;
      const observation o{k.index, static_cast<std::int32_t>(i)};
      if (known(now) && points_[at(now)].read != 0 && !lists(now, at(k), i)) {
        lists_.add(at(now), o);
        count_octaves(at(now));
      }
      keyframes_[at(k)].slots[i] = now;
      if (known(before) && lists_.erase(at(before), o)) count_octaves(at(before));
    }
    keyframes_[at(k)].read = 1;
  }
  /// Reads pose and slots of a keyframe now: points that came into its slots, or left them, are to be read anew.
  void read_again(keyframe k) const {
    if (known(k)) read_keyframe(at(k));
  }

  /// The number of what is named, which need not be read for it.
  keyframe number(const user_keyframe& name) const {
    if (name == user_keyframe{}) return {};
    const std::int32_t known = keyframe_numbers_.find(user_traits::id(map_, name));
    if (known != id_numbers::none && keyframe_places_.alive(known) &&
        keyframes_[static_cast<std::size_t>(known)].name == name)
      return keyframe_at(known);
    if (!user_traits::alive(map_, name)) return keyframe_at(gone);
    return keyframe_at(take_keyframe(name, user_traits::id(map_, name)));
  }
  /// The same of a point; no name: none.
  point number(const user_point& name) const {
    if (name == user_point{}) return {};
    const std::uint64_t id = user_traits::id(map_, name);
    const std::int32_t known = point_numbers_.find(id);
    if (known != id_numbers::none && point_places_.alive(known) && names_[static_cast<std::size_t>(known)] == name)
      return point_at(known);
    if (!user_traits::alive(map_, name)) return point_at(gone);
    return point_at(take_point(name, id));
  }
  /// What the user calls a keyframe.
  const user_keyframe& name(keyframe k) const { return keyframes_[k.index < 0 ? gone : at(k)].name; }
  /// What the user calls a point.
  const user_point& name(point p) const { return names_[p.index < 0 ? gone : at(p)]; }

 private:
  friend struct map_traits<map_mirror>;
  static constexpr std::int32_t gone = 0;
  static constexpr bool counted_by_user = counts_octaves_v<Map>;
  static constexpr bool has_covariances = detail::map_has_v<Map, detail::map_covariance_member>;

  struct keyframe_entry {
    user_keyframe name{};
    std::uint64_t id = 0;
    std::uint8_t read = 0;             ///< slots and pose are as they were last seen; 0: to be read anew
    std::uint8_t pose_read = 0;        ///< the same of the pose alone
    bool has_keypoints = false;        ///< they never change
    plain_vector<keypoint> keypoints;  ///< with slots
    plain_vector<map_point_id> slots;
    rigid_transform<double> T_cw;
  };
  struct point_entry {
    std::uint64_t id = 0;
    keyframe reference = {};
    point replacement = {};
    std::uint8_t read = 0;
    bool described = false;  ///< the user's map has a descriptor of it
  };
  struct range {
    float min = 0, max = 0;
  };

  static std::size_t at(keyframe k) { return static_cast<std::size_t>(k.index); }
  static std::size_t at(point p) { return static_cast<std::size_t>(p.index); }
  bool known(keyframe k) const { return k.index > 0 && keyframe_places_.known(k.index, k.generation); }
  bool known(point p) const { return p.index > 0 && point_places_.known(p.index, p.generation); }
  keyframe keyframe_at(std::int32_t i) const { return {i, keyframe_places_.generation(i)}; }
  point point_at(std::int32_t i) const { return {i, point_places_.generation(i)}; }

  // ---- places ----

  std::int32_t take_keyframe(const user_keyframe& name, std::uint64_t id) const {
    if (keyframes_.capacity() == keyframes_.size()) keyframes_.reserve(2 * keyframes_.size() + 16);
    keyframe_numbers_.make_room();
    const std::int32_t k = keyframe_places_.take();  // the last step that may throw
    if (static_cast<std::size_t>(k) == keyframes_.size()) keyframes_.emplace_back();
    auto& entry = keyframes_[static_cast<std::size_t>(k)];
    entry = {};
    entry.name = name, entry.id = id;
    if (!(name == user_keyframe{})) keyframe_numbers_.set(id, k);
    return k;
  }
  std::int32_t take_point(const user_point& name, std::uint64_t id) const {
    grow_points();
    const std::int32_t p = point_places_.take();  // the last step that may throw
    const auto i = static_cast<std::size_t>(p);
    if (i == points_.size()) {
      points_.push_back({}), names_.push_back({});
      positions_.push_back({}), normals_.push_back({}), ranges_.push_back({});
      if constexpr (has_covariances) covariances_.push_back({});
      descriptors_.resize(descriptors_.size() + elements);
      counts_.resize(counts_.size() + levels_);
    }
    lists_.close(i);
    points_[i] = {};
    points_[i].id = id;
    names_[i] = name;
    for (std::size_t o = 0; o < levels_; ++o) counts_[i * levels_ + o] = 0;
    if (!(name == user_point{})) point_numbers_.set(id, p);
    return p;
  }
  /// Room for one more: what follows finds its memory.
  void grow_points() const {
    const std::size_t n = points_.size() + 1;
    const auto grow = [](auto& list, std::size_t size) {
      if (list.capacity() < size) list.reserve(size + size / 2 + 64);
    };
    grow(points_, n), grow(names_, n), grow(positions_, n), grow(normals_, n), grow(ranges_, n);
    if constexpr (has_covariances) grow(covariances_, n);
    grow(descriptors_, n * elements), grow(counts_, n * levels_);
    grow(merged_, n);
    point_numbers_.make_room();
    lists_.open(n - 1);
  }
  void lose_keyframe(std::size_t k) const {
    auto& entry = keyframes_[k];
    keyframe_numbers_.erase(entry.id);
    keyframe_places_.retire(static_cast<std::int32_t>(k));
    for (const point p : entry.slots) forget(p);
    if (entry.read == 0) {  // its slots do not tell who lists it
      for (std::size_t p = 1; p < points_.size(); ++p)
        for (const observation& o : lists_.of(p))
          if (o.keyframe == static_cast<std::int32_t>(k)) points_[p].read = 0;
    }
    plain_vector<map_point_id>().swap(entry.slots);
    plain_vector<keypoint>().swap(entry.keypoints);
    entry.has_keypoints = true;  // none
    entry.read = 0;
  }
  /// It is not alive in the user's map: `replacement`, or nothing, is there for it.
  void lose_point(std::size_t p, point replacement) const {
    old_.clear();
    for (const observation& o : lists_.of(p)) old_.push_back(o);
    point_numbers_.erase(points_[p].id);
    point_places_.retire(static_cast<std::int32_t>(p));
    points_[p].replacement = replacement;
    merged_.push_back(static_cast<std::int32_t>(p));
    lists_.close(p);
    try {
      for (const observation& o : old_) agree(o);
    } catch (...) {
      read_slots_of_old_anew();
      throw;
    }
  }

  // ---- reading ----

  void ensure(keyframe k) const {
    if (keyframes_[at(k)].read == 0) read_keyframe(at(k));
  }
  void ensure_pose(keyframe k) const {
    ensure(k);
    if (keyframes_[at(k)].pose_read == 0) look_at_pose(at(k), name(k));
  }
  void ensure(point p) const {
    if (points_[at(p)].read == 0) read_point(at(p));
  }
  const plain_vector<keypoint>& keypoints(std::size_t k) const {
    auto& entry = keyframes_[k];
    if (!entry.has_keypoints) {
      const std::size_t n = keypoint_count_of(map_, entry.name);
      entry.keypoints.resize(n);
      entry.slots.resize(n);
      for (std::size_t i = 0; i < n; ++i) {
        entry.keypoints[i] = keypoint_of(map_, entry.name, i), entry.slots[i] = point{};
        if (entry.keypoints[i].octave >= levels_) more_levels(entry.keypoints[i].octave + std::size_t{1});
      }
      entry.has_keypoints = true;
    }
    return entry.keypoints;
  }
  void more_levels(std::size_t levels) const {
    plain_vector<std::uint32_t> counts(points_.size() * levels);
    for (std::size_t p = 0; p < points_.size(); ++p)
      for (std::size_t o = 0; o < levels; ++o) counts[p * levels + o] = o < levels_ ? counts_[p * levels_ + o] : 0;
    counts_.swap(counts);
    levels_ = levels;
  }
  /// Pose and slots. \return whether anything was not as it was last seen
  bool read_keyframe(std::size_t k) const {
    if (static_cast<std::int32_t>(k) == gone || !keyframe_places_.alive(static_cast<std::int32_t>(k))) return false;
    const user_keyframe name = keyframes_[k].name;
    if (!user_traits::alive(map_, name)) {
      lose_keyframe(k);
      return true;
    }
    bool differs = look_at_pose(k, name);
    keypoints(k);
    keyframes_[k].read = 0;  // until all of it is
    for (std::size_t i = 0; i < keyframes_[k].slots.size(); ++i) differs = read_slot(k, i, name) || differs;
    keyframes_[k].read = 1;
    return differs;
  }
  bool look_at_pose(std::size_t k, const user_keyframe& name) const {
    const auto T = pose_of(map_, name);
    auto& old = keyframes_[k].T_cw;
    const bool same = is_same_pose(T, old);
    old = T;
    keyframes_[k].pose_read = 1;
    return !same;
  }
  bool read_slot(std::size_t k, std::size_t i, const user_keyframe& name) const {
    const point now = number(user_traits::point_at(map_, name, i));
    point& slot = keyframes_[k].slots[i];
    const point before = slot;
    slot = now;
    if (now == before) return false;
    if (lists(before, k, i)) forget(before);
    if (!lists(now, k, i)) forget(now);
    return true;
  }
  /// Whether a point that has been read lists the keypoint.
  bool lists(point p, std::size_t k, std::size_t i) const {
    if (!known(p)) return false;
    for (const observation& o : lists_.of(at(p)))
      if (o.keyframe == static_cast<std::int32_t>(k) && o.keypoint == static_cast<std::int32_t>(i)) return true;
    return false;
  }
  void read_point(std::size_t p) const {
    if (static_cast<std::int32_t>(p) == gone || !point_places_.alive(static_cast<std::int32_t>(p))) return;
    const user_point name = names_[p];
    points_[p].read = 0;  // until all of it is
    if (!user_traits::alive(map_, name)) return lose_point(p, number(resolve(map_, name)));
    read_position(p, name);
    normals_[p] = user_traits::normal(map_, name);
    ranges_[p] = {user_traits::min_distance(map_, name), user_traits::max_distance(map_, name)};
    if constexpr (has_covariances) covariances_[p] = user_traits::covariance(map_, name);
    const auto& given = user_traits::descriptor_data(map_, name);
    const element* const d = detail::elements_of<descriptor>(given);
    points_[p].described = d != nullptr;
    for (std::size_t e = 0; d != nullptr && e < elements; ++e) descriptors_[p * elements + e] = d[e];
    points_[p].reference = number(user_traits::reference(map_, name));
    read_list(p, name);
    points_[p].read = 1;
  }
  void read_position(std::size_t p, const user_point& name) const {
    const auto& x = user_traits::position(map_, name);
    positions_[p] = {x.x, x.y, x.z};
  }
  void read_list(std::size_t p, const user_point& name) const {
    const std::uint8_t read = points_[p].read;
    points_[p].read = 0;  // until all of it is
    scratch_.clear();
    user_traits::for_each_observation(map_, name, [&](const user_keyframe& observer, std::size_t keypoint) {
      const keyframe k = number(observer);
      scratch_.push_back({k.index < 0 ? gone : k.index, static_cast<std::int32_t>(keypoint)});
    });
    old_.clear();
    for (const observation& o : lists_.of(p)) old_.push_back(o);
    for (const observation& o : scratch_)
      for (observation& before : old_)
        if (before.keyframe == o.keyframe && before.keypoint == o.keypoint) before.keyframe = gone;
    try {
      lists_.close(p);
      lists_.reserve(p, scratch_.size());
      for (const observation& o : scratch_) lists_.add(p, o);
      count_octaves(p);
      for (const observation& o : old_) agree(o);
      for (const observation& o : scratch_) agree(o, point_at(static_cast<std::int32_t>(p)));
    } catch (...) {
      read_slots_of_old_anew();
      throw;
    }
    points_[p].read = read;
  }
  void read_slots_of_old_anew() const {
    for (const observation& o : old_) keyframes_[static_cast<std::size_t>(o.keyframe)].read = 0;
  }
  /// Slots that have been read agree with the list of a point, or are read anew. \param expected  what the slot holds by the list
  void agree(const observation& o, point expected = {}) const {
    const auto k = static_cast<std::size_t>(o.keyframe), i = static_cast<std::size_t>(o.keypoint);
    if (o.keyframe == gone || keyframes_[k].read == 0 || i >= keyframes_[k].slots.size()) return;
    if (keyframes_[k].slots[i] == expected) return;
    const user_keyframe name = keyframes_[k].name;
    if (user_traits::alive(map_, name))
      read_slot(k, i, name);
    else
      lose_keyframe(k);  // erased meanwhile: its slots may be no more
  }
  /// As recount(). O(views^2) of the flat list.
  void count_octaves(std::size_t p) const {
    const std::uint8_t read = points_[p].read;
    points_[p].read = 0;  // until all of it is
    const std::size_t n = lists_.of(p).size();
    for (std::size_t v = 0; v < n; ++v)
      octave_of(lists_.of(p)[v]);  // keypoints are read, and levels known, from here on
    for (std::size_t o = 0; o < levels_; ++o) counts_[p * levels_ + o] = 0;
    const span<const observation> list = lists_.of(p);
    for (std::size_t v = 0; v < n; ++v) {
      bool first = true;
      for (std::size_t u = 0; u < v; ++u) first = first && list[u].keyframe != list[v].keyframe;
      if (!first) continue;
      int finest = -1;
      for (std::size_t u = v; u < n; ++u) {
        if (list[u].keyframe != list[v].keyframe) continue;
        const int octave = octave_of(list[u]);
        if (octave >= 0 && (finest < 0 || octave < finest)) finest = octave;
      }
      if (finest >= 0) ++counts_[p * levels_ + static_cast<std::size_t>(finest)];
    }
    points_[p].read = read;
  }
  /// -1 where there is no such keypoint.
  int octave_of(const observation& o) const {
    if (o.keyframe == gone) return -1;
    const auto& all = keypoints(static_cast<std::size_t>(o.keyframe));
    return static_cast<std::size_t>(o.keypoint) < all.size() ? all[static_cast<std::size_t>(o.keypoint)].octave : -1;
  }
  /// As measurement_count(), of all keyframes but one.
  int measurements_without(std::size_t p, std::int32_t k) const {
    int count = 0;
    for (const observation& o : lists_.of(p)) {
      if (o.keyframe == k || o.keyframe == gone) continue;
      const auto& all = keypoints(static_cast<std::size_t>(o.keyframe));
      const auto i = static_cast<std::size_t>(o.keypoint);
      if (i < all.size()) count += all[i].u_right >= 0 ? 2 : 1;
    }
    return count;
  }
  /// Whether a point that was read is as the user's map has it; the order of observations does not count.
  bool is_current(std::size_t p) const {
    const user_point& name = names_[p];
    if (!user_traits::alive(map_, name)) return false;
    const auto& x = user_traits::position(map_, name);
    const vec3<double> now{x.x, x.y, x.z}, &then = positions_[p];
    if (!(now.x == then.x && now.y == then.y && now.z == then.z)) return false;
    const user_keyframe reference = user_traits::reference(map_, name);
    if (!(this->name(points_[p].reference) == reference || points_[p].reference == number(reference))) return false;
    std::size_t views = 0;
    bool same = true;
    user_traits::for_each_observation(map_, name, [&](const user_keyframe& observer, std::size_t keypoint) {
      ++views;
      bool found = false;
      for (const observation& o : lists_.of(p))
        found = found || (static_cast<std::size_t>(o.keypoint) == keypoint &&
                          keyframes_[static_cast<std::size_t>(o.keyframe)].name == observer);
      same = same && found;
    });
    return same && views == lists_.of(p).size();
  }

  static constexpr auto elements = static_cast<std::size_t>(descriptor::elements);

  Map& map_;
  // Mutable: a read of what is not here yet fills it in.
  mutable plain_detail::place_list keyframe_places_, point_places_;
  mutable id_numbers keyframe_numbers_, point_numbers_;
  mutable std::vector<keyframe_entry> keyframes_;
  mutable list_of<user_point> names_;  ///< of points
  mutable plain_vector<point_entry> points_;
  mutable plain_vector<vec3<double>> positions_;
  mutable plain_vector<vec3<float>> normals_;
  mutable plain_vector<range> ranges_;
  mutable plain_vector<point_covariance> covariances_;  ///< where the user's map keeps them
  mutable plain_vector<element> descriptors_;
  mutable plain_vector<std::uint32_t> counts_;  ///< [point][octave]: observers, as observation_counts.hpp says
  mutable std::size_t levels_ = 8;              ///< grows
  mutable observation_pool lists_;
  mutable plain_vector<observation> scratch_, old_;
  mutable plain_vector<std::int32_t> merged_;  ///< places of dead points, free from the next keyframe on
  std::size_t next_point_ = 0, next_keyframe_ = 0;

  std::mutex mutex_;  ///< of what others report
  list_of<user_point> changed_points_;
  list_of<user_keyframe> changed_keyframes_;
  bool all_changed_ = false;
};

TURBOMAP_END_NAMESPACE

#include "map_mirror_traits.hpp"
