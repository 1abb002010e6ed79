// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Which neighbours a keyframe is searched against does not depend on what its poses are poses of: the camera, or a body that carries it.

#include <turbomap/camera/pinhole.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>
#include <turbomap/mapping/neighbour_search.hpp>

#include <cstddef>
#include <cstdint>
#include <vector>

#include <doctest/doctest.h>

namespace {

using orb = turbomap::binary_descriptor<256>;
using camera = turbomap::pinhole<float>;
using map_type = turbomap::simple_map<orb, camera>;

/// One camera looks at a wall of 30 points, 4 m away, from two places.
class two_views {
 public:
  /// \param T_camera_body  how it is mounted   \param baseline  m, of the two places
  two_views(const turbomap::rigid_transform<double>& T_camera_body, double baseline) : search_(ctx_) {
    rig_.cameras[0].T_camera_body = T_camera_body;
    const auto a = add(0), b = add(baseline);
    for (std::size_t c = 0; c < 30; ++c) {
      const auto p =
          map_.add_point({0.4 * (static_cast<double>(c % 10) - 4.5), 0.3 * static_cast<double>(c / 10), 4}, a);
      turbomap::observe(map_, p, a, c), turbomap::observe(map_, p, b, c);
    }
    search_.snapshot({ctx_, map_, store_, stored_, held_}, b, {}, [](std::size_t n) { return n; });
  }
  std::size_t neighbours() const { return search_.neighbour_count(); }

 private:
  using policy = turbomap::context<>::policy_type;

  turbomap::map_keyframe_id add(double x) {
    const std::vector<turbomap::keypoint> keypoints(30);
    const std::vector<std::uint8_t> descriptors(30 * orb::bytes);
    turbomap::rigid_transform<double> T_cw;
    T_cw.tx = -x;
    const auto T_bc = turbomap::inverse(turbomap::to_isometry<double>(rig_.cameras[0].T_camera_body));
    const auto T_bw = turbomap::to_rigid_transform(T_bc * turbomap::to_isometry<double>(T_cw));
    last_ = map_.add_keyframe(keypoints, T_bw, x, last_);
    stored_.add(turbomap::map_traits<map_type>::id(map_, last_),
                store_.insert({30, keypoints.data(), descriptors.data(), rig_.cameras, 1, {0, 0, 640, 480}}));
    return last_;
  }

  turbomap::context<> ctx_;
  map_type map_;
  turbomap::keyframe_store<orb, camera> store_;
  turbomap::handle_table stored_;
  turbomap::guard_times held_;
  decltype(turbomap::make_mono_rig(camera{})) rig_ = turbomap::make_mono_rig(camera{400, 400, 320, 240});
  turbomap::map_keyframe_id last_;
  turbomap::neighbour_search<map_type, policy> search_;
};

TEST_CASE("one camera, whose poses are its own, or those of a vehicle with x forward and z up") {
  turbomap::rigid_transform<double> vehicle;
  vehicle.qx = 0.5, vehicle.qy = -0.5, vehicle.qz = 0.5, vehicle.qw = 0.5;
  turbomap::rigid_transform<double> upside_down;
  upside_down.qx = 1, upside_down.qw = 0, upside_down.ty = 0.3, upside_down.tz = -9;  // 9 m in front of its camera
  for (const auto& mounted : {turbomap::rigid_transform<double>{}, vehicle, upside_down}) {
    CAPTURE(mounted.qx);
    CHECK(two_views(mounted, 0.4).neighbours() == 1);
    CHECK(two_views(mounted, 0.02).neighbours() == 0);  // 0.005 of the depth
  }
}

}  // namespace
