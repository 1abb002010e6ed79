// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// From the caller's keyframes to a search in the memory of the policy: everything is checked first, then packed into one
/// block and sent in one copy.

#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../context.hpp"
#include "../descriptor/descriptor_concept.hpp"
#include "../error.hpp"
#include "../math/functions.hpp"
#include "../math/scale_table.hpp"
#include "../store/keyframe_validation.hpp"
#include "../store/posed_keyframe.hpp"
#include "correspondences.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Fills a `correspondences` for one call. Throws before anything of the previous result is touched.
template <class Descriptor, class Camera, class Policy>
class search_setup {
 public:
  using posed = posed_keyframe<Descriptor, Camera>;
  using distance_type = typename Descriptor::distance_type;

  search_setup(context<Policy>& ctx, correspondences<Descriptor, Camera, Policy>& result)
      : ctx_(ctx), result_(result) {}

  /// Throws std::invalid_argument naming what is wrong with the arguments of a call.
  static void check(const posed& query, span<const posed> neighbours, const search_options& options) {
    check_options(options);
    check_keyframe("query", query);
    for (std::size_t n = 0; n < neighbours.size(); ++n) check_keyframe(name(n).c_str(), neighbours[n]);
  }

  /// Computes the geometry of every pair of cameras.
  void prepare_pairs() {
    const auto& search = result_.view_;
    for_each_index(ctx_.policy(), search.neighbour_count * search.query_cameras * search.neighbour_cameras,
                   prepare_pair<Descriptor, Camera>{search});
  }

