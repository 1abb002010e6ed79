// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Trajectories in the TUM format (one line per pose: `t x y z qx qy qz qw`, seconds, body in world), read and written with
/// exact nanoseconds.

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "../types.hpp"
#include "text_reader.hpp"

namespace turbomap {

/// A pose at a time: the body in the world, `T_wb`.
struct stamped_pose {
  std::int64_t t_ns = 0;         ///< time, ns
  rigid_transform<double> T_wb;  ///< body to world, m
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Seconds written in decimals to nanoseconds, exactly: a double has no room for both the epoch and nanoseconds. A sign
/// and an exponent may be there: +1.5, .5, 1.403636580838555574e+09. Digits beyond the nanoseconds are dropped. False when
/// it is no such number, or has no room in 64 bits.
inline bool parse_seconds(const char* at, const char* end, std::int64_t& t_ns) {
  constexpr std::uint64_t limit = std::uint64_t{1} << 63;
  const bool negative = at != end && *at == '-';
  if (at != end && (negative || *at == '+')) ++at;
  const char* const digits_end = std::find_if(at, end, [](char c) { return c == 'e' || c == 'E'; });
  int exponent = 0;
  if (digits_end != end) {
    if (!parse_number(digits_end + 1, end, exponent)) return false;
    if (exponent < -999 || exponent > 999) return false;  // more digits than that of a double has
  }
  const char* const point = std::find(at, digits_end, '.');
  std::ptrdiff_t places = point - at + exponent + 9;  // digits of the nanoseconds that are still to come
  std::uint64_t size = 0;
  const auto append = [&](std::uint64_t digit) {
    if (size > limit / 10) return false;
    size = 10 * size + digit;
    return true;
  };
  bool any = false;
  for (; at != digits_end; ++at) {
    if (at == point) continue;
    if (*at < '0' || *at > '9') return false;
    any = true;
    if (places-- > 0 && !append(static_cast<std::uint64_t>(*at - '0'))) return false;
  }
  for (; places > 0; --places)
    if (!append(0)) return false;
  if (!any || size > limit - (negative ? 0 : 1)) return false;
  // Minus one, so that -2^63, which has no positive counterpart, is computed too.
  t_ns = negative && size != 0 ? -static_cast<std::int64_t>(size - 1) - 1 : static_cast<std::int64_t>(size);
  return true;
}

/// Appends seconds with nine decimals.
inline void append_seconds(std::string& text, std::int64_t t_ns) {
  const std::uint64_t size = t_ns < 0 ? 0 - static_cast<std::uint64_t>(t_ns) : static_cast<std::uint64_t>(t_ns);
  const std::string part = std::to_string(size % 1000000000);
  if (t_ns < 0) text += '-';
  text.append(std::to_string(size / 1000000000)).append(".").append(9 - part.size(), '0').append(part);
}

/// Appends a blank and the number with nine decimals, as printf does in the C locale.
inline void append_decimals(std::string& text, double value) {
  char number[330];  // sign, 309 digits of the largest double, point, nine decimals
  text.append(" ").append(number,
                          std::to_chars(number, number + sizeof number, value, std::chars_format::fixed, 9).ptr);
}

/// Both sides of the format: how far a quaternion may be from a unit one (it has few digits).
inline bool is_trajectory_rotation(double norm) { return std::abs(norm - 1) < 1e-2; }

}  // namespace detail

/// Reads a trajectory; empty lines and those that begin with # are comments. Numbers may have an exponent, as numpy.savetxt
/// writes them. Quaternions are normalised. Throws bad_file naming file, line and reason: not eight finite numbers, a
/// rotation that is none, times that do not rise, no pose at all.
inline std::vector<stamped_pose> read_trajectory(const std::filesystem::path& file) {
  detail::text_reader in(file);
  std::vector<stamped_pose> poses;
  do {
    if (in.line_ends() || in.peek() == '#') continue;
    stamped_pose pose;
    double v[7];
    for (int i = 0; i < 8; ++i) {
      if (in.line_ends()) in.fail("has " + std::to_string(i) + " numbers, not t x y z qx qy qz qw");
      const std::string word = in.take_word("number");
      const char *begin = word.data(), *end = begin + word.size();
      if (!(i == 0 ? detail::parse_seconds(begin, end, pose.t_ns) : detail::parse_number(begin, end, v[i - 1])))
        in.fail("'" + word + "' is not a number");
    }
    if (!in.line_ends()) in.fail("has more than eight numbers");
    const double norm = std::sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]);
    if (!detail::is_trajectory_rotation(norm)) in.fail("does not end with a unit quaternion");
    pose.T_wb = {v[3] / norm, v[4] / norm, v[5] / norm, v[6] / norm, v[0], v[1], v[2]};
    if (!poses.empty() && pose.t_ns <= poses.back().t_ns) in.fail("is not later than the pose before");
    poses.push_back(pose);
  } while (in.next_line());
  if (poses.empty()) in.fail("there is no pose in the file");
  return poses;
}

/// Writes a trajectory: nanoseconds exactly, the rest with nine decimals. Throws std::invalid_argument for what
/// read_trajectory would refuse (no pose, times that do not rise, numbers that are not finite, a rotation that is none),
/// bad_file if it cannot be written; the file is as before then.
inline void write_trajectory(const std::filesystem::path& file, const std::vector<stamped_pose>& poses) {
  require(!poses.empty(), "poses", poses.size(), "must not be empty");
  std::string text = "# t x y z qx qy qz qw\n";
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const auto& T = poses[i].T_wb;
    const auto named = [&](const char* field) { return "poses[" + std::to_string(i) + "]." + field; };
    if (i > 0 && poses[i].t_ns <= poses[i - 1].t_ns)
      reject(named("t_ns"), poses[i].t_ns, "must be later than the pose before");
    const double norm = std::sqrt(T.qx * T.qx + T.qy * T.qy + T.qz * T.qz + T.qw * T.qw);
    if (!detail::is_trajectory_rotation(norm)) reject(named("T_wb quaternion norm"), norm, "must be 1");
    detail::append_seconds(text, poses[i].t_ns);
    for (const double x : {T.tx, T.ty, T.tz, T.qx, T.qy, T.qz, T.qw}) {
      if (!std::isfinite(x)) reject(named("T_wb"), x, "must be finite");
      detail::append_decimals(text, x);
    }
    text += '\n';
  }
  if (!detail::replace_text_file(file, text)) throw bad_file("turbomap: " + file.string() + ": could not be written");
}

TURBOMAP_END_NAMESPACE
