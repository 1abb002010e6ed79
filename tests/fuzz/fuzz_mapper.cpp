// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Local mapping of a few keyframes, while others write whatever they like into the map: poses and positions that cannot be,
// merges, erased keyframes and points, a moved map. The map stays sound, and mapping goes on.

#include <utility>
#include <vector>

#include <thrust/execution_policy.h>

#include "hostile.hpp"
#include "scenes/mapping_scene.hpp"

using namespace turbomap_fuzz;

namespace {

using policy = std::decay_t<decltype(thrust::seq)>;

template <class Camera>
class world {
  using map_type = turbomap::simple_map<turbomap::binary_descriptor<256>, Camera>;
  using traits = turbomap::map_traits<map_type>;
  using run_type = turbomap_test::mapping_run<map_type, policy, turbomap::local_adjustment<map_type, policy>>;

 public:
  world(const turbomap_test::test_rig<Camera>& rig, double baseline, choices& c)
      : scene_(rig, recipe(c)), run_(scene_, options(baseline, c), {}, policy(), bounded(c)) {}

  void live(choices& c) {
    for (int n = 0; n < 7; ++n) {
      for (unsigned edits = c.byte() % 4; edits > 0 && n > 1; --edits) edit(c);
      for (const auto& v : turbomap::validate(run_.map)) spoilt_ = spoilt_ || is_number(v.fault);
      const bool done = allowed([&] { run_.mapper.process(run_.track()); });
      expect(done, "a good keyframe is mapped");
      if (n == 6 && c.flag()) allowed([&] { run_.mapper.adjust_globally(run_.keyframes().back(), {}); });
      for (const auto& v : turbomap::validate(run_.map))
        expect(spoilt_ && is_number(v.fault), "the map is sound but for numbers that an edit wrote");
      expect(run_.store.statistics().pinned_sets == 0, "nothing stays pinned");
    }
  }

 private:
  static bool is_number(turbomap::map_fault f) {
    return f == turbomap::map_fault::bad_pose || f == turbomap::map_fault::position_not_finite;
  }
  static turbomap_test::mapping_recipe recipe(choices& c) {
    turbomap_test::mapping_recipe r;
    r.seed = c.byte(), r.per_metre = 2 + static_cast<int>(c.below(3)), r.clutter = static_cast<int>(c.below(8));
    r.pixel_noise = 0.5, r.noisy_bits = 10, r.twins = c.flag() ? 0.5 : 0, r.step = c.flag() ? 0.3 : 0;
    return r;
  }
  static turbomap::local_mapper_options options(double baseline, choices& c) {
    auto o = baseline > 0 ? turbomap::local_mapper_options::stereo(baseline, 6)
                          : turbomap::local_mapper_options::monocular();
    o.creation.rule = c.flag() ? turbomap::creation_rule::tracks : turbomap::creation_rule::pairs;
    o.adjustment.solve.max_iterations = 2;
    o.adjustment.min_shared_points = o.neighbours.neighbourhood.min_shared_points = 2;
    o.keyframe_culling.redundant_share = c.flag() ? 0.9F : 0.3F;
    o.covariances = c.flag();
    return o;
  }
  static turbomap::keyframe_store_options bounded(choices& c) {
    turbomap::keyframe_store_options o;
    o.packing.grid_columns = 16, o.packing.grid_rows = 12;
    o.chunk_bytes = 1 << 15;
    if (c.flag()) o.byte_budget = 6 * o.chunk_bytes;
    return o;
  }
  void edit(choices& c) {
    std::vector<turbomap::map_keyframe_id> keyframes;
    std::vector<turbomap::map_point_id> points;
    traits::for_each_keyframe(run_.map, [&](turbomap::map_keyframe_id k) { keyframes.push_back(k); });
    traits::for_each_point(run_.map, [&](turbomap::map_point_id p) { points.push_back(p); });
    if (keyframes.size() < 2 || points.empty()) return;
    const auto k = keyframes[c.below(keyframes.size())];
    const auto p = points[c.below(points.size())], q = points[c.below(points.size())];
    switch (c.byte() % 7) {
      case 0: {
        auto T = traits::pose(run_.map, k);
        turbomap::rigid_transform<double> D{};
        D.qx = T.qx, D.qy = T.qy, D.qz = T.qz, D.qw = T.qw, D.tx = T.tx, D.ty = T.ty, D.tz = T.tz;
        spoil(D, c);
        run_.map.set_pose(k, D);
        break;
      }
      case 1:
      case 2:
        traits::set_position(run_.map, p, c.vector(30));
        break;
      case 3:
        turbomap::merge_points(run_.map, p, q, turbomap::merge_rule::drop, scratch_);
        break;
      case 4:
        turbomap::erase_point(run_.map, p);
        break;
      case 5:
        run_.mapper.remove(traits::id(run_.map, k));
        turbomap::erase_keyframe(run_.map, k);
        break;
      default:
        turbomap_test::move_all(run_.map, c.number(1));
    }
  }

  turbomap_test::mapping_scene<Camera> scene_;
  run_type run_;
  std::vector<std::pair<turbomap::map_keyframe_id, std::size_t>> scratch_;
  bool spoilt_ = false;  ///< edits have written poses or positions that cannot be
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  const unsigned rig = c.byte() % 3;
  if (rig == 0) world<turbomap_test::pinhole_camera>(turbomap_test::pinhole_rig(50), 0.11, c).live(c);
  if (rig == 1) world<turbomap_test::pinhole_camera>(turbomap_test::pinhole_rig(), 0, c).live(c);
  if (rig == 2) world<turbomap_test::fisheye_camera>(turbomap_test::fisheye_rig(2), 0.1, c).live(c);
  return 0;
}
