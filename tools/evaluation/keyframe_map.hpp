// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Reads a recorded map with its observations from a .kfm file: keyframes with keypoints and binary descriptors, and which
/// landmark each keypoint observes. Little-endian, packed:
///
///     char[4] "KFM1"; u32 version = 1, keyframes, landmarks, descriptor bytes, width, height, model (0: Brown-Conrady);
///     f64 fx fy cx cy; f64 k1 k2 p1 p2 k3
///     per keyframe: u64 t_ns; u32 submap; u32 n; f64 qx qy qz qw px py pz (camera to world); f32 uv[2 n] (raw pixels);
///                   i32 landmark[n] (-1: none); u8 descriptor[n * descriptor bytes]
///     per landmark: f64 xyz[3]; u32 quality (0 unknown, 1 bad, 2 good); u32 submap

#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <turbomap/camera/brown_conrady.hpp>
#include <turbomap/error.hpp>
#include <turbomap/math/linear.hpp>
#include <turbomap/types.hpp>
#include <vector>

namespace turbomap::evaluation {

struct map_keyframe {
  std::uint64_t t_ns = 0;
  std::uint32_t submap = 0;
  rigid_transform<double> T_cw;
  std::vector<vec2<float>> pixels;        ///< raw, px
  std::vector<std::int32_t> landmarks;    ///< index, or -1
  std::vector<std::uint8_t> descriptors;  ///< one after the other
};
struct map_landmark {
  vec3<double> position{};  ///< world, m
  std::uint32_t quality = 0;
  std::uint32_t submap = 0;
  bool good() const { return quality == 2; }
};
struct keyframe_map {
  int descriptor_bytes = 0, width = 0, height = 0;
  brown_conrady<double> camera;
  std::vector<map_keyframe> keyframes;
  std::vector<map_landmark> landmarks;
};

/// Throws bad_file naming the file and what is wrong: cut short, too long, another format, sizes that no image or descriptor
/// has, an index past its array, numbers that are not finite, a rotation that is none.
inline keyframe_map read_keyframe_map(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw bad_file("turbomap: " + file.string() + ": cannot be opened");
  const std::vector<char> bytes((std::istreambuf_iterator<char>(stream)), {});
  std::size_t at = 0;
  const auto fail = [&](const std::string& reason) { throw bad_file("turbomap: " + file.string() + ": " + reason); };
  const auto take = [&](auto* values, std::size_t count, const char* array) {
    const std::size_t size = count * sizeof *values;
    if (size > bytes.size() - at) fail(std::string(array) + ": the file is cut short");
    if (size > 0) std::memcpy(values, bytes.data() + at, size);
    at += size;
  };
  char magic[4];
  std::uint32_t header[7];
  double intrinsics[9];
  take(magic, 4, "magic");
  take(header, 7, "header");
  take(intrinsics, 9, "intrinsics");
  if (std::memcmp(magic, "KFM1", 4) != 0 || header[0] != 1) fail("magic: not a version 1 .kfm file");
  if (header[6] != 0) fail("header: camera model " + std::to_string(header[6]) + ", not Brown-Conrady");
  constexpr std::uint32_t most = 65535;
  if (header[3] > most) fail("header: descriptors of " + std::to_string(header[3]) + " bytes");
  for (const std::uint32_t size : {header[4], header[5]})
    if (size < 1 || size > most) fail("header: an image of " + std::to_string(size) + " pixels a side");
  const auto finite = [&](const auto* values, std::size_t count, const std::string& array) {
    for (std::size_t i = 0; i < count; ++i)
      if (!std::isfinite(values[i])) fail(array + ": not finite");
  };
  finite(intrinsics, 9, "intrinsics");

  keyframe_map map;
  map.descriptor_bytes = static_cast<int>(header[3]);
  map.width = static_cast<int>(header[4]), map.height = static_cast<int>(header[5]);
  const double* d = intrinsics;
  map.camera = {d[0], d[1], d[2], d[3], d[4], d[5], d[6], d[7], d[8]};
  for (std::uint32_t k = 0; k < header[1]; ++k) {
    map_keyframe& keyframe = map.keyframes.emplace_back();
    std::uint32_t count = 0;
    double p[7];
    take(&keyframe.t_ns, 1, "t_ns");
    take(&keyframe.submap, 1, "submap");
    take(&count, 1, "keypoint count");
    take(p, 7, "pose");
    if (count > (bytes.size() - at) / (12 + header[3])) fail("uv: the file is cut short");
    keyframe.pixels.resize(count);
    keyframe.landmarks.resize(count);
    keyframe.descriptors.resize(std::size_t{count} * header[3]);
    take(keyframe.pixels.data(), count, "uv");
    take(keyframe.landmarks.data(), count, "landmark");
    take(keyframe.descriptors.data(), keyframe.descriptors.size(), "descriptor");
    const std::string named = " of keyframe " + std::to_string(k);
    finite(p, 7, "pose" + named);
    if (!(std::abs(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3] - 1) < 1e-6))
      fail("pose" + named + ": no rotation");
    for (const vec2<float>& uv : keyframe.pixels) finite(&uv.x, 1, "uv" + named), finite(&uv.y, 1, "uv" + named);
    for (const std::int32_t l : keyframe.landmarks)
      if (l < -1 || l >= static_cast<std::int64_t>(header[2])) fail("landmark: index " + std::to_string(l));
    const vec3<double> centre{p[4], p[5], p[6]};
    keyframe.T_cw = {-p[0], -p[1], -p[2], p[3], 0, 0, 0};
    const vec3<double> t = rotation(keyframe.T_cw) * centre;
    keyframe.T_cw.tx = -t.x, keyframe.T_cw.ty = -t.y, keyframe.T_cw.tz = -t.z;
    finite(&t.x, 3, "pose" + named);  // the products may be too large
  }
  for (std::uint32_t l = 0; l < header[2]; ++l) {
    map_landmark& landmark = map.landmarks.emplace_back();
    take(&landmark.position.x, 3, "xyz");
    finite(&landmark.position.x, 3, "xyz of landmark " + std::to_string(l));
    take(&landmark.quality, 1, "quality");
    take(&landmark.submap, 1, "landmark submap");
  }
  if (at != bytes.size()) fail("there are " + std::to_string(bytes.size() - at) + " bytes after the last landmark");
  return map;
}

}  // namespace turbomap::evaluation
