// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Local mapping of a few keyframes, by rigs of any models, while others write whatever they like into the map: poses
// and positions that cannot be, merges, erased keyframes and points, a moved map. The map stays sound, and mapping goes
// on. Then loop closing's calls.

#include <thrust/execution_policy.h>

#include "hostile_cameras.hpp"
#include "mapper_world.hpp"

using namespace turbomap_fuzz;

namespace {

using policy = std::decay_t<decltype(thrust::seq)>;

template <class Camera>
class world {
  using map_type = turbomap::simple_map<turbomap::binary_descriptor<256>, Camera>;
  using run_type = turbomap_test::mapping_run<map_type, policy, turbomap::local_adjustment<map_type, policy>>;

 public:
  world(const turbomap_test::test_rig<Camera>& rig, double baseline, choices& c)
      : scene_(rig, draw_recipe(c)), run_(scene_, draw_options(baseline, c), {}, policy(), draw_store(c)) {}

  void live(choices& c) {
    for (std::size_t n = 0, last = 3 + c.below(5); n < last; ++n) {
      for (unsigned edits = c.byte() % 4; edits > 0 && n > 1; --edits) edit(c);
      const bool done = allowed([&] { run_.mapper.process(run_.track()); });
      expect(done, "a good keyframe is mapped");
      expect_sound(run_, spoilt_);
    }
    const unsigned more = c.byte() % 4;
    if (more == 1) {
      allowed([&] { run_.mapper.adjust_globally(run_.keyframes().back(), {}); });
      expect_sound(run_, spoilt_);
    }
    if (more > 1) fuse_around(c);
  }

 private:
  void edit(choices& c) {
    map_edit e;
    if (!draw_edit(run_.map, c, e)) return;
    apply(e, run_);
    spoilt_ = spoilt_ || is_spoilt(run_.map);
  }
  /// A loop is closed: the map is moved, then keyframes look for duplicates.
  void fuse_around(choices& c) {
    turbomap_test::move_all(run_.map, 0.25);
    for (unsigned n = c.byte() % 4; n > 0; --n) edit(c);
    const auto keyframes = keyframes_of(run_.map);
    const auto k = keyframes[c.below(keyframes.size())];
    const std::size_t points = run_.map.point_count();
    turbomap::fusion_summary fused;
    const bool done = allowed([&] { fused = run_.mapper.fuse_around(k); });
    expect(done, "a keyframe that is in the map is fused with what is around it");
    expect(run_.map.point_count() + fused.merged == points, "a merge leaves one point of two");
    expect(fused.entries ==
               fused.merged + fused.observations_added + fused.stale + fused.already_observed + fused.conflicts,
           "all that was found is accounted for");
    expect_sound(run_, spoilt_);
  }

  turbomap_test::mapping_scene<Camera> scene_;
  run_type run_;
  bool spoilt_ = false;  ///< edits have written poses or positions that cannot be
};

/// One to three cameras, each of any model, as they are or with too much distortion.
void live_with_any(choices& c) {
  auto rig = draw_models(c);
  if (!bend(rig, c.flag() ? lens::bent : lens::real, c)) return;
  const bool metric = rig.cameras.size() > 1 || rig.cameras[0].bf > 0;
  world<any_model>(rig, metric ? 0.1 : 0, c).live(c);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  const unsigned rig = c.byte() % 4;
  if (rig == 0) world<turbomap_test::pinhole_camera>(turbomap_test::pinhole_rig(50), 0.11, c).live(c);
  if (rig == 1) world<turbomap_test::pinhole_camera>(turbomap_test::pinhole_rig(), 0, c).live(c);
  if (rig == 2) world<turbomap_test::fisheye_camera>(turbomap_test::fisheye_rig(2), 0.1, c).live(c);
  if (rig == 3) live_with_any(c);
  return 0;
}
