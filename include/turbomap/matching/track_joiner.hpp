// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// From matches to tracks, on the host: the connected components of keypoints, found by union-find. Each component notes the
/// cameras that it has a keypoint of, so that no camera gets a second one.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "../claim.hpp"
#include "../config.hpp"
#include "../error.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "search_options.hpp"

namespace turbomap {

/// One keypoint of a track.
struct track_view {
  std::int32_t keyframe;  ///< 0: the query; 1 + n: neighbour n
  std::int32_t camera;    ///< of the keyframe's rig
  std::int32_t keypoint;  ///< keypoint index, within the keyframe
};

/// What became of a match.
enum class match_outcome : std::uint8_t {
  joined,      ///< both keypoints are in one track
  contradicts  ///< left out: a camera of a keyframe would have two keypoints in one track
};

/// Tracks of two views or more as plain arrays, in the order of their smallest query keypoint.
struct track_list {
  plain_vector<std::int32_t> offsets;    ///< of each track's views; one more than there are tracks
  plain_vector<track_view> views;        ///< of a track by (keyframe, camera): the query's first
  plain_vector<match_outcome> outcomes;  ///< of each match

  /// Number of tracks.
  std::size_t size() const { return offsets.empty() ? 0 : offsets.size() - 1; }
};

/// The cameras that the keypoints of a match are of.
struct match_cameras {
  std::uint8_t query;      ///< of the query's rig
  std::uint8_t neighbour;  ///< of the neighbour's rig
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// See join_tracks(). Make one and use it for every call: its memory is reused.
class track_joiner {
 public:
  /// \param matches        a list of correspondences in (neighbour, query keypoint) order, at most one for each of these
  /// \param cameras        of each match; empty: one camera each
  /// \param own_neighbour  the number under which the query is its own neighbour; -1: it is not
  /// \throws std::invalid_argument  an index that is negative, cameras that are not as many as the matches
  template <class Matches>
  void operator()(const Matches& matches, span<const match_cameras> cameras, std::int32_t own_neighbour,
                  track_list& result) {
    require(cameras.empty() || cameras.size() == matches.size(), "cameras.size()", cameras.size(),
            "must be that of the matches, or 0");
    number_keypoints(matches, cameras, own_neighbour);
    sort_edges(matches);
    result.outcomes.assign(matches.size(), match_outcome::joined);
    for (const std::uint32_t i : order_)
      if (!unite(edges_[i].a, edges_[i].b)) result.outcomes[i] = match_outcome::contradicts;
    list_tracks(result);
  }

 private:
  static constexpr std::int32_t none = -1;
  struct edge {
    std::int32_t a, b;  ///< nodes
  };

  /// Gives each keypoint of a match a node.
  template <class Matches>
  void number_keypoints(const Matches& matches, span<const match_cameras> cameras, std::int32_t own_neighbour) {
    const auto keyframe_of = [own_neighbour](std::int32_t n) { return n == own_neighbour ? 0 : 1 + n; };
    std::int32_t rig = 1;
    keyframes_.assign(1, 0);
    for (std::size_t i = 0; i < matches.size(); ++i) {
      const auto& m = matches[i];
      require(m.neighbour >= 0, "matches[].neighbour", m.neighbour, "must not be negative");
      require(m.query >= 0, "matches[].query", m.query, "must not be negative");
      require(m.candidate >= 0, "matches[].candidate", m.candidate, "must not be negative");
      const auto k = static_cast<std::size_t>(keyframe_of(m.neighbour));
      if (k >= keyframes_.size()) keyframes_.resize(k + 1, 0);
      keyframes_[0] = std::max(keyframes_[0], m.query + 1);
      keyframes_[k] = std::max(keyframes_[k], m.candidate + 1);
      if (!cameras.empty()) rig = std::max({rig, cameras[i].query + 1, cameras[i].neighbour + 1});
    }
    std::int32_t total = 0;  // from the number of keypoints to the first of each keyframe
    for (std::int32_t& k : keyframes_) total += std::exchange(k, total);
    words_ = (keyframes_.size() * static_cast<std::size_t>(rig) + 63) / 64;
    node_of_.assign(static_cast<std::size_t>(total), none);
    views_.clear(), parent_.clear(), sizes_.clear(), seen_.clear(), edges_.clear();
    for (std::size_t i = 0; i < matches.size(); ++i) {
      const auto& m = matches[i];
      const match_cameras c = cameras.empty() ? match_cameras{0, 0} : cameras[i];
      const std::int32_t a = node({0, c.query, m.query}, rig);
      edges_.push_back({a, node({keyframe_of(m.neighbour), c.neighbour, m.candidate}, rig)});
    }
  }
  std::int32_t node(const track_view& v, std::int32_t rig) {
    std::int32_t& node = node_of_[static_cast<std::size_t>(keyframes_[static_cast<std::size_t>(v.keyframe)]) +
                                  static_cast<std::size_t>(v.keypoint)];
    if (node != none) return node;
    node = static_cast<std::int32_t>(views_.size());
    views_.push_back(v);
    parent_.push_back(node);
    sizes_.push_back(1);
    const auto bit =
        static_cast<std::size_t>(v.keyframe) * static_cast<std::size_t>(rig) + static_cast<std::size_t>(v.camera);
    for (std::size_t w = 0; w < words_; ++w) seen_.push_back(w == bit / 64 ? std::uint64_t{1} << bit % 64 : 0);
    return node;
  }