  /// Checks, packs and sends.
  void operator()(const posed& query, span<const posed> neighbours, const search_options& options) {
    check(query, neighbours, options);
    const int neighbour_count = static_cast<int>(neighbours.size());
    int cameras = 1;
    std::int64_t mask_bytes = 0, candidate_count = 0;
    for (const posed& n : neighbours) {
      cameras = n.view.camera_count > cameras ? n.view.camera_count : cameras;
      mask_bytes += n.view.keypoint_count;
      candidate_count += unmapped(n);
    }
    require(candidate_count * cameras * query.view.camera_count < (std::int64_t{1} << 31),
            "candidates of all neighbours", candidate_count, "must be below 2^31 in one call");
    const std::int64_t slots = unmapped(query), results = slots * neighbour_count;
    const std::int64_t pairs = static_cast<std::int64_t>(neighbour_count) * cameras * query.view.camera_count;
    require(pairs < (std::int64_t{1} << 31), "pairs of cameras", pairs, "must be below 2^31 in one call");
    const std::int64_t words = static_cast<std::int64_t>(neighbour_count) * query.view.groups.group_count;
    require(words < (std::int64_t{1} << 31), "query groups x neighbours", words, "must be below 2^31 in one call");
    require(mask_bytes < (std::int64_t{1} << 31), "keypoints of all neighbours", mask_bytes,
            "must be below 2^31 in one call");
    require(results < (std::int64_t{1} << 31), "query keypoints x neighbours", results,
            "must be below 2^31 in one call");

    // Layout of the block.
    std::size_t bytes = 0;
    const auto place = [&bytes](std::size_t size) { return std::exchange(bytes, align_up(bytes + size)); };
    const std::size_t keyframes_at = place(sizeof(keyframe_view<Descriptor, Camera>) * (1 + neighbours.size()));
    const std::size_t poses_at = place(sizeof(rigid_transform<double>) * (1 + neighbours.size()));
    const std::size_t mask_offset_at = place(sizeof(std::int32_t) * neighbours.size());
    const std::size_t candidate_offset_at = place(sizeof(std::int32_t) * (1 + neighbours.size()));
    const std::size_t candidates_at = place(sizeof(std::int32_t) * static_cast<std::size_t>(candidate_count));
    const std::size_t queries_at = place(sizeof(std::int32_t) * static_cast<std::size_t>(slots));
    const std::size_t scale_at = place(sizeof(float) * scale_table_size);
    const std::size_t sigma2_at = place(sizeof(float) * scale_table_size);
    const std::size_t mask_at = place(static_cast<std::size_t>(mask_bytes));

    result_.clear();  // from here on memory may run out, and the arrays of the last result are being replaced
    result_.queries_.reserve(static_cast<std::size_t>(slots));
    result_.pairs_.resize_discard(static_cast<std::size_t>(neighbour_count) * query.view.camera_count * cameras);
    result_.match_.resize_discard(static_cast<std::size_t>(results));
    result_.distance_.resize_discard(static_cast<std::size_t>(results));
    const upload_block block = ctx_.begin_upload(result_.inputs_, bytes);

    auto* views = reinterpret_cast<keyframe_view<Descriptor, Camera>*>(block.host + keyframes_at);
    auto* poses = reinterpret_cast<rigid_transform<double>*>(block.host + poses_at);
    auto* mask_offset = reinterpret_cast<std::int32_t*>(block.host + mask_offset_at);
    auto* candidate_offset = reinterpret_cast<std::int32_t*>(block.host + candidate_offset_at);
    auto* candidates = reinterpret_cast<std::int32_t*>(block.host + candidates_at);
    auto* mask = reinterpret_cast<std::uint8_t*>(block.host + mask_at);
    views[0] = query.view;
    poses[0] = query.T_cw;
    result_.queries_.resize(static_cast<std::size_t>(slots));
    list_unmapped(query, result_.queries_.data());
    if (slots != 0)
      std::memcpy(block.host + queries_at, result_.queries_.data(), sizeof(std::int32_t) * result_.queries_.size());
    std::int32_t masks = 0, listed = 0;
    for (int n = 0; n < neighbour_count; ++n) {
      const posed& k = neighbours[static_cast<std::size_t>(n)];
      views[1 + n] = k.view;
      poses[1 + n] = k.T_cw;
      mask_offset[n] = masks;
      candidate_offset[n] = listed;
      if (k.has_point.empty())
        std::memset(mask + masks, 0, static_cast<std::size_t>(k.view.keypoint_count));
      else
        std::memcpy(mask + masks, k.has_point.data(), k.has_point.size());
      masks += k.view.keypoint_count;
      listed += list_unmapped(k, candidates + listed);
    }
    candidate_offset[neighbour_count] = listed;
    fill_scales(options.scales, reinterpret_cast<float*>(block.host + scale_at),
                reinterpret_cast<float*>(block.host + sigma2_at));
    ctx_.send(block, bytes);

    auto& v = result_.view_;
    v.keyframes = resident<keyframe_view<Descriptor, Camera>>(block, keyframes_at);
    v.T_cw = resident<rigid_transform<double>>(block, poses_at);
    v.has_point = resident<std::uint8_t>(block, mask_at);
    v.has_point_offset = resident<std::int32_t>(block, mask_offset_at);
    v.candidates = resident<std::int32_t>(block, candidates_at);
    v.candidate_offset = resident<std::int32_t>(block, candidate_offset_at);
    v.queries = resident<std::int32_t>(block, queries_at);
    v.scale = resident<float>(block, scale_at);
    v.sigma2 = resident<float>(block, sigma2_at);
    v.pairs = result_.pairs_.data();
    v.match = result_.match_.data();
    v.distance = result_.distance_.data();
    v.neighbour_count = neighbour_count;
    v.slot_count = static_cast<int>(slots);
    v.query_cameras = query.view.camera_count;
    v.neighbour_cameras = cameras;
    v.max_distance = static_cast<distance_type>(options.max_distance);
    v.options = options;
    result_.candidate_count_ = candidate_count;
    result_.neighbour_keypoint_count_ = mask_bytes;
    result_.has_angles_ = query.view.angle != nullptr;
    for (const posed& n : neighbours) result_.has_angles_ = result_.has_angles_ && n.view.angle != nullptr;
  }

