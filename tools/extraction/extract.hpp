// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A recording of local mapping from the images of a data set: keyframes picked along the given poses, features, stereo, a
/// stand-in for tracking. No scene is simulated, and no system has run: poses are the true ones, made worse where asked.

#include <algorithm>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include <turbomap/io/recording_writer.hpp>

#include "asl_dataset.hpp"
#include "grid_features.hpp"
#include "image_rectifier.hpp"
#include "point_tracker.hpp"
#include "row_stereo.hpp"
#include "simulation/motion.hpp"
#include "simulation/simulate.hpp"
#include "view_pairs.hpp"

namespace turbomap::extraction {

struct extract_options {
  feature_options features;
  row_stereo_options stereo;
  view_pair_options pairs;  ///< of a fisheye rig, and of one camera's keyframes
  point_tracker_options tracking;
  /// keyframe_seconds, _metres, _radians, most_keyframes, and the drift of the recorded poses, by default none.
  simulation::motion_options motion;
  std::uint64_t seed = 1;   ///< of the drift
  double close_depth = 40;  ///< baselines (Mur-Artal and Tardos, T-RO 2017): stereo points beyond are far
  double pose_gap_s = 0.5;  ///< images between poses that are further apart are left out

  extract_options() { motion.drift_metres_per_metre = motion.drift_radians_per_metre = 0; }
};

/// An image that became a keyframe.
struct picked_keyframe {
  std::size_t image;
  Eigen::Isometry3d T_wb;
};

/// Images that a pose is known of, and which of them become keyframes: those that are so long after, so far from, or turned
/// so much against the one before.
struct picked_keyframes {
  std::vector<std::pair<std::int64_t, Eigen::Isometry3d>> posed;
  std::vector<picked_keyframe> keyframes;
};

inline picked_keyframes pick_keyframes(const asl_dataset& data, const extract_options& options) {
  const simulation::motion_options& o = options.motion;
  const double share = data.cameras.size() == 1 ? o.monocular_share : 1;
  picked_keyframes picked;
  for (std::size_t i = 0; i < data.images.size(); ++i) {
    Eigen::Isometry3d T_wb;
    const std::int64_t t = data.images[i].t_ns;
    if (!pose_at(data.T_wb, t, options.pose_gap_s, T_wb)) continue;
    picked.posed.emplace_back(t, T_wb);
    bool due = picked.keyframes.empty();
    if (!due) {
      const picked_keyframe& last = picked.keyframes.back();
      const Eigen::Isometry3d moved = last.T_wb.inverse() * T_wb;
      const double metres = moved.translation().norm();
      due = static_cast<double>(t - data.images[last.image].t_ns) * 1e-9 >= o.keyframe_seconds - 1e-9 ||
            metres >= share * o.keyframe_metres ||
            Eigen::AngleAxisd(moved.linear()).angle() >= share * o.keyframe_radians;
      if (data.cameras.size() == 1 && picked.keyframes.size() == 1) due = metres >= o.first_metres;
    }
    if (due) picked.keyframes.push_back({i, T_wb});
    if (o.most_keyframes > 0 && picked.keyframes.size() == static_cast<std::size_t>(o.most_keyframes)) break;
  }
  if (picked.keyframes.empty()) throw std::runtime_error("turbomap: there is a pose for none of the images");
  return picked;
}

/// Finds everything that the images of one keyframe show.
class keyframe_extractor {
 public:
  keyframe_extractor(const std::vector<calibrated_camera>& cameras, const extract_options& options)
      : options_(options),
        rectify_(cameras),
        find_(options.features),
        match_(options.stereo, options.features.scale_factor, options.features.levels, rectify_.rig().focal(),
               rectify_.rig().baseline) {}

  const simulation::simulated_rig& rig() const { return rectify_.rig(); }

  keyframe_features operator()(const image_files& files) const {
    const cv::Mat left = rectify_.read(files.left, 0);
    return (*this)(left, files.right.empty() ? cv::Mat() : rectify_.read(files.right, 1));
  }
  /// \param left, right  images of rig(): rectified ones of a pinhole pair
  keyframe_features operator()(const cv::Mat& left, const cv::Mat& right) const {
    keyframe_features out;
    out.features = find_(left);
    const bool fisheye = rig().cameras.size() == 2;
    if (!right.empty()) {
      const image_features other = find_(right, fisheye ? 1 : 0);
      if (fisheye)
        add_right(other, out);
      else
        match_(left, right, other, out.features);
    }
    if (fisheye) return out;
    const auto k = rig().cameras[0].parameters();
    for (const keypoint& z : out.features.keypoints)
      out.point.emplace_back(z.depth * Eigen::Vector3d((z.x - k[2]) / k[0], (z.y - k[3]) / k[1], 1));
    return out;
  }

