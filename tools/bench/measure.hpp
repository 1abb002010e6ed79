// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How turbomap-bench times: medians of interleaved samples, and floors: the least work of a stage, timed as a stream.

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/matching/epipolar.hpp>
#include <turbomap/math/linear.hpp>

#include "reference/search_oracle.hpp"

#include "progress.hpp"
#include "replay/recorded_keyframes.hpp"

namespace turbomap_bench {

using turbomap_replay::orb;
using fisheye = turbomap::kannala_brandt<float>;
using posed = turbomap::posed_keyframe<orb, fisheye>;

/// Unless the results are the same. \throws std::runtime_error  naming the stage
inline void require_same(bool same, const char* stage) {
  if (!same) throw std::runtime_error(std::string(stage) + ": the result differs from the oracle's");
}

/// Pairs of unmapped keypoints in equal words, and pairs that pass the epipolar test: what has to be compared at least.
template <class Camera>
void count_pairs(const turbomap::posed_keyframe<orb, Camera>& query,
                 turbomap::span<const turbomap::posed_keyframe<orb, Camera>> neighbours,
                 const turbomap::search_options& options, double& in_words, double& consistent) {
  float scale[256], sigma2[256];
  for (int o = 0; o < 256; ++o) {
    scale[o] = o == 0 ? 1 : scale[o - 1] * options.scales.scale_factor;
    sigma2[o] = scale[o] * scale[o];
  }
  const auto query_groups = turbomap_test::groups_of(query.view);
  for (const auto& n : neighbours) {
    const auto groups = turbomap_test::groups_of(n.view);
    for (int i = 0; i < query.view.keypoint_count; ++i) {
      if (query.has_point[static_cast<std::size_t>(i)] != 0) continue;
      for (int b = 0; b < n.view.camera_count; ++b) {
        const auto pair = turbomap::make_pair_geometry(query.view.cameras[query.view.camera_of(i)], query.T_cw,
                                                       n.view.cameras[b], n.T_cw, false);
        const auto epipolar = turbomap::make_query_epipolar(pair, query.view, i);
        for (int j = 0; j < n.view.keypoint_count; ++j) {
          if (n.has_point[static_cast<std::size_t>(j)] != 0 || n.view.camera_of(j) != b) continue;
          consistent +=
              turbomap::epipolar_consistent(pair, epipolar, query.view, i, n.view, j, sigma2, scale, options) ? 1 : 0;
          const auto group = groups[static_cast<std::size_t>(j)];
          in_words +=
              group != turbomap::keypoint::no_group && query_groups[static_cast<std::size_t>(i)] == group ? 1 : 0;
        }
      }
    }
  }
}

/// What a run is asked to do.
struct arguments {
  std::string policy = "seq";
  std::string json;
  std::string recording;  ///< a folder; empty: a simulated one
  std::string calls;      ///< 'stereo', 'fisheyes': single calls on simulated keyframes in place of stages
  int repetitions = 31;
};

inline double now_ms() {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count();
}
inline double median(std::vector<double> samples) {
  std::sort(samples.begin(), samples.end());
  return samples[samples.size() / 2];
}

/// A B A B ...: the clock of a shared machine drifts, ratios of neighbours do not.
/// \param oracle   none: only ours is timed
/// \param prepare  when given, called before each of both and not timed
inline nlohmann::json interleave(int repetitions, const std::function<void()>& ours,
                                 const std::function<void()>& oracle, double floor_ms,
                                 const std::function<void()>& prepare = {}) {
  const auto time_ms = [&prepare](const std::function<void()>& stage) {
    if (prepare) prepare();
    const double begin = now_ms();
    stage();
    return now_ms() - begin;
  };
  std::vector<double> a, b;
  turbomap_program::progress bar("samples of a stage", static_cast<std::size_t>(std::max(repetitions, 0)));
  time_ms(ours);
  if (oracle) time_ms(oracle);
  for (int k = 0; k < repetitions; ++k) {
    a.push_back(time_ms(ours));
    if (oracle) b.push_back(time_ms(oracle));
    bar.advance();
  }
  nlohmann::json times = {{"ms_median", median(a)}, {"floor_ms", floor_ms}};
  if (oracle) times["oracle_ms_median"] = median(b), times["ratio"] = median(b) / median(a);
  return times;
}

/// Milliseconds that one core needs for `pairs` Hamming distances of 256 bits and nothing else, read as a stream.
template <class Camera>
double distance_floor_ms(const turbomap::keyframe_view<orb, Camera>& view, double pairs) {
  if (view.keypoint_count <= 0) return 0;
  volatile std::int32_t sink = 0;  // or the compiler would leave the work out
  std::vector<double> samples;
  const int passes = 200;
  for (int k = 0; k < 15; ++k) {
    const double begin = now_ms();
    for (int p = 0; p < passes; ++p) {
      std::int32_t least = 256;
      for (int i = 0; i < view.keypoint_count; ++i)
        least = std::min(least, orb::distance(view.descriptor_of(p % view.keypoint_count), view.descriptor_of(i)));
      sink = least;
    }
    samples.push_back((now_ms() - begin) / (static_cast<double>(passes) * view.keypoint_count));
  }
  (void)sink;
  return median(samples) * pairs;
}

/// Milliseconds that one core needs to take `transforms` points into a camera and nothing else, read as a stream.
inline double transform_floor_ms(double transforms) {
  volatile double sink = 0;
  const std::vector<turbomap::vec3<double>> points(1000, {1, 2, 3});
  const auto T = turbomap::to_isometry<double>(turbomap::rigid_transform<double>{});
  std::vector<double> samples;
  const int passes = 200;
  for (int k = 0; k < 15; ++k) {
    const double begin = now_ms();
    for (int p = 0; p < passes; ++p) {
      double sum = 0;
      for (const auto& x : points) {
        const auto y = T * x;
        sum += y.x + y.y + y.z;
      }
      sink = sum;
    }
    samples.push_back((now_ms() - begin) / (passes * static_cast<double>(points.size())));
  }
  (void)sink;
  return median(samples) * transforms;
}

/// Milliseconds that one core needs to read so many bytes once, from where they are after the pass before.
inline double read_floor_ms(double bytes) {
  volatile std::uint32_t sink = 0;
  const std::vector<std::uint32_t> words(static_cast<std::size_t>(bytes) / sizeof(std::uint32_t), 1);
  std::vector<double> samples;
  for (int k = 0; k < 31; ++k) {
    const double begin = now_ms();
    sink = std::accumulate(words.begin(), words.end(), std::uint32_t{0});
    samples.push_back(now_ms() - begin);
  }
  (void)sink;
  return median(samples);
}

}  // namespace turbomap_bench
