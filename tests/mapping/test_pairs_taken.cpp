// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Points of pairs when somebody takes a keypoint between search and commit: a later pair, which an earlier one had left without
/// a keypoint, does not come in its place.

#include <turbomap/camera/pinhole.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>
#include <turbomap/mapping/map_point_creation.hpp>

#include <cstdint>
#include <random>
#include <vector>

#include <doctest/doctest.h>

namespace {

using orb = turbomap::binary_descriptor<256>;
using camera = turbomap::pinhole<float>;
using map_type = turbomap::simple_map<orb, camera>;

constexpr int corners = 30, known = 15, bytes = 32;

/// Two keyframes side by side see corners on a wall, the first of which have points. The query has each of the others twice, so
/// two pairs ask for one keypoint of the neighbour.
class corners_seen_twice {
 public:
  corners_seen_twice() : search_(ctx_), creation_(ctx_) {
    std::mt19937 random(7);
    for (auto& d : descriptors_) d = static_cast<std::uint8_t>(random());
    const auto neighbour = add(0, corners);
    query_ = add(0.4, 2 * corners - known);
    for (std::size_t c = 0; c < known; ++c) {
      const auto point = map_.add_point({x_of(static_cast<int>(c)), y_of(static_cast<int>(c)), 4}, neighbour);
      turbomap::observe(map_, point, neighbour, c);
      turbomap::observe(map_, point, query_, c);
    }
  }
  void compute() {
    search_.snapshot(scope(), query_, {}, [](std::size_t n) { return n; });
    search_.compute(scope(), {});
    turbomap::creation_options options;
    options.rule = turbomap::creation_rule::pairs;
    creation_.compute(scope(), search_, options, {});
  }
  /// \returns how many points are new
  std::size_t commit() {
    const std::size_t before = map_.point_count();
    creation_.commit(scope(), search_);
    return map_.point_count() - before;
  }
  std::size_t matches() const { return creation_.matches(); }
  /// Tracking makes a point of a keypoint of the query.
  void take(int keypoint) {
    turbomap::observe(map_, map_.add_point({0, 0, 5}, query_), query_, static_cast<std::size_t>(keypoint));
  }
  bool has_point(int keypoint) const {
    using traits = turbomap::map_traits<map_type>;
    return !(traits::point_at(map_, query_, static_cast<std::size_t>(keypoint)) == traits::point{});
  }

 private:
  using policy = turbomap::context<>::policy_type;

  static double x_of(int corner) { return 0.5 * (corner % 6 - 2.5); }
  static double y_of(int corner) { return 0.5 * (corner / 6 - 2); }
  turbomap::mapping_scope<map_type, policy> scope() { return {ctx_, map_, store_, stored_, held_}; }

  turbomap::map_keyframe_id add(double x, int count) {
    std::vector<turbomap::keypoint> keypoints(static_cast<std::size_t>(count));
    std::vector<std::uint8_t> descriptors;
    for (int i = 0; i < count; ++i) {
      const int c = i < corners ? i : i - corners + known;
      keypoints[static_cast<std::size_t>(i)].x = static_cast<float>(320 + 100 * (x_of(c) - x));
      keypoints[static_cast<std::size_t>(i)].y = static_cast<float>(240 + 100 * y_of(c));
      descriptors.insert(descriptors.end(), descriptors_.begin() + c * bytes, descriptors_.begin() + (c + 1) * bytes);
    }
    turbomap::rigid_transform<double> T_cw;
    T_cw.tx = -x;
    const auto id = map_.add_keyframe(keypoints, T_cw, x, query_);
    stored_.add(turbomap::map_traits<map_type>::id(map_, id),
                store_.insert({count, keypoints.data(), descriptors.data(), rig_.cameras, 1, {0, 0, 640, 480}}));
    return query_ = id;
  }

  turbomap::context<> ctx_;
  map_type map_;
  turbomap::keyframe_store<orb, camera> store_;
  turbomap::handle_table stored_;
  turbomap::guard_times held_;
  const decltype(turbomap::make_mono_rig(camera{})) rig_ = turbomap::make_mono_rig(camera{400, 400, 320, 240});
  std::vector<std::uint8_t> descriptors_ = std::vector<std::uint8_t>(corners * bytes);
  turbomap::map_keyframe_id query_;
  turbomap::neighbour_search<map_type, policy> search_;
  turbomap::map_point_creation<map_type, policy> creation_;
};

}  // namespace

TEST_CASE("of pairs that ask for one keypoint the first makes a point") {
  corners_seen_twice scene;
  for (const std::size_t expected : {corners - known, 0}) {  // the second time all keypoints of the neighbour are taken
    scene.compute();
    CHECK(scene.matches() == 2 * expected);
    CHECK(scene.commit() == expected);
  }
  for (int i = known; i < corners; ++i) {
    CHECK(scene.has_point(i));
    CHECK_FALSE(scene.has_point(i + corners - known));
  }
}

TEST_CASE("a later pair does not step in where an earlier one loses its keypoint") {
  corners_seen_twice scene;
  scene.compute();
  scene.take(known + 2);
  CHECK(scene.commit() == corners - known - 1);
  CHECK_FALSE(scene.has_point(corners + 2));
  scene.compute();  // the next search finds it
  CHECK(scene.commit() == 1);
  CHECK(scene.has_point(corners + 2));
}