 private:
  void add_right(const image_features& other, keyframe_features& out) const {
    const auto& cameras = rig().cameras;
    const auto pairs =
        view_pairs({out.features, cameras[0]}, {other, cameras[1]}, cameras[0].T_bc.inverse() * cameras[1].T_bc,
                   options_.features.scale_factor, options_.pairs);
    const std::size_t left = out.features.keypoints.size();
    out.features.keypoints.insert(out.features.keypoints.end(), other.keypoints.begin(), other.keypoints.end());
    out.features.descriptors.insert(out.features.descriptors.end(), other.descriptors.begin(), other.descriptors.end());
    out.stereo_partner.assign(out.features.keypoints.size(), -1);
    out.point.assign(out.features.keypoints.size(), Eigen::Vector3d::Zero());
    for (const view_pair& p : pairs) {
      const std::size_t a = static_cast<std::size_t>(p.a), b = left + static_cast<std::size_t>(p.b);
      out.stereo_partner[a] = static_cast<std::int32_t>(b), out.stereo_partner[b] = p.a;
      out.point[a] = out.point[b] = p.point;
      out.features.keypoints[a].depth = static_cast<float>(p.point.z());
    }
  }

  extract_options options_;
  image_rectifier rectify_;
  grid_features find_;
  row_stereo match_;
};

inline recording_meta make_meta(const simulation::simulated_rig& rig, const asl_dataset& data,
                                const extract_options& options) {
  simulation::simulation_options sim;
  sim.imu = !data.imu.empty();
  sim.observation.levels = options.features.levels, sim.observation.scale_factor = options.features.scale_factor;
  recording_meta meta = simulation::make_meta(rig, sim);
  meta.noise_px = meta.disparity_noise_px = -1;  // nobody knows that of a real image
  return meta;
}

/// Makes the recording; write_recording() validates it. Its world is the first keyframe's camera frame; ground truth is the poses
/// at the images' times. Throws bad_file for an image that cannot be read.
/// \param advance  called after each keyframe
template <class Advance>
recording extract(const asl_dataset& data, const picked_keyframes& picked, const extract_options& options,
                  const Advance& advance) {
  const keyframe_extractor find(data.cameras, options);
  simulation::simulated_rig rig = find.rig();
  rig.close_depth = options.close_depth * rig.baseline;
  if (!data.imu.empty()) rig.imu = data.noise;
  std::vector<Eigen::Isometry3d> T_wb;
  for (const picked_keyframe& k : picked.keyframes) T_wb.push_back(k.T_wb);
  T_wb = simulation::drifting_poses(T_wb, options.motion, options.seed);
  const Eigen::Isometry3d T_bc = rig.cameras[0].T_bc, T_rw = (T_wb[0] * T_bc).inverse();

  recorder record(make_meta(rig, data, options));
  point_tracker tracker(rig, options.features.scale_factor, options.tracking);
  const auto files_of = [&](std::size_t i) -> const image_files& { return data.images[picked.keyframes[i].image]; };
  keyframe_features before;
  std::optional<keyframe_features> second;  // found early
  std::vector<std::int32_t> held_before;
  for (std::size_t i = 0; i < picked.keyframes.size(); ++i, advance()) {
    const image_files& files = files_of(i);
    keyframe_features seen = i == 1 && second ? std::move(*second) : find(files);
    const Eigen::Isometry3d T_rc = T_rw * T_wb[i] * T_bc;
    if (rig.baseline == 0 && i == 0 && picked.keyframes.size() > 1) {
      // The first map of one camera is made from two views.
      second = find(files_of(1));
      for (const view_pair& p :
           view_pairs({seen.features, rig.cameras[0]}, {second->features, rig.cameras[0]},
                      T_rc.inverse() * T_rw * T_wb[1] * T_bc, options.features.scale_factor, options.pairs))
        seen.point[static_cast<std::size_t>(p.a)] = p.point;
    }
    const auto associations = tracker.track(static_cast<std::int32_t>(i), seen, T_rc);
    if (rig.baseline == 0) {
      if (i > 0)
        tracker.map_pairs({static_cast<std::int32_t>(i) - 1, before, T_rw * T_wb[i - 1] * T_bc}, held_before,
                          {static_cast<std::int32_t>(i), seen, T_rc}, options.pairs);
      before = seen, held_before = tracker.held();
    }
    keyframe_record k;
    k.t_ns = files.t_ns, k.frame_id = static_cast<std::int32_t>(picked.keyframes[i].image);
    k.previous = static_cast<std::int32_t>(i) - 1;
    k.T_cw = simulation::to_float(T_rc.inverse());
    k.keypoints = seen.features.keypoints, k.descriptors = seen.features.descriptors;
    k.stereo_partner = seen.stereo_partner, k.associations = associations;
    record.add(k);
  }
  for (const auto& [t, pose] : picked.posed) {
    const Eigen::Quaterniond q(pose.linear());
    const Eigen::Vector3d p = pose.translation();
    record.add_ground_truth(t, {p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()});
  }
  for (std::size_t s = 0; s < data.imu.size(); ++s) record.add_imu(data.imu_t_ns[s], data.imu[s]);
  record.data().meta.frames = static_cast<int>(picked.posed.size());
  record.data().meta.keyframes_inserted = static_cast<int>(picked.keyframes.size());
  return std::move(record.data());
}

}  // namespace turbomap::extraction
