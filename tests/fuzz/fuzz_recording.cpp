// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Whole recordings: the fuzzer's bytes are changes to the files of a good one. What is read can be written, and is the
// same when it is read again.

#include <cstring>
#include <map>
#include <set>

#include <turbomap/io/recording.hpp>
#include <turbomap/io/recording_writer.hpp>
#include <turbomap/io/trajectory_error.hpp>

#include "fuzz.hpp"
#include "recording_changes.hpp"
#include "recording_contents.hpp"

using namespace turbomap_fuzz;

namespace {

void check(const turbomap::recording& r) {
  for (std::size_t i = 0; i < r.keyframe_count(); ++i) {
    const auto keypoints = r.gather_keypoints(i);
    expect(keypoints.size() == r.descriptors(i).size(), "keypoints have descriptors");
    for (const auto& k : keypoints) {
      expect(finite({k.x, k.y, k.angle, k.u_right, k.depth}) && k.octave < r.meta.levels, "keypoints are sound");
      expect(k.camera == 0 || !r.meta.camera2.empty(), "cameras are there");
    }
    for (std::size_t a = r.associations(i).begin; a < r.associations(i).end; ++a)
      for (const auto& ref : {r.assoc_ref[a], r.assoc_ref2[a]})
        expect(ref.keyframe == -1 || (static_cast<std::size_t>(ref.keyframe) <= i &&
                                      static_cast<std::size_t>(ref.keypoint) <
                                          r.keypoints(static_cast<std::size_t>(ref.keyframe)).size()),
               "references are keypoints");
    expect(is_pose(r.T_cw[i], 2e-3), "poses are poses");
  }
  for (const auto& g : r.gt_T_wb)
    expect(std::abs(g.qx * g.qx + g.qy * g.qy + g.qz * g.qz + g.qw * g.qw - 1) < 2e-3, "true poses are poses");
  for (std::size_t i = 1; i < r.frame_t_ns.size(); ++i)
    expect(r.frame_t_ns[i] >= r.frame_t_ns[i - 1], "times of frames do not fall");
  if (r.has_ground_truth()) turbomap::keyframe_trajectory_error(r, r.T_cw);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const recording_files mono(folder() / "pinhole", false), fisheye(folder() / "fisheye", true);
  if (size == 0) return 0;
  const recording_files& files = data[0] % 2 == 0 ? mono : fisheye;
  const recording_changes changes(files, {reinterpret_cast<const char*>(data) + 1, size - 1});
  turbomap::recording r;
  if (!reads([&] { r = turbomap::read_recording(files.folder()); })) return 0;
  check(r);
  if (data[0] / 2 % 4 != 0) return 0;  // writing takes most of the time
  turbomap::write_recording(folder() / "written", r);
  expect(contents(turbomap::read_recording(folder() / "written")) == contents(r), "a recording is read back");
  return 0;
}
