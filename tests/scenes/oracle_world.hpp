// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Maps of a mapping_scene in which duplicates are left, and the copy of such a map that the oracle of fusion works on.

#include <cstddef>
#include <deque>

#include "mapping_scene.hpp"
#include "reference/serial_fusion_oracle.hpp"

namespace turbomap_test {

using mapped_descriptor = turbomap::binary_descriptor<256>;
template <class Camera>
using mapped = turbomap::simple_map<mapped_descriptor, Camera>;

/// Local mapping without fusion: most landmarks have several points.
inline turbomap::local_mapper_options unfused(const turbomap::pyramid& scales) {
  auto options = turbomap::local_mapper_options::stereo(0.1, 6, scales);
  options.enabled[turbomap::mapping_stage::fusion] = false;
  options.enabled[turbomap::mapping_stage::keyframe_culling] = false;
  return options;
}

/// The oracle's copy of a map, and keyframes packed for it.
template <class Camera>
struct oracle_world {
  serial_fusion_oracle<mapped_descriptor, Camera> oracle;
  std::deque<turbomap::array<std::byte, turbomap::host_memory>> blocks;

  template <class Run>
  oracle_world(const mapping_scene<Camera>& scene, const Run& run) {
    using traits = turbomap::map_traits<mapped<Camera>>;
    const auto& map = run.map;
    turbomap::keyframe_packing_scratch scratch;
    traits::for_each_keyframe(map, [&](turbomap::map_keyframe_id k) {
      const auto id = traits::id(map, k);
      const auto& view = run.view(static_cast<std::size_t>(id));
      const auto data = scene.template data<mapped_descriptor>(view);
      const auto layout = turbomap::plan_packing(data, {}, scratch);
      blocks.emplace_back();
      blocks.back().resize_discard(layout.bytes);
      turbomap::pack_keyframe(data, layout, scratch, blocks.back().data());
      oracle.keyframes[id] = {
          turbomap::view_at<mapped_descriptor, Camera>(layout, blocks.back().data()), view.T_cw, {}};
      oracle.map.keyframes[id] = {view.keypoints, 0};
    });
    traits::for_each_point(map, [&](turbomap::map_point_id p) {
      const auto id = traits::id(map, p);
      oracle.map.points[id] = {traits::id(map, traits::reference(map, p)), {}};
      const auto* d = traits::descriptor_data(map, p);
      oracle.appearance[id] = {traits::position(map, p),
                               traits::normal(map, p),
                               traits::min_distance(map, p),
                               traits::max_distance(map, p),
                               {d, d + mapped_descriptor::elements}};
    });
    traits::for_each_point(map, [&](turbomap::map_point_id p) {
      traits::for_each_observation(map, p, [&](turbomap::map_keyframe_id k, std::size_t i) {
        oracle.map.observe(traits::id(map, p), {traits::id(map, k), i});
      });
    });
  }
};

}  // namespace turbomap_test
