// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What the fuzz targets of whole mappers share: a small world, options, and edits by others, drawn once and applied to
/// one map or to several.

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "hostile.hpp"
#include "scenes/mapping_scene.hpp"

namespace turbomap_fuzz {

/// Few landmarks: a mapper is asked the same of ten keypoints as of a thousand, and answers more often.
inline turbomap_test::mapping_recipe draw_recipe(choices& c) {
  turbomap_test::mapping_recipe r;
  r.seed = c.byte(), r.per_metre = 1 + static_cast<int>(c.below(3)), r.clutter = static_cast<int>(c.below(6));
  r.pixel_noise = 0.5, r.noisy_bits = 10, r.twins = c.flag() ? 0.5 : 0, r.step = c.flag() ? 0.3 : 0;
  return r;
}
inline void draw_options(turbomap::local_mapper_options& o, choices& c) {
  o.creation.rule = c.flag() ? turbomap::creation_rule::tracks : turbomap::creation_rule::pairs;
  o.adjustment.solve.max_iterations = 2;
  o.adjustment.min_shared_points = o.neighbours.neighbourhood.min_shared_points = 2;
  o.keyframe_culling.redundant_share = c.flag() ? 0.9F : 0.3F;
  o.covariances = c.flag();
  if (c.flag()) o.fusion.mode = turbomap::fusion_mode::serial_exact;
  o.extra_rounds = c.byte() % 4 == 3 ? 1 : 0;
  const unsigned alike = c.byte();  // what only the cameras of one rig see
  static constexpr double ratios[] = {0.8, 0, 1, 0.3};
  o.creation.lookalike_ratio = ratios[alike % 4], o.creation.fewest_keyframes = alike / 4 % 4 == 3 ? 2 : 1;
}
inline turbomap::local_mapper_options draw_options(double baseline, choices& c) {
  auto o =
      baseline > 0 ? turbomap::local_mapper_options::stereo(baseline, 6) : turbomap::local_mapper_options::monocular();
  draw_options(o, c);
  return o;
}
inline turbomap::keyframe_store_options draw_store(choices& c) {
  turbomap::keyframe_store_options o;
  o.packing.grid_columns = 16, o.packing.grid_rows = 12;
  o.chunk_bytes = 1 << 15;
  if (c.flag()) o.byte_budget = 6 * o.chunk_bytes;
  return o;
}

/// What somebody else writes into the map.
struct map_edit {
  enum kind : unsigned { pose, position, merge, erase_point, erase_keyframe, move } what = move;
  turbomap::map_keyframe_id keyframe;
  turbomap::map_point_id point, other;
  turbomap::rigid_transform<double> T_cw;
  turbomap::vec3<double> x{};
  double shift = 0;
};

template <class Map>
std::vector<turbomap::map_keyframe_id> keyframes_of(const Map& map) {
  std::vector<turbomap::map_keyframe_id> all;
  turbomap::map_traits<Map>::for_each_keyframe(map, [&](turbomap::map_keyframe_id k) { all.push_back(k); });
  return all;
}

/// False: there is too little in the map to edit.
template <class Map>
bool draw_edit(const Map& map, choices& c, map_edit& e) {
  using traits = turbomap::map_traits<Map>;
  const auto keyframes = keyframes_of(map);
  std::vector<turbomap::map_point_id> points;
  traits::for_each_point(map, [&](turbomap::map_point_id p) { points.push_back(p); });
  if (keyframes.size() < 2 || points.empty()) return false;
  e.keyframe = keyframes[c.below(keyframes.size())];
  e.point = points[c.below(points.size())], e.other = points[c.below(points.size())];
  static constexpr map_edit::kind kinds[] = {map_edit::pose,  map_edit::position,    map_edit::position,
                                             map_edit::merge, map_edit::erase_point, map_edit::erase_keyframe,
                                             map_edit::move};
  e.what = kinds[c.byte() % std::size(kinds)];
  if (e.what == map_edit::pose) {
    const auto T = traits::pose(map, e.keyframe);
    e.T_cw = {T.qx, T.qy, T.qz, T.qw, T.tx, T.ty, T.tz};
    spoil(e.T_cw, c);
  }
  if (e.what == map_edit::position) e.x = c.vector(30);
  if (e.what == map_edit::move) e.shift = c.number(1);
  return true;
}

template <class Run>
void apply(const map_edit& e, Run& run) {
  using traits = typename Run::traits;
  std::vector<std::pair<turbomap::map_keyframe_id, std::size_t>> scratch;
  switch (e.what) {
    case map_edit::pose:
      run.map.set_pose(e.keyframe, e.T_cw);
      break;
    case map_edit::position:
      traits::set_position(run.map, e.point, e.x);
      break;
    case map_edit::merge:
      turbomap::merge_points(run.map, e.point, e.other, turbomap::merge_rule::drop, scratch);
      break;
    case map_edit::erase_point:
      turbomap::erase_point(run.map, e.point);
      break;
    case map_edit::erase_keyframe:
      run.mapper.remove(traits::id(run.map, e.keyframe));
      turbomap::erase_keyframe(run.map, e.keyframe);
      break;
    case map_edit::move:
      turbomap_test::move_all(run.map, e.shift);
  }
}

inline bool is_number(turbomap::map_fault f) {
  return f == turbomap::map_fault::bad_pose || f == turbomap::map_fault::position_not_finite;
}
/// Whether poses or positions of a map cannot be, as only an edit leaves them.
template <class Map>
bool is_spoilt(const Map& map) {
  for (const auto& v : turbomap::validate(map))
    if (is_number(v.fault)) return true;
  return false;
}
/// After a call of the mapper. \param spoilt  an edit has written numbers that cannot be
template <class Run>
void expect_sound(Run& run, bool spoilt) {
  for (const auto& v : turbomap::validate(run.map))
    expect(spoilt && is_number(v.fault), "the map is sound but for numbers that an edit wrote");
  expect(run.store.statistics().pinned_sets == 0, "nothing stays pinned");
}

/// Runs of one scene in which the mapper works on the map itself, and on a mirror of it. They are told the same, so
/// their maps are the same to the last bit.
template <class First, class Second>
class twin_runs {
 public:
  template <class Scene>
  twin_runs(const Scene& scene, const turbomap::local_mapper_options& options,
            const turbomap::keyframe_store_options& store)
      : first(scene, options, {}, {}, store), second(scene, options, {}, {}, store) {}

  void edit(choices& c) {
    map_edit e;
    if (!draw_edit(first.map, c, e)) return;
    apply(e, first), apply(e, second);
    if (c.flag() && e.what == map_edit::pose)
      second.mapper.changed(e.keyframe);
    else if (c.flag() && e.what == map_edit::position)
      second.mapper.changed(e.point);
    else
      second.mapper.refresh();
    spoilt = spoilt || is_spoilt(first.map);
  }
  /// The same call of both mappers.
  template <class Call>
  void both(Call call) {
    const bool done = allowed([&] { call(first); });
    expect(allowed([&] { call(second); }) == done, "what the one mapper refuses, the other refuses");
    expect_sound(first, spoilt), expect_sound(second, spoilt);
  }

  First first;
  Second second;
  bool spoilt = false;
};

}  // namespace turbomap_fuzz
