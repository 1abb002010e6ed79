// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Trajectories in the TUM format (one line per pose: `t x y z qx qy qz qw`, seconds, body in world), read and written with
/// exact nanoseconds.

#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "../types.hpp"

namespace turbomap {

/// A pose at a time: the body in the world, `T_wb`.
struct stamped_pose {
  std::int64_t t_ns = 0;
  rigid_transform<double> T_wb;
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Seconds written in decimals to nanoseconds, exactly: a double has no room for both the epoch and nanoseconds. Digits
/// beyond the ninth are dropped. False when it is not a plain decimal number.
inline bool parse_seconds(const char* at, const char* end, std::int64_t& t_ns) {
  const bool negative = at != end && *at == '-';
  if (negative) ++at;
  std::int64_t whole = 0, part = 0;
  const auto integer = std::from_chars(at, end, whole);
  if (integer.ec != std::errc() || whole < 0 || whole > 9000000000) return false;
  at = integer.ptr;
  if (at != end) {
    if (*at++ != '.') return false;
    std::int64_t unit = 100000000;
    for (; at != end; ++at, unit /= 10) {
      if (*at < '0' || *at > '9') return false;
      part += unit * (*at - '0');
    }
  }
  t_ns = (negative ? -1 : 1) * (whole * 1000000000 + part);
  return true;
}

}  // namespace detail

/// Reads a trajectory; empty lines and those that begin with # are comments. Quaternions are normalised. Throws
/// bad_file naming file, line and reason: not eight finite numbers, a rotation that is none, times that do not rise, no
/// pose at all.
inline std::vector<stamped_pose> read_trajectory(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw bad_file("turbomap: " + file.string() + ": cannot be opened");
  const std::string text((std::istreambuf_iterator<char>(stream)), {});
  std::vector<stamped_pose> poses;
  std::size_t line = 0;
  const auto fail = [&](const std::string& reason) {
    throw bad_file("turbomap: " + file.string() + ": line " + std::to_string(line) + ": " + reason);
  };
  const char *at = text.data(), *const text_end = at + text.size();
  while (at != text_end) {
    const char* end = at;
    while (end != text_end && *end != '\n') ++end;
    ++line;
    const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
    const auto skip = [&] {
      while (at != end && blank(*at)) ++at;
    };
    skip();
    if (at != end && *at != '#') {
      stamped_pose pose;
      double v[7];
      for (int i = 0; i < 8; ++i) {
        const char* stop = at;
        while (stop != end && !blank(*stop)) ++stop;
        if (stop == at) fail("has " + std::to_string(i) + " numbers, not t x y z qx qy qz qw");
        bool good;
        if (i == 0) {
          good = detail::parse_seconds(at, stop, pose.t_ns);
        } else {
          const auto number = std::from_chars(at, stop, v[i - 1]);
          good = number.ec == std::errc() && number.ptr == stop && std::isfinite(v[i - 1]);
        }
        if (!good) fail("'" + std::string(at, stop) + "' is not a number");
        at = stop;
        skip();
      }
      if (at != end) fail("has more than eight numbers");
      const double norm = std::sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]);
      if (!(std::abs(norm - 1) < 1e-2)) fail("does not end with a unit quaternion");
      pose.T_wb = {v[3] / norm, v[4] / norm, v[5] / norm, v[6] / norm, v[0], v[1], v[2]};
      if (!poses.empty() && pose.t_ns <= poses.back().t_ns) fail("is not later than the pose before");
      poses.push_back(pose);
    }
    at = end == text_end ? end : end + 1;
  }
  if (poses.empty()) fail("there is no pose in the file");
  return poses;
}

/// Writes a trajectory: nanoseconds exactly, the rest with nine decimals. Throws bad_file if it cannot.
inline void write_trajectory(const std::filesystem::path& file, const std::vector<stamped_pose>& poses) {
  std::string text = "# t x y z qx qy qz qw\n";
  char line[256];
  for (const stamped_pose& p : poses) {
    const std::int64_t t = p.t_ns < 0 ? -p.t_ns : p.t_ns;
    const auto& T = p.T_wb;
    std::snprintf(line, sizeof line, "%s%lld.%09lld %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", p.t_ns < 0 ? "-" : "",
                  static_cast<long long>(t / 1000000000), static_cast<long long>(t % 1000000000), T.tx, T.ty, T.tz,
                  T.qx, T.qy, T.qz, T.qw);
    text += line;
  }
  std::ofstream stream(file, std::ios::binary);
  stream << text;
  if (!stream.flush()) throw bad_file("turbomap: " + file.string() + ": could not be written");
}

TURBOMAP_END_NAMESPACE
