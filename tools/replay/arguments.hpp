// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What turbomap-replay is asked to do, and the entry of each policy.

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/adjustment/options.hpp>
#include <turbomap/io/recording_data.hpp>

namespace turbomap_replay {

/// The correlation of the errors of u and u_right with which the disparity errs as it was simulated: its variance is
/// 2 (1 - correlation) times that of u. Between 0 and 0.9999: adjustments need less than 1. 0 where it is not known.
inline double simulated_correlation(const turbomap::recording_meta& meta) {
  if (!(meta.noise_px > 0) || meta.disparity_noise_px < 0) return 0;
  const double ratio = meta.disparity_noise_px / meta.noise_px;
  return std::clamp(1 - ratio * ratio / 2, 0.0, 0.9999);
}

/// An option that a recording answers where nobody is asked.
enum class choice { by_recording, no, yes };

struct arguments {
  std::filesystem::path recording;
  std::string policy = "seq";
  bool objects = false;               ///< the map is one of objects, as in the field; else a simple_map. Replay mode
  choice imu = choice::by_recording;  ///< the recording's IMU takes part; replay() knows whether. Replay mode
  double imu_noise = 1;               ///< noise densities of the recording's IMU are multiplied by
  choice pixel_centres = choice::by_recording;  ///< recorded keypoints are moved to the full image; likewise
  std::vector<double> right_distortion;  ///< k1 to k4 of the right camera, instead of the recorded ones; empty: those
  std::string without_imu;               ///< what forbids a recording's IMU where nobody did; empty: nothing
  std::string work = "replay";           ///< as the progress bar names it
  std::vector<std::string> beside;       ///< more policies that the recording is replayed under
  bool bound = true;                     ///< of a simulated recording: the error of the batch adjustment is computed
  bool error_parts = false;              ///< ... and what the error of the map comes from
  bool merge_causes = false;             ///< why points had to be merged is counted. Replay mode
  bool gather_observations = false;      ///< replay_result::observations is filled
  bool quiet = false;                    ///< of the replays beside the first: nothing is printed, no trajectory judged
  bool check = false;
  /// Stages that are switched on.
  bool point_culling = true, search = true, creation = true, fusion = true, map_update = true;
  bool adjustment = true, preintegration = true, culling = true;
  std::string rule = "tracks";         ///< creation_rule: tracks or pairs
  std::string candidates = "ordered";  ///< exhaustive, ordered or grouped (replay mode)
  bool serial_fusion = false;          ///< fusion_mode::serial_exact
  std::string merges = "apart";        ///< merge_rule: refuse, apart or drop
  std::string numbers = "mixed";       ///< of adjustments: float64, mixed or float32
  bool marginal_prior = false;         ///< of the keyframe before an inertial window
  bool published_steps = false;        ///< of local adjustments: those of [ORB-SLAM3]
  double stereo_correlation = -1;      ///< of the errors of u and u_right; negative: correlation() knows
  bool balanced = false;               ///< local_mapper_options::balanced()
  bool accurate = false;               ///< local_mapper_options::accurate()
  int fewest_keyframes = 0;            ///< creation_options::fewest_keyframes; 0: its default
  int known_octaves = -1;              ///< creation_options::known_octaves; negative: its default
  double lookalike_ratio = 0.8;        ///< creation_options::lookalike_ratio
  bool across_rig = true;              ///< neighbour_search_options::across_rig
  int second_shared = 0;               ///< local_adjustment_options::second_min_shared_points
  int global_every = 0;                ///< all of the map is adjusted after so many keyframes; 0: never
  bool global_end = false;             ///< ... and at the end
  int global_rounds = 0;               ///< duplicates are looked for and all is adjusted again, so often
  int temporal_neighbours = -1;        ///< neighbourhood_options'; negative: its default
  int culling_observers = -1;          ///< keyframe_culling_options::observers; negative: its default
  float culling_share = -1;            ///< ... redundant_share, likewise
  bool projected = false;              ///< the local map is looked for in each keyframe, besides
  bool uncertain_tracking = false;     ///< tracking's poses and gate know how well points are known
  bool uncertain_fusion = false;       ///< fusion's gate does
  bool queue = false;                  ///< in recorded time: stages are skipped while keyframes wait
  double rate = 1;                     ///< ... times the recorded rate
  double deadline_ms = 0;              ///< per keyframe; 0: none
  int most_views = -1;                 ///< local_mapper_options::most_views; negative: its default
  int behind = 0;                      ///< so many first keyframes find the next one waiting
  bool growth = false;                 ///< print medians per fifth of the keyframes
  std::filesystem::path growth_file;   ///< the same per keyframe; empty: none
  std::filesystem::path json, trajectory, ply, report;  ///< outputs; empty: none
  int repeat = 1;
  std::size_t most_keyframes = static_cast<std::size_t>(-1);  ///< so many first keyframes are replayed
  int perturb = 0;  ///< seed of a random micrometre on the poses that come in; 0: none

  /// Adjustments' stereo_correlation. Measured against ground truth on the EuRoC recordings, in pixels of the octave: u
  /// is off by 0.68 and 0.86, the disparity by 0.13 and 0.15 (two views each). Their mean ratio, 0.14 / 0.77, gives
  /// 1 - ratio^2 / 2, as in simulated_correlation().
  /// A simulated recording tells its own; older ones were drawn with independent errors.
  double correlation(const turbomap::recording& r) const {
    if (stereo_correlation >= 0) return stereo_correlation;
    return r.is_simulated() ? simulated_correlation(r.meta) : 0.9835;
  }
  turbomap::precision precision() const {
    return numbers == "float64"   ? turbomap::precision::float64
           : numbers == "float32" ? turbomap::precision::float32
                                  : turbomap::precision::mixed;
  }
};

/// Throws std::invalid_argument for the first of these options that is given: it does nothing `with` another.
inline void refuse(const std::vector<std::pair<const char*, bool>>& options, const char* with) {
  for (const auto& [name, given] : options)
    if (given) throw std::invalid_argument(std::string(name) + ": not together with " + with);
}

/// The outcome of a run: its JSON, and whether every check held.
struct outcome {
  nlohmann::json json;
  bool good = true;
  double begin_ms = 0, end_ms = 0;  ///< wall clock around all its replays, without what is read before
};

/// One run under the host policy that the arguments name, or under CUDA. The templates of every stage are behind them, in
/// run_host.cpp and, where there is CUDA, cuda/replay_cuda.cu. run_cuda throws std::runtime_error without a device.
outcome run_host(const arguments& arguments);
outcome run_cuda(const arguments& arguments);

}  // namespace turbomap_replay