  /// Edges by (distance, query keypoint, neighbour): counting sorts, the last key first. Neighbours are sorted already.
  template <class Matches>
  void sort_edges(const Matches& matches) {
    order_.resize(matches.size());
    for (std::size_t i = 0; i < order_.size(); ++i) order_[i] = static_cast<std::uint32_t>(i);
    std::uint32_t most = 0;
    for (const auto& m : matches) most = std::max(most, static_cast<std::uint32_t>(m.query));
    sort_by(most, [&](std::uint32_t i) { return static_cast<std::uint32_t>(matches[i].query); });
    if constexpr (sizeof(matches[0].distance) == 4) {
      std::uint32_t longest = 0;
      for (const auto& m : matches) longest = std::max(longest, ordered_bits(m.distance));
      sort_by(longest, [&](std::uint32_t i) { return ordered_bits(matches[i].distance); });
    } else {
      std::stable_sort(order_.begin(), order_.end(),
                       [&](std::uint32_t i, std::uint32_t j) { return matches[i].distance < matches[j].distance; });
    }
  }
  /// Stable, byte by byte. \param most  the greatest key
  template <class Key>
  void sort_by(std::uint32_t most, Key key) {
    for (int shift = 0; shift < 32 && most >> shift != 0; shift += 8) {
      std::uint32_t first[257] = {};
      for (const std::uint32_t i : order_) ++first[(key(i) >> shift & 255) + 1];
      for (int k = 0; k < 256; ++k) first[k + 1] += first[k];
      sorted_.resize(order_.size());
      for (const std::uint32_t i : order_) sorted_[first[key(i) >> shift & 255]++] = i;
      order_.swap(sorted_);
    }
  }

  std::int32_t root(std::int32_t node) {
    while (parent_[static_cast<std::size_t>(node)] != node) {
      std::int32_t& up = parent_[static_cast<std::size_t>(node)];
      up = parent_[static_cast<std::size_t>(up)];
      node = up;
    }
    return node;
  }
  /// False: a camera would have two keypoints.
  bool unite(std::int32_t a, std::int32_t b) {
    a = root(a), b = root(b);
    if (a == b) return true;
    if (sizes_[static_cast<std::size_t>(a)] < sizes_[static_cast<std::size_t>(b)]) std::swap(a, b);
    std::uint64_t* of_a = seen_.data() + static_cast<std::size_t>(a) * words_;
    const std::uint64_t* of_b = seen_.data() + static_cast<std::size_t>(b) * words_;
    for (std::size_t w = 0; w < words_; ++w)
      if ((of_a[w] & of_b[w]) != 0) return false;
    for (std::size_t w = 0; w < words_; ++w) of_a[w] |= of_b[w];
    parent_[static_cast<std::size_t>(b)] = a;
    sizes_[static_cast<std::size_t>(a)] += sizes_[static_cast<std::size_t>(b)];
    return true;
  }

  void list_tracks(track_list& result) {
    // Few keypoints have a node, and which cannot be predicted: these are listed first, by keyframe, then keypoint.
    listed_.resize(node_of_.size());
    std::size_t count = 0;
    for (const std::int32_t n : node_of_) {
      listed_[count] = n;
      count += n != none;
    }
    // Every match has a query keypoint, so each track of two views is met among those of the query.
    track_of_.assign(views_.size(), none);
    result.offsets.assign(1, 0);
    for (std::size_t i = 0; i < count && views_[static_cast<std::size_t>(listed_[i])].keyframe == 0; ++i) {
      const auto r = static_cast<std::size_t>(root(listed_[i]));
      if (track_of_[r] != none || sizes_[r] < 2) continue;
      track_of_[r] = static_cast<std::int32_t>(result.offsets.size()) - 1;
      result.offsets.push_back(result.offsets.back() + sizes_[r]);
    }
    result.views.resize(static_cast<std::size_t>(result.offsets.back()));
    fill_.assign(result.offsets.begin(), result.offsets.end());
    for (std::size_t i = 0; i < count; ++i) {
      const std::int32_t n = listed_[i];
      const std::int32_t track = track_of_[static_cast<std::size_t>(root(n))];
      if (track == none) continue;
      const auto t = static_cast<std::size_t>(track), begin = static_cast<std::size_t>(result.offsets[t]);
      auto at = static_cast<std::size_t>(fill_[t]++);
      const track_view& v = views_[static_cast<std::size_t>(n)];
      for (; at > begin && result.views[at - 1].keyframe == v.keyframe && result.views[at - 1].camera > v.camera; --at)
        result.views[at] = result.views[at - 1];
      result.views[at] = v;
    }
  }

  plain_vector<std::int32_t> keyframes_;  ///< the first of each keyframe's keypoints in node_of_
  plain_vector<std::int32_t> node_of_;    ///< of each keypoint, or none
  // Of each node.
  plain_vector<track_view> views_;
  plain_vector<std::int32_t> parent_, sizes_;  ///< sizes_: of a root, the nodes of its component
  plain_vector<std::uint64_t> seen_;           ///< words_ each: of a root, the cameras that its component has
  plain_vector<std::int32_t> track_of_;        ///< of a root
  std::size_t words_ = 1;
  plain_vector<edge> edges_;
  plain_vector<std::uint32_t> order_, sorted_;
  plain_vector<std::int32_t> listed_, fill_;
};

TURBOMAP_END_NAMESPACE
