// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Check mode: every stage on every recorded snapshot, compared with what the recorded system did.

#include <stdexcept>

#include "arguments.hpp"
#include "check_adjustment.hpp"
#include "check_creation.hpp"
#include "check_culling.hpp"
#include "check_fusion.hpp"
#include "check_inertial_adjustment.hpp"
#include "check_map_update.hpp"
#include "check_preintegration.hpp"
#include "check_search.hpp"
#include "recorded_scene.hpp"

namespace turbomap_replay {

/// Runs the stages on one snapshot after the other and counts. A stage that the snapshots do not have is left out.
template <class Camera, class Policy>
class checker {
 public:
  checker(const turbomap::recording& recording, const Policy& policy, const arguments& arguments)
      : arguments_(arguments),
        scene_(recording, policy),
        search_(scene_),
        creation_(scene_),
        fusion_(scene_),
        map_update_(scene_),
        culling_(scene_),
        adjustment_(recording, arguments.recording, policy, arguments.precision()),
        inertial_adjustment_(recording, arguments.recording, policy, arguments.precision()),
        preintegration_(recording, arguments.recording, policy) {}

  void check(const turbomap::recording_snapshot& snapshot) {
    const snapshot_scene<Camera, Policy> at(scene_, snapshot);
    has_fusion_ = has_fusion_ || snapshot.fusion.has_value();
    has_map_update_ = has_map_update_ || snapshot.map_update.has_value();
    has_culling_ = has_culling_ || snapshot.culling.has_value();
    if (arguments_.search) search_.check(at);
    if (arguments_.creation) creation_.check(at);
    if (arguments_.fusion) fusion_.check(at);
    if (arguments_.map_update) map_update_.check(at);
    if (arguments_.culling) culling_.check(at);
    if (arguments_.adjustment) {
      adjustment_.check(snapshot.iteration);
      inertial_adjustment_.check(snapshot.iteration);
    }
    if (arguments_.preintegration) preintegration_.check(snapshot.iteration);
  }

  outcome result() const {
    outcome o;
    const auto add = [&o](bool chosen, const auto& stage) {
      if (!chosen) return;
      stage.add_json(o.json);
      o.good = o.good && stage.good();
    };
    add(arguments_.search, search_);
    add(arguments_.creation, creation_);
    add(arguments_.fusion && has_fusion_, fusion_);
    add(arguments_.map_update && has_map_update_, map_update_);
    add(arguments_.culling && has_culling_, culling_);
    add(arguments_.adjustment && !adjustment_.empty(), adjustment_);
    add(arguments_.adjustment && !inertial_adjustment_.empty(), inertial_adjustment_);
    add(arguments_.preintegration && !preintegration_.empty(), preintegration_);
    if (o.json.empty()) throw std::invalid_argument("--stages: --check has nothing recorded of these stages");
    return o;
  }

 private:
  const arguments& arguments_;
  recorded_scene<Camera, Policy> scene_;
  search_check<Camera, Policy> search_;
  creation_check<Camera, Policy> creation_;
  fusion_check<Camera, Policy> fusion_;
  map_update_check<Camera, Policy> map_update_;
  culling_check<Camera, Policy> culling_;
  adjustment_check<Camera, Policy> adjustment_;
  inertial_adjustment_check<Camera, Policy> inertial_adjustment_;
  preintegration_check<Policy> preintegration_;
  bool has_fusion_ = false, has_map_update_ = false, has_culling_ = false;
};

}  // namespace turbomap_replay
