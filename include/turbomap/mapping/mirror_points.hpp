// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The points of a map_mirror, as they were last read, in flat arrays. Each has a place, a dense number that it keeps while it lives;
/// a table leads from the user's id to it. Nothing here asks the user's map.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "../map/read_ahead.hpp"
#include "../map/simple_map/map_ids.hpp"
#include "../map/simple_map/observation_pool.hpp"
#include "../plain_vector.hpp"
#include "../prefetch.hpp"
#include "../types.hpp"
#include "id_numbers.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Arrays by place. Place 0 stands for whatever is not alive.
template <class Map>
class mirror_points {
 public:
  /// @{
  /// Types of the user's map, as its traits name them.
  using user_point = typename map_traits<Map>::point;
  using descriptor = typename map_traits<Map>::descriptor;
  using element = typename descriptor::element;
  /// @}
  static constexpr std::int32_t gone = 0;                                           ///< the place of what is not alive
  static constexpr auto elements = static_cast<std::size_t>(descriptor::elements);  ///< of a descriptor
  /// Whether the user's map keeps how well its points are known.
  static constexpr bool has_covariances = detail::map_has_v<Map, detail::map_covariance_member>;

  /// What every stage asks for.
  struct entry {
    std::uint64_t id = 0;            ///< by the user's map
    map_keyframe_id reference = {};  ///< its reference keyframe
    map_point_id replacement = {};   ///< of a point that is not alive
    std::uint8_t read = 0;           ///< all of it is as it was last seen; 0: to be read anew
    bool described = false;          ///< the user's map has a descriptor of it
    std::int32_t measurements = -1;  ///< of its list, where that is known
  };
  /// Distances from which the point is to be recognised, m.
  struct range {
    float min = 0;  ///< the least
    float max = 0;  ///< the largest
  };

  /// None.
  mirror_points() { take(user_point{}, 0), places_.retire(gone); }

  /// Places that were ever taken, `gone` too.
  std::size_t size() const { return entries.size(); }
  /// Whether the place is named by a point that still has it.
  bool known(map_point_id p) const { return p.index > 0 && places_.known(p.index, p.generation); }
  /// Whether what has a place is alive.
  bool alive(std::int32_t place) const { return places_.alive(place); }
  /// Who has a place.
  map_point_id at(std::int32_t place) const { return {place, places_.generation(place)}; }
  /// The place of an id, perhaps of what is no longer alive; id_numbers::none: it has none.
  std::int32_t find(std::uint64_t id) const { return numbers_.find(id); }
  /// Asks memory for where an id is looked up.
  void prefetch_id(std::uint64_t id) const { numbers_.prefetch(id); }
  /// Asks memory for what tells whether a point is alive.
  void prefetch(std::int32_t place) const { places_.prefetch(place); }

