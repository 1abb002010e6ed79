// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What all checks of recorded snapshots share: the keyframes of a recording in a store, and one snapshot's poses of
/// them.

#include <array>
#include <cstdio>
#include <vector>

#include <turbomap/context.hpp>
#include <turbomap/store/posed_keyframe.hpp>
#include "readers/recording_snapshot.hpp"

#include "recorded_keyframes.hpp"

namespace turbomap_replay {

/// All keyframes of a recording, inserted once.
template <class Camera, class Policy>
struct recorded_scene {
  using camera = Camera;
  using policy = Policy;
  using store_type = turbomap::keyframe_store<orb, Camera, turbomap::memory_of_t<Policy>>;

  recorded_scene(const turbomap::recording& recorded, const Policy& execution)
      : recording(recorded),
        rig(recorded_rig<Camera>(recorded.meta)),
        ctx(execution),
        store(recorded_store_options(recorded.meta)) {
    std::vector<turbomap::keypoint> keypoints;
    for (std::size_t i = 0; i < recording.keyframe_count(); ++i)
      handles.push_back(store.insert(recorded_keyframe(recording, i, rig, keypoints)));
  }

  const turbomap::recording& recording;
  std::vector<turbomap::rig_camera<Camera>> rig;
  turbomap::context<Policy> ctx;
  store_type store;
  std::vector<turbomap::keyframe_handle> handles;
};

/// The keyframes as they are in one snapshot.
template <class Camera, class Policy>
class snapshot_scene {
 public:
  using posed = turbomap::posed_keyframe<orb, Camera>;

  snapshot_scene(recorded_scene<Camera, Policy>& scene, const turbomap::recording_snapshot& snapshot)
      : snapshot_(snapshot),
        pinned_(scene.store.pin(scene.ctx, turbomap::span<const turbomap::keyframe_handle>(scene.handles))),
        alive_(scene.handles.size(), 0),
        T_cw_(scene.handles.size()) {
    if (scene.recording.has_final())  // a keyframe that was culled keeps the pose that it had
      for (std::size_t k = 0; k < T_cw_.size(); ++k) T_cw_[k] = turbomap::cast<double>(scene.recording.final_T_cw[k]);
    for (std::size_t i = 0; i < snapshot.kf_alive.size(); ++i) {
      const auto k = static_cast<std::size_t>(snapshot.kf_alive[i]);
      T_cw_[k] = turbomap::cast<double>(snapshot.kf_T_cw[i]);
      alive_[k] = 1;
    }
  }

  const turbomap::recording_snapshot& snapshot() const { return snapshot_; }
  /// In the map at the start of the iteration.
  bool alive(std::int32_t k) const { return alive_[static_cast<std::size_t>(k)] != 0; }
  const turbomap::keyframe_view<orb, Camera>& view(std::int32_t k) const {
    return pinned_[static_cast<std::size_t>(k)];
  }
  const turbomap::rigid_transform<double>& T_cw(std::int32_t k) const { return T_cw_[static_cast<std::size_t>(k)]; }
  posed at(std::int32_t k, turbomap::span<const std::uint8_t> mask = {}) const { return {view(k), T_cw(k), mask}; }

 private:
  const turbomap::recording_snapshot& snapshot_;
  turbomap::pinned_keyframes<orb, Camera, turbomap::memory_of_t<Policy>> pinned_;
  std::vector<std::uint8_t> alive_;
  std::vector<turbomap::rigid_transform<double>> T_cw_;
};

/// One line for a difference from the record.
inline void report_difference(const char* what, const turbomap::recording_snapshot& s,
                              const std::array<std::int32_t, 3>& where) {
  std::printf("%s: snapshot %d, %d %d %d\n", what, s.iteration, where[0], where[1], where[2]);
}

}  // namespace turbomap_replay
