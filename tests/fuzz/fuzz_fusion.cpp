// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Duplicate fusion around a keyframe of a small map, in one pass or camera by camera (serial_exact), under every merge rule: the
// map that the sequential oracle makes. Or with poses and positions that cannot be, where the map stays sound.

#include <thrust/execution_policy.h>

#include <vector>

#include <turbomap/mapping/duplicate_fusion.hpp>

#include "mapper_world.hpp"
#include "scenes/oracle_world.hpp"

using namespace turbomap_fuzz;

namespace {

using policy = std::decay_t<decltype(thrust::seq)>;
using turbomap_test::oracle_id;

template <class Camera>
class world {
  using map_type = turbomap_test::mapped<Camera>;
  using traits = turbomap::map_traits<map_type>;
  using run_type = turbomap_test::mapping_run<map_type, policy>;
  using keyframes = turbomap::span<const turbomap::map_keyframe_id>;

 public:
  world(const turbomap_test::test_rig<Camera>& rig, choices& c)
      : scene_(rig, recipe(c)), run_(scene_, turbomap_test::unfused(scene_.recipe().scales), {}, policy(), store(c)) {
    run_.steps(3 + static_cast<int>(c.below(4)));
  }

  void fuse(choices& c) {
    query_ = run_.keyframes()[c.below(run_.keyframes().size())];
    targets_.clear();
    for (const auto k : run_.keyframes())
      if (k != query_ && c.byte() % 4 != 0) targets_.push_back(k);
    turbomap::fusion_options o;
    o.mode = c.flag() ? turbomap::fusion_mode::serial_exact : turbomap::fusion_mode::snapshot;
    o.commit.merges = static_cast<turbomap::merge_rule>(c.below(3));
    o.commit.entries_per_guard = static_cast<int>(c.below(4));
    o.search.scales = scene_.recipe().scales;
    if (c.flag()) {
      as_the_oracle(o);
    } else {
      for (unsigned n = c.byte() % 6; n > 0; --n) edit(c);
      o.covariances = c.flag();
      stays_sound(o);
    }
  }

 private:
  static turbomap_test::mapping_recipe recipe(choices& c) {
    auto r = draw_recipe(c);
    r.noisy_bits = 30, r.lost = 0.6, r.fresh = 0.6, r.step = c.flag() ? 0.4 : 0.2;
    return r;
  }
  /// The oracle's keyframes are packed as by default.
  static turbomap::keyframe_store_options store(choices& c) {
    auto o = draw_store(c);
    o.packing = {};
    return o;
  }
  void edit(choices& c) {
    map_edit e;
    if (draw_edit(run_.map, c, e) && e.what != map_edit::erase_keyframe) apply(e, run_);
  }
  turbomap::fusion_summary both_ways(const turbomap::fusion_options& o) {
    turbomap::duplicate_fusion<map_type, policy> fusion(run_.ctx);
    turbomap::guard_times held;
    auto scope = run_.scope(held);
    fusion.begin();
    auto s = fusion.forward(scope, query_, keyframes(targets_), o);
    s += fusion.backward(scope, query_, keyframes(targets_), o);
    turbomap::appearance_update<map_type, policy> update(run_.ctx);
    turbomap::appearance_options appearance;
    appearance.scales = scene_.recipe().scales;
    update(scope, fusion.touched(), appearance);
    return s;
  }

  void as_the_oracle(const turbomap::fusion_options& o) {
    turbomap_test::oracle_world<Camera> world(scene_, run_);
    auto& oracle = world.oracle;
    std::vector<oracle_id> targets;
    for (const auto k : targets_) targets.push_back(traits::id(run_.map, k));
    const oracle_id query = traits::id(run_.map, query_);
    const turbomap_test::oracle_merge_rule rule{o.commit.merges == turbomap::merge_rule::drop,
                                                o.commit.merges == turbomap::merge_rule::refuse_apart};
    const bool serial = o.mode == turbomap::fusion_mode::serial_exact;
    oracle.pass({query}, targets, serial, o.search, rule);
    oracle.pass(targets, {query}, serial, o.search, rule);
    oracle.refresh(oracle.touched, scene_.recipe().scales);
    const auto s = both_ways(o);
    if (oracle.close_calls > 0) return;  // rounding may decide them otherwise
    const auto& n = oracle.counts;
    expect(s.entries == n.entries && s.observations_added == n.observations_added && s.merged == n.merged &&
               s.already_observed == n.already_observed && s.conflicts == n.conflicts && s.stale == n.stale,
           "the counts are those of the oracle");
    std::size_t points = 0;
    traits::for_each_point(run_.map, [&](turbomap::map_point_id p) {
      ++points;
      const auto found = oracle.appearance.find(traits::id(run_.map, p));
      expect(found != oracle.appearance.end(), "a point is one of the oracle");
      for (int e = 0; e < traits::descriptor::elements; ++e)
        expect(traits::descriptor_data(run_.map, p)[e] == found->second.descriptor[static_cast<std::size_t>(e)],
               "descriptors are those of the oracle");
    });
    expect(points == oracle.map.points.size(), "there are as many points as in the oracle");
    traits::for_each_keyframe(run_.map, [&](turbomap::map_keyframe_id k) {
      for (std::size_t i = 0; i < traits::keypoint_count(run_.map, k); ++i) {
        const auto p = traits::point_at(run_.map, k, i);
        const auto expected = oracle.map.point_at({traits::id(run_.map, k), i});
        const bool there = p != turbomap::map_point_id{};
        expect(there == expected.has_value() && (!there || traits::id(run_.map, p) == *expected),
               "slots are those of the oracle");
      }
    });
    expect(turbomap::validate(run_.map).empty(), "the map is sound");
  }

  void stays_sound(const turbomap::fusion_options& o) {
    const bool spoilt = is_spoilt(run_.map);
    const std::size_t points = run_.map.point_count();
    turbomap::fusion_summary s;
    const bool done = allowed([&] { s = both_ways(o); });
    expect_sound(run_, spoilt);
    expect(done || spoilt, "a map of numbers is not refused");
    if (!done) return;
    expect(run_.map.point_count() + s.merged == points, "a merge leaves one point of two");
    expect(s.entries == s.merged + s.observations_added + s.stale + s.already_observed + s.conflicts,
           "all that was found is accounted for");
  }

  turbomap_test::mapping_scene<Camera> scene_;
  run_type run_;
  turbomap::map_keyframe_id query_;
  std::vector<turbomap::map_keyframe_id> targets_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  if (c.flag())
    world<turbomap_test::pinhole_camera>(turbomap_test::pinhole_rig(50), c).fuse(c);
  else
    world<turbomap_test::fisheye_camera>(turbomap_test::fisheye_rig(2), c).fuse(c);
  return 0;
}
