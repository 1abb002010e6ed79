// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// From the caller's points and keyframes to a search in the memory of the policy: everything is checked first, then
/// packed into one block and sent in one copy. What the policy can read where it is, is not copied.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../context.hpp"
#include "../math/scale_table.hpp"
#include "duplicate_check.hpp"
#include "duplicates.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Fills a `duplicates` for one call. Throws before anything of the previous result is touched.
template <class Descriptor, class Camera, class Policy>
class duplicate_setup {
 public:
  using target_type = duplicate_target<Descriptor, Camera>;
  using view_type = duplicate_view<Descriptor, Camera>;
  using points_type = map_point_view<Descriptor>;

  duplicate_setup(context<Policy>& ctx, duplicates<Descriptor, Camera, Policy>& result) : ctx_(ctx), result_(result) {}

  /// Checks, packs and sends.
  view_type operator()(const points_type& points, span<const target_type> targets, const duplicate_options& options) {
    check_duplicate_options<Descriptor>(options);
    check_map_points(points, options);
    const std::size_t requests = check_targets(targets, points.count), count = static_cast<std::size_t>(points.count);

    const std::size_t keyframes_at = place(sizeof(keyframe_view<Descriptor, Camera>) * targets.size());
    const std::size_t poses_at = place(sizeof(rigid_transform<double>) * targets.size());
    const std::size_t requests_at = place(sizeof(duplicate_request) * requests);
    const std::size_t scale_at = place(sizeof(float) * scale_table_size);
    const std::size_t sigma2_at = place(sizeof(float) * scale_table_size);
    const points_layout at = place_points(points);
    const std::size_t skip_at = bytes_;
    if (copies)
      for (const target_type& t : targets) place(t.skip.size());

    result_.clear();  // from here on memory may run out, and the arrays of the last result are being replaced
    result_.kept_ = false;
    result_.requests_.reserve(requests);
    result_.cameras_.resize_discard(requests);
    result_.hits_.resize_discard(requests * count);
    if (options.keep_trials) result_.trials_.resize_discard(requests * count);
    const upload_block block = ctx_.begin_upload(result_.inputs_, bytes_);

    view_type v;
    v.keyframes = resident<keyframe_view<Descriptor, Camera>>(block, keyframes_at);
    v.T_cw = resident<rigid_transform<double>>(block, poses_at);
    v.requests = resident<duplicate_request>(block, requests_at);
    v.scale = resident<float>(block, scale_at);
    v.sigma2 = resident<float>(block, sigma2_at);
    fill_scales(options.scales, at_host<float>(block, scale_at), at_host<float>(block, sigma2_at));
    v.points = copies ? send_points(block, points, at) : points;
    fill_targets(block, targets, points.count, keyframes_at, poses_at, skip_at);
    if (requests != 0)
      std::memcpy(block.host + requests_at, result_.requests_.data(), sizeof(duplicate_request) * requests);
    ctx_.send(block, bytes_);

    v.cameras = result_.cameras_.data();
    v.hits = result_.hits_.data();
    v.trials = options.keep_trials ? result_.trials_.data() : nullptr;
    v.target_count = static_cast<int>(targets.size());
    v.request_count = static_cast<int>(requests);
    v.max_distance = static_cast<typename Descriptor::distance_type>(options.max_distance);
    v.min_range_factor = static_cast<float>(options.min_range_factor);
    v.max_range_factor = static_cast<float>(options.max_range_factor);
    v.options = options;
    result_.point_count_ = points.count;
    result_.kept_ = options.keep_trials;
    return v;
  }

 private:
  /// A host policy reads the caller's points and skip bytes where they are.
  static constexpr bool copies = !std::is_same_v<memory_of_t<Policy>, host_memory>;

  struct points_layout {
    std::size_t position, normal, min_distance, max_distance, descriptor;
  };

  static std::size_t check_targets(span<const target_type> targets, int point_count) {
    std::int64_t requests = 0;
    for (std::size_t i = 0; i < targets.size(); ++i) {
      check_duplicate_target(i, targets[i], point_count);
      requests += targets[i].view.camera_count;
      require(requests * (point_count > 0 ? point_count : 1) < (std::int64_t{1} << 31),
              "points x cameras of all targets", requests * point_count, "must be below 2^31 in one call");
    }
    return static_cast<std::size_t>(requests);
  }

  std::size_t place(std::size_t size) { return std::exchange(bytes_, align_up(bytes_ + size)); }
  points_layout place_points(const points_type& p) {
    if (!copies) return {};
    const auto n = static_cast<std::size_t>(p.count);
    return {place(sizeof *p.position * n), place(sizeof *p.normal * n), place(sizeof *p.min_distance * n),
            place(sizeof *p.max_distance * n), place(sizeof *p.descriptor * Descriptor::elements * n)};
  }

  template <class T>
  static const T* resident(const upload_block& block, std::size_t at) {
    return reinterpret_cast<const T*>(block.resident + at);
  }
  template <class T>
  static T* at_host(const upload_block& block, std::size_t at) {
    return reinterpret_cast<T*>(block.host + at);
  }
  /// An array of the caller's into the block; null stays null.
  template <class T>
  static const T* pack(const upload_block& block, std::size_t at, const T* source, std::size_t n) {
    if (source == nullptr || n == 0) return nullptr;
    std::memcpy(block.host + at, source, sizeof(T) * n);
    return resident<T>(block, at);
  }
  static points_type send_points(const upload_block& block, const points_type& p, const points_layout& at) {
    const auto n = static_cast<std::size_t>(p.count);
    return {p.count,
            pack(block, at.position, p.position, n),
            pack(block, at.normal, p.normal, n),
            pack(block, at.min_distance, p.min_distance, n),
            pack(block, at.max_distance, p.max_distance, n),
            pack(block, at.descriptor, p.descriptor, n * Descriptor::elements)};
  }

  void fill_targets(const upload_block& block, span<const target_type> targets, int point_count,
                    std::size_t keyframes_at, std::size_t poses_at, std::size_t skip_at) {
    auto* views = at_host<keyframe_view<Descriptor, Camera>>(block, keyframes_at);
    auto* poses = at_host<rigid_transform<double>>(block, poses_at);
    for (std::size_t i = 0; i < targets.size(); ++i) {
      const target_type& t = targets[i];
      views[i] = t.view;
      poses[i] = t.T_cw;
      const std::uint8_t* skip = t.skip.empty() ? nullptr : t.skip.data();
      if (copies) skip = pack(block, std::exchange(skip_at, align_up(skip_at + t.skip.size())), skip, t.skip.size());
      for (int c = 0; c < t.view.camera_count; ++c)
        result_.requests_.push_back(
            {static_cast<std::int32_t>(i), c,
             skip == nullptr ? nullptr : skip + static_cast<std::size_t>(c) * static_cast<std::size_t>(point_count)});
    }
  }

  context<Policy>& ctx_;
  duplicates<Descriptor, Camera, Policy>& result_;
  std::size_t bytes_ = 0;
};

TURBOMAP_END_NAMESPACE
