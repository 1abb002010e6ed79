// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Snapshots of a recording, adjustment included: the fuzzer's bytes are changes to the files of a good one.

#include "readers/recording_snapshot.hpp"
#include "readers/recording_snapshot_adjustment.hpp"

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
    turbomap_test::write_bytes(where / "meta.json", meta);
    files.read_files();
    recording = turbomap::read_recording(files.folder());
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
  });
  return 0;
}