  /// Room for so many more: as many calls of take() do not throw. Throws std::bad_alloc.
  void grow(std::size_t more = 1) {
    const std::size_t n = entries.size() + more;
    make_room(entries, n), make_room(names, n), make_room(positions, n), make_room(normals, n), make_room(ranges, n);
    if constexpr (has_covariances) make_room(covariances, n);
    make_room(descriptors, n * elements), make_room(counts_, n * levels_);
    make_room(merged_, n);
    places_.make_room(more);
    numbers_.make_room(more);
    lists.open(n - 1);
  }
  /// Makes room for more points and observations than a keyframe mostly brings, where little is left: large lists are then not
  /// moved under the guard of the user's map. Throws std::bad_alloc.
  void keep_room() {
    const std::size_t more = entries.size() / 8 + 256;
    grow(more);
    lists.make_room(4 * more);
  }
  /// grow(), and asks memory for the places that the first of them get.
  void expect(std::size_t more) {
    grow(more);
    for (std::size_t n = 0; n < detail::ahead_near && n < more; ++n) ask_for_upcoming(n);
  }
  /// A place for a point of which nothing is read yet. Throws std::bad_alloc, unchanged.
  std::int32_t take(const user_point& name, std::uint64_t id) {
    grow();
    ask_for_upcoming(detail::ahead_near);
    numbers_.prefetch(id + detail::ahead_near);  // most maps count
    const std::int32_t p = places_.take();       // the last step that may throw
    const auto i = static_cast<std::size_t>(p);
    if (i == entries.size()) {
      entries.push_back({}), names.push_back({});
      positions.push_back({}), normals.push_back({}), ranges.push_back({});
      if constexpr (has_covariances) covariances.push_back({});
      descriptors.resize(descriptors.size() + elements);
      counts_.resize(counts_.size() + levels_);
    }
    lists.close(i);
    entries[i] = {};
    entries[i].id = id;
    names[i] = name;
    for (std::size_t o = 0; o < levels_; ++o) counts(i)[o] = 0;
    if (!(name == user_point{})) numbers_.set(id, p);
    return p;
  }
  /// What has the place is no longer alive, and is called by its replacement until free_merged().
  void retire(std::size_t place, map_point_id replacement) {
    places_.retire(static_cast<std::int32_t>(place));
    entries[place].replacement = replacement;
    merged_.push_back(static_cast<std::int32_t>(place));
    entries[place].measurements = 0;
    lists.close(place);
  }
  /// Places that were retired may be taken again. Their ids are forgotten here, not when they are retired: the table is large, and
  /// many together wait less for memory.
  void free_merged() {
    constexpr std::size_t ahead = detail::ahead_near;
    for (std::size_t n = 0; n < merged_.size(); ++n) {
      if (n + ahead < merged_.size()) numbers_.prefetch(entries[static_cast<std::size_t>(merged_[n + ahead])].id);
      const std::int32_t p = merged_[n];
      numbers_.erase(entries[static_cast<std::size_t>(p)].id, p);
      names[static_cast<std::size_t>(p)] = user_point{};
      places_.give_back(p);
    }
    merged_.clear();
  }
  /// None, and no name is kept.
  void clear() {
    free_merged();
    for (std::size_t p = 1; p < entries.size(); ++p) {
      names[p] = user_point{};
      if (!places_.alive(static_cast<std::int32_t>(p))) continue;
      numbers_.erase(entries[p].id, static_cast<std::int32_t>(p));
      lists.close(p);
      places_.give_back(static_cast<std::int32_t>(p));
    }
  }

  /// Pyramid levels that are counted.
  std::size_t levels() const { return levels_; }
  /// [octave] observers of a point, as observation_counts.hpp says.
  std::uint32_t* counts(std::size_t place) { return counts_.data() + place * levels_; }
  /// Counts so many levels from now on, no fewer than before.
  void more_levels(std::size_t levels) {
    plain_vector<std::uint32_t> grown(entries.size() * levels);
    for (std::size_t p = 0; p < entries.size(); ++p)
      for (std::size_t o = 0; o < levels; ++o) grown[p * levels + o] = o < levels_ ? counts(p)[o] : 0;
    counts_.swap(grown);
    levels_ = levels;
  }

  /// @{
  /// [place] what was read.
  plain_vector<entry> entries;
  list_of<user_point> names;  ///< what the user calls it
  plain_vector<vec3<double>> positions;
  plain_vector<vec3<float>> normals;
  plain_vector<range> ranges;
  plain_vector<point_covariance> covariances;  ///< where the user's map keeps them
  plain_vector<element> descriptors;           ///< `elements` each
  observation_pool lists;                      ///< observations

  /// @}

 private:
  /// Asks memory for all that take() and whoever calls it write of a place: points that are new come many at a time.
  void ask_for_upcoming(std::size_t n) const {
    const std::size_t p = places_.upcoming(n);
    if (p >= entries.size()) return;  // new, behind the last one
    places_.prefetch(static_cast<std::int32_t>(p)), lists.prefetch_place(p);
    prefetch_line(&entries[p]), prefetch_line(&names[p]), prefetch_line(counts_.data() + p * levels_);
    prefetch_line(&positions[p]), prefetch_line(&normals[p]), prefetch_line(&ranges[p]);
    if constexpr (has_covariances) prefetch_line(&covariances[p]);
    prefetch_line(descriptors.data() + p * elements);
  }

  plain_detail::place_list places_;
  id_numbers numbers_;
  plain_vector<std::uint32_t> counts_;  ///< [place][octave]
  std::size_t levels_ = 8;              ///< grows
  plain_vector<std::int32_t> merged_;   ///< places that were retired
};

TURBOMAP_END_NAMESPACE
