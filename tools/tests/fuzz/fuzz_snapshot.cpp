// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Snapshots of a recording, adjustment (also inertial) and preintegration included: the fuzzer's bytes are changes to the files of a good one.

#include <array>

#include "readers/recording_snapshot.hpp"
#include "readers/recording_snapshot_adjustment.hpp"
#include "readers/recording_snapshot_inertial.hpp"
#include "readers/recording_snapshot_preintegration.hpp"

#include "fuzz/fuzz.hpp"
#include "fuzz/recording_changes.hpp"
#include "tests/snapshot_samples.hpp"

using namespace turbomap_fuzz;

namespace {

/// A recording with a snapshot of iteration 1. The meta.json of an adjustment has no other key.
struct recorded {
  explicit recorded(const char* name, bool fisheye) : files(folder() / name, fisheye) {
    const auto where = turbomap::snapshot_directory(files.folder(), 1);
    turbomap_test::write_adjustment(where, fisheye);
    const turbomap_test::snapshot_files snapshot(where, fisheye);
    std::string meta = snapshot.meta;
    meta.replace(meta.size() - 1, 1, "," + std::string(turbomap_test::adjustment_meta).substr(1));
    meta.insert(meta.rfind('}', meta.size() - 2), ", \"bRecInit\": 1");
    write_inertial(where);
    turbomap_test::write_bytes(where / "meta.json", meta);
    files.read_files();
    recording = turbomap::read_recording(files.folder());
  }
  /// Of its three keyframes: what the IMU says of the first, the last and the one between them.
  static void write_inertial(const std::filesystem::path& where) {
    const auto rows = [&](const char* name, const auto& values) {
      turbomap::write_npy_rows(where / (std::string(name) + ".npy"), values);
    };
    using vectors = std::vector<turbomap::vec3<float>>;
    using biases = std::vector<std::array<float, 6>>;
    for (const char* name : {"lba_vel_before", "lba_vel_after", "lba_imu_dV", "lba_imu_dP"}) rows(name, vectors(3));
    for (const char* name : {"lba_bias_before", "lba_bias_after", "lba_imu_bias_orig"}) rows(name, biases(3));
    rows("lba_imu_has", std::vector<std::uint8_t>{1, 0, 1});
    rows("lba_imu_prev", std::vector<std::int32_t>{2, -1, 1});
    rows("lba_imu_dT", std::vector<float>{0.05F, 0, 0.05F});
    for (const char* name : {"dR", "JRg", "JVg", "JVa", "JPg", "JPa", "C"}) {
      const std::size_t n = name[0] == 'C' ? 15 : 3;
      turbomap::write_npy<float>(where / (std::string("lba_imu_") + name + ".npy"), std::vector<float>(3 * n * n, 1),
                                 {3, n, n});
    }
  }
  recording_files files;
  turbomap::recording recording;
};

void use(const turbomap::recording_snapshot& s) {
  std::size_t sum = 0;
  for (std::size_t i = 0; i < s.search.neighbours.size(); ++i) {
    for (const auto m : s.mask1(i)) sum += m;
    for (const auto m : s.mask2(i)) sum += m;
    for (const auto& p : s.pairs(i)) sum += static_cast<std::size_t>(p[0]);
    for (const auto& p : s.batch_pairs(i)) sum += static_cast<std::size_t>(p[1]);
  }
  if (s.map_update)
    for (std::size_t i = 0; i < s.map_update->point.size(); ++i)
      for (const auto o : s.map_update->observers(i)) sum += static_cast<std::size_t>(o);
  if (s.culling) {
    for (std::size_t i = 0; i < s.culling->keyframe.size(); ++i) sum += s.culling->slots(i).size();
    for (std::size_t i = 0; i < s.culling->point.size(); ++i) sum += s.culling->observations(i).size();
  }
  if (s.fusion)
    for (const auto state : s.fusion->calls.state)
      expect(state >= -1 && state < static_cast<std::int64_t>(s.fusion->states.point.size()), "states are rows");
  [[maybe_unused]] static volatile std::size_t sink;  // so that the reads above are not left out
  sink = sum;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const recorded pinhole("pinhole", false), fisheye("fisheye", true);
  if (size == 0) return 0;
  const recorded& from = data[0] % 2 == 0 ? pinhole : fisheye;
  const recording_changes changes(from.files, {reinterpret_cast<const char*>(data) + 1, size - 1});
  reads([&] { use(turbomap::read_snapshot(from.recording, from.files.folder(), 1)); });
  reads([&] {
    const auto a = turbomap::read_adjustment_snapshot(from.recording, from.files.folder(), 1);
    if (!a) return;
    const auto problem = turbomap::problem_of(*a);
    for (const auto k : problem.frame) expect(static_cast<std::size_t>(k) < problem.T_cw.size(), "frames are there");
    expect(finite({a->robust_cost_before, a->robust_cost_after}), "costs are finite");
    const auto more = turbomap::read_inertial_snapshot(from.recording, from.files.folder(), 1, *a);
    for (const auto* v : {&more.velocity_before, &more.velocity_after}) {
      expect(v->size() == a->keyframe.size(), "every keyframe has a velocity");
      for (const auto& x : *v) expect(finite({x.x, x.y, x.z}), "velocities are finite");
    }
    for (const auto* b : {&more.bias_before, &more.bias_after}) {
      expect(b->size() == a->keyframe.size(), "every keyframe has its biases");
      for (const auto& x : *b)
        for (const float value : x) expect(finite({double(value)}), "biases are finite");
    }
  });
  reads([&] {
    for (const auto& p : turbomap::read_preintegration_snapshot(from.recording, from.files.folder(), 1)) {
      const auto time = [&](std::int32_t k) { return from.recording.t_ns.at(static_cast<std::size_t>(k)); };
      expect(time(p.from) < time(p.to), "a motion goes on in time");
      expect(finite({double(p.dT), double(p.dV.x), double(p.dP.z), double(p.bias[5])}), "motions are finite");
      for (const float value : p.C) expect(finite({double(value)}), "covariances are finite");
    }
  });
  return 0;
}