 private:
  static std::string name(std::size_t n) { return "neighbours[" + std::to_string(n) + "]"; }

  template <class T>
  static const T* resident(const upload_block& block, std::size_t at) {
    return reinterpret_cast<const T*>(block.resident + at);
  }

  static void check_options(const search_options& o) {
    require(o.max_distance >= 0 && o.max_distance < static_cast<double>(Descriptor::worst), "options.max_distance",
            o.max_distance, "must be a distance of the descriptor");
    require(o.scales.levels >= 1 && o.scales.levels <= 256, "options.scales.levels", o.scales.levels,
            "must be in [1, 256]: octaves are bytes");
    require(o.scales.scale_factor >= 1 && detail::is_finite(o.scales.scale_factor), "options.scales.scale_factor",
            o.scales.scale_factor, "must be finite and at least 1");
    require(o.line_chi2 > 0 && detail::is_finite(o.line_chi2), "options.line_chi2", o.line_chi2,
            "must be finite and positive");
    require(o.reprojection_chi2 > 0 && detail::is_finite(o.reprojection_chi2), "options.reprojection_chi2",
            o.reprojection_chi2, "must be finite and positive");
    require(o.epipole_radius >= 0, "options.epipole_radius", o.epipole_radius, "must not be negative");
    require(o.max_parallax_cosine <= 1, "options.max_parallax_cosine", o.max_parallax_cosine, "must be a cosine");
  }

  static void check_keyframe(const char* which, const posed& k) {
    const std::string argument(which);
    const rigid_transform<double>& T = k.T_cw;
    const double sum = T.qx + T.qy + T.qz + T.qw + T.tx + T.ty + T.tz;
    const double norm = T.qx * T.qx + T.qy * T.qy + T.qz * T.qz + T.qw * T.qw;
    if (!detail::is_finite(sum)) reject(argument + ".T_cw", sum, "a pose must be finite");
    if (!(std::abs(norm - 1) < 1e-3)) reject(argument + ".T_cw squared quaternion norm", norm, "must be 1");
    if (!(k.view.keypoint_count >= 0))
      reject(argument + ".view.keypoint_count", k.view.keypoint_count, "must not be negative");
    if (!(k.view.camera_count >= 1 && k.view.cameras != nullptr))
      reject(argument + ".view.camera_count", k.view.camera_count, "a keyframe needs a rig of at least one camera");
    if (!(k.has_point.empty() || k.has_point.size() == static_cast<std::size_t>(k.view.keypoint_count)))
      reject(argument + ".has_point.size()", k.has_point.size(), "must be 0 or the number of keypoints");
    if (k.view.keypoint_count > 0 && (k.view.pixel == nullptr || k.view.bearing == nullptr ||
                                      k.view.octave == nullptr || k.view.descriptor == nullptr))
      reject(argument + ".view", "null", "pixel, bearing, octave and descriptor are needed");
    if constexpr (std::is_same_v<memory_of_t<Policy>, host_memory>)  // a device's views cannot be read here
      if (!has_cameras(k.view)) require_cameras(k.view, (argument + ".view").c_str());
  }

  static std::int64_t unmapped(const posed& k) {
    if (k.has_point.empty()) return k.view.keypoint_count;
    std::int64_t count = 0;
    for (const std::uint8_t m : k.has_point) count += m == 0;
    return count;
  }
  static std::int32_t list_unmapped(const posed& k, std::int32_t* list) {
    std::int32_t count = 0;
    for (std::int32_t i = 0; i < k.view.keypoint_count; ++i)
      if (k.has_point.empty() || k.has_point[static_cast<std::size_t>(i)] == 0) list[count++] = i;
    return count;
  }

  context<Policy>& ctx_;
  correspondences<Descriptor, Camera, Policy>& result_;
};

TURBOMAP_END_NAMESPACE
