// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Why points had to be merged: of each merge, who made the younger of its two points, and, where mapping did, whether the
/// search that it was made of could have known the older one.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/map/map_traits.hpp>
#include <turbomap/mapping/mapping_report.hpp>

namespace turbomap_replay {

/// Merges by their cause.
struct merge_counts {
  std::size_t by_tracking = 0;     ///< tracking made both points
  std::size_t beside_mapping = 0;  ///< tracking made the younger, mapping the older
  // Mapping made the younger point, and the older one ...
  std::size_t same_call = 0;   ///< comes from the same call: their matches were not joined
  std::size_t seen_apart = 0;  ///< was seen, in an image that shows both, at two keypoints: one corner detected twice
  /// ... was seen in images of the call that do not show the younger: mapped keypoints are not matched
  std::size_t at_mapped = 0;
  std::size_t out_of_reach = 0;  ///< was seen in no image that the call searched

  std::size_t all() const { return by_tracking + beside_mapping + same_call + seen_apart + at_mapped + out_of_reach; }
  nlohmann::json json() const {
    return {{"merges", all()},
            {"by_tracking", by_tracking},
            {"beside_mapping", beside_mapping},
            {"same_call", same_call},
            {"seen_apart", seen_apart},
            {"at_mapped", at_mapped},
            {"out_of_reach", out_of_reach}};
  }
};

/// Listens to the stages of a mapper. O(points + observations) per keyframe.
template <class Map>
class merge_causes {
 public:
  using traits = turbomap::map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;

  /// Before the mapper sees a keyframe: points that are new are tracking's.
  void begin(const Map& map) { note_births(map, true); }
  /// After each stage. \param searched  the query and its neighbours
  template <class Keyframes>
  void stage_done(const Map& map, turbomap::mapping_stage stage, const Keyframes& searched) {
    if (stage == turbomap::mapping_stage::creation) {
      calls_.push_back(images_of(map, searched));
      note_births(map, false);
      remember(map);
    }
    if (stage == turbomap::mapping_stage::fusion) {
      count_merges(map);
      remember(map);  // it may be repeated
    }
  }
  const merge_counts& counts() const { return counts_; }

 private:
  struct birth {
    std::size_t order;
    std::int32_t call;  ///< negative: tracking
  };
  struct image {
    std::uint64_t keyframe;
    int camera;
    bool operator==(const image& o) const { return keyframe == o.keyframe && camera == o.camera; }
  };
  using images = std::unordered_map<std::uint64_t, std::vector<image>>;  ///< by point: those of a call that show it

  void note_births(const Map& map, bool tracking) {
    const std::int32_t call = tracking ? -1 : static_cast<std::int32_t>(calls_.size()) - 1;
    traits::for_each_point(map, [&](const point& p) {
      births_.insert({traits::id(map, p), birth{births_.size(), call}});
    });
  }
  void remember(const Map& map) {
    live_.clear();
    traits::for_each_point(map, [&](const point& p) { live_.push_back(p); });
  }
  template <class Keyframes>
  static images images_of(const Map& map, const Keyframes& searched) {
    images found;
    for (const keyframe& k : searched)
      for (std::size_t i = 0; i < traits::keypoint_count(map, k); ++i) {
        const point p = traits::point_at(map, k, i);
        if (!(p == point{}))
          found[traits::id(map, p)].push_back({traits::id(map, k), traits::keypoint(map, k, i).camera});
      }
    return found;
  }
  /// The images of a call that show a point, or one that became it.
  std::vector<image> shown(const images& call, std::uint64_t id) const {
    std::vector<image> all;
    const auto add = [&](std::uint64_t member) {
      const auto at = call.find(member);
      if (at != call.end()) all.insert(all.end(), at->second.begin(), at->second.end());
    };
    add(id);
    const auto family = absorbed_.find(id);
    if (family != absorbed_.end())
      for (const std::uint64_t member : family->second) add(member);
    return all;
  }
  void count_merges(const Map& map) {
    for (const point& p : live_) {
      if (traits::alive(map, p)) continue;
      const point into = traits::replacement(map, p);
      if (into == point{}) continue;
      const std::uint64_t a = traits::id(map, p), b = traits::id(map, into);
      count(a, b);
      auto& family = absorbed_[b];
      family.push_back(a);
      const auto own = absorbed_.find(a);
      if (own != absorbed_.end()) {
        const std::vector<std::uint64_t> inherited = own->second;
        auto& grown = absorbed_[b];
        grown.insert(grown.end(), inherited.begin(), inherited.end());
      }
    }
  }
  void count(std::uint64_t a, std::uint64_t b) {
    const bool a_is_younger = births_.at(a).order > births_.at(b).order;
    const std::uint64_t younger = a_is_younger ? a : b, older = a_is_younger ? b : a;
    const std::int32_t call = births_.at(younger).call, before = births_.at(older).call;
    if (call < 0) {
      ++(before < 0 ? counts_.by_tracking : counts_.beside_mapping);
      return;
    }
    if (call == before) {
      ++counts_.same_call;
      return;
    }
    const images& searched = calls_[static_cast<std::size_t>(call)];
    const auto of_older = shown(searched, older), of_younger = shown(searched, younger);
    const bool both = std::any_of(of_older.begin(), of_older.end(), [&](const image& i) {
      return std::find(of_younger.begin(), of_younger.end(), i) != of_younger.end();
    });
    ++(both ? counts_.seen_apart : of_older.empty() ? counts_.out_of_reach : counts_.at_mapped);
  }

  merge_counts counts_;
  std::unordered_map<std::uint64_t, birth> births_;                         ///< by the id of a point
  std::unordered_map<std::uint64_t, std::vector<std::uint64_t>> absorbed_;  ///< by the id of a survivor
  std::vector<images> calls_;
  std::vector<point> live_;  ///< before fusion
};

}  // namespace turbomap_replay
