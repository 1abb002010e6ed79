// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The measurements of an adjustment window, read from the keyframe store: nothing of a keypoint is asked of the user's map
/// a second time. And the cameras of all rigs in the window, one after the other.

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "../adjustment/factors.hpp"
#include "../adjustment/gather_measurements.hpp"
#include "../array.hpp"
#include "../camera/rig.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "../math/scale_table.hpp"
#include "../plain_vector.hpp"
#include "adjustment_window.hpp"
#include "in_pieces.hpp"
#include "local_adjustment_options.hpp"
#include "stage.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Results of gather(), valid until the next one: in host memory, and under a device policy pixels and information there too.
template <class Map, class Policy>
class window_measurements {
 public:
  using descriptor = typename map_traits<Map>::descriptor;  ///< type of the map's descriptors
  using camera = typename map_traits<Map>::camera;          ///< type of its cameras
  using view = keyframe_view<descriptor, camera>;           ///< a keyframe in the store

  /// Empty. \param ctx  its resources give the memory, and must outlive this
  explicit window_measurements(const context<Policy>& ctx)
      : inputs_(ctx.resource()),
        resident_pixel_(ctx.resource()),
        resident_information_(ctx.resource()),
        pixel_(ctx.staging_resource()),
        information_(ctx.staging_resource()),
        camera_(ctx.staging_resource()),
        rigs_(ctx.staging_resource()) {}

  /// Waits for the end. \param scales  information of a keypoint: scale_factor^(-2 octave) px^-2
  /// \throws std::invalid_argument  a keypoint that the keyframe in the store does not have; more than 127 cameras
  void gather(const mapping_scope<Map, Policy>& s, const adjustment_window<Map>& window, const pyramid& scales) {
    const std::size_t rows = window.row_count();
    pixel_.resize_discard(rows), information_.resize_discard(rows), camera_.resize_discard(rows);
    cameras_.clear(), first_camera_.clear(), starts_.clear();
    in_pieces(window.frames().size(),
              [&](std::size_t begin, std::size_t end) { gather_frames(s, window, scales, begin, end); });
    for (std::size_t r = 0; r < rows; ++r) {
      const std::size_t camera = first_camera_[static_cast<std::size_t>(window.frame_of_row()[r])] + camera_.data()[r];
      camera_.data()[r] = static_cast<std::uint8_t>(camera);
    }
  }

  /// The rows of the window as an adjustment takes them, with Huber kernels: views of this and of the window.
  reprojections<camera> rows(const adjustment_window<Map>& window, const local_adjustment_options& options) const {
    reprojections<camera> rows;
    rows.rig = cameras();
    rows.frame = window.frame_of_row(), rows.landmark = window.landmark_of_row();
    rows.pixel = pixel_, rows.information = information_, rows.camera = camera_;
    if (resident_pixel_.size() == pixel_.size())
      rows.resident_pixel = resident_pixel_.data(), rows.resident_information = resident_information_.data();
    rows.stereo_correlation = options.stereo_correlation;
    rows.mono_kernel.delta2 = options.mono_chi2, rows.stereo_kernel.delta2 = options.stereo_chi2;
    return rows;
  }

  /// The cameras of all rigs in the window.
  rig_view<camera> cameras() const { return {cameras_.data(), static_cast<int>(cameras_.size())}; }
  /// Whether a row has a u_right that its camera can use.
  bool is_stereo(std::size_t row) const {
    const double u_right = pixel_.data()[row].z;
    return u_right >= 0 && detail::is_finite(u_right) && cameras_[camera_.data()[row]].bf > 0;
  }
  /// Whether its camera sees only what is before it. Others, as fisheyes, may see beyond 90 degrees, where depth is negative.
  bool is_straight(std::size_t row) const {
    pinhole<double> unused;
    return as_pinhole(cameras_[camera_.data()[row]].camera, unused);
  }

 private:
  /// The rows of frames [begin, end): of all, if there is room for them.
  void gather_frames(const mapping_scope<Map, Policy>& s, const adjustment_window<Map>& window, const pyramid& scales,
                     std::size_t begin, std::size_t end) {
    const auto pinned =
        s.store.pin(s.ctx, span<const keyframe_handle>(window.frames().handles().data() + begin, end - begin));
    views_.clear();
    int most = 1;
    for (std::size_t f = 0; f < end - begin; ++f) {
      views_.push_back(pinned[f]);
      most = pinned[f].camera_count > most ? pinned[f].camera_count : most;
    }
    const bool all = end - begin == window.frames().size();
    place_.clear(), frame_.clear(), keypoint_.clear();
    for (std::size_t r = 0; r < window.row_count(); ++r) {
      const auto row = window.at(r);
      const std::size_t f = static_cast<std::size_t>(row.frame) - begin;  // wraps where it is before the first
      if (f >= views_.size()) continue;
      require(row.keypoint < views_[f].keypoint_count, "keypoint", row.keypoint,
              "is not a keypoint of the keyframe in the store");
      if (all) continue;
      place_.push_back(r), frame_.push_back(static_cast<std::int32_t>(f)), keypoint_.push_back(row.keypoint);
    }
    if (all) {
      fetch(s.ctx, window.frame_of_row(), window.keypoint_of_row(), scales, most, pixel_.data(), information_.data(),
            camera_.data());
    } else {
      const std::size_t rows = place_.size();
      piece_pixel_.resize(rows), piece_information_.resize(rows), piece_camera_.resize(rows);
      fetch(s.ctx, frame_, keypoint_, scales, most, piece_pixel_.data(), piece_information_.data(),
            piece_camera_.data());
      for (std::size_t i = 0; i < rows; ++i) {
        const std::size_t r = place_[i];
        pixel_.data()[r] = piece_pixel_[i], information_.data()[r] = piece_information_[i];
        camera_.data()[r] = piece_camera_[i];
      }
    }
    list_cameras(most);
  }
  /// The launches, and their results on the host.
  void fetch(context<Policy>& ctx, const plain_vector<std::int32_t>& frame_of_row,
             const plain_vector<std::int32_t>& keypoint_of_row, const pyramid& scales, int most, vec3<double>* pixel,
             double* information, std::uint8_t* camera_of_row) {
    const std::size_t frames = views_.size(), rows = frame_of_row.size();
    const std::size_t cameras = frames * static_cast<std::size_t>(most);
    float scale[scale_table_size], sigma2[scale_table_size];
    fill_scales(scales, scale, sigma2);
    ctx.begin_call();
    packed_inputs inputs;
    const auto views = inputs.template place<view>(frames);
    const auto frame = inputs.template place<std::int32_t>(rows), keypoint = inputs.template place<std::int32_t>(rows);
    const auto table = inputs.template place<float>(scale_table_size);
    const upload_block block = ctx.begin_upload(inputs_, inputs.bytes());
    views.copy(block, views_.data());
    frame.copy(block, frame_of_row.data());
    keypoint.copy(block, keypoint_of_row.data());
    table.copy(block, sigma2);
    ctx.send(block, inputs.bytes());

    measurement_rows<descriptor, camera> out{
        views.resident(block), frame.resident(block), keypoint.resident(block), table.resident(block), pixel,
        information,           camera_of_row,         static_cast<int>(rows)};
    if constexpr (!on_host) {  // they stay: an adjustment reads them there
      resident_pixel_.resize_discard(rows), resident_information_.resize_discard(rows);
      out.pixel = resident_pixel_.data(), out.information = resident_information_.data();
      out.camera = ctx.template scratch<std::uint8_t>(rows);
    }
    auto* rigs = ctx.template scratch<rig_camera<camera>>(cameras);
    fill_bytes(ctx.policy(), rigs, 0, cameras * sizeof(rig_camera<camera>));  // rigs with fewer cameras leave places
    launch_gather_measurements(ctx.policy(), static_cast<int>(rows), out);
    launch_gather_rigs(ctx.policy(), static_cast<int>(frames), out.frames, rigs, most);
    rigs_.resize_discard(cameras);
    if constexpr (!on_host) {
      copy_out(ctx.policy(), pixel, out.pixel, rows * sizeof(vec3<double>));
      copy_out(ctx.policy(), information, out.information, rows * sizeof(double));
      copy_out(ctx.policy(), camera_of_row, out.camera, rows);
    }
    copy_out(ctx.policy(), static_cast<void*>(rigs_.data()), rigs, cameras * sizeof(rig_camera<camera>));
    ctx.synchronize();
  }
  /// Each rig once: keyframes of one system share theirs.
  void list_cameras(int most) {
    for (std::size_t f = 0; f < views_.size(); ++f) {
      const rig_camera<camera>* mine = rigs_.data() + f * static_cast<std::size_t>(most);
      const auto count = static_cast<std::size_t>(views_[f].camera_count);
      std::size_t first = cameras_.size();
      for (const auto& known : starts_)
        if (known.count == count && same(cameras_.data() + known.first, mine, count)) first = known.first;
      first_camera_.push_back(first);
      if (first != cameras_.size()) continue;
      starts_.push_back({first, count});
      cameras_.append(mine, count);
      require(cameras_.size() <= 127, "cameras of the keyframes", cameras_.size(),
              "must be 127 or fewer in one adjustment; those of equal bytes count once");
    }
  }
  /// The resolution does not matter here: it may be measured anew for a larger image.
  static bool same(const rig_camera<camera>* a, const rig_camera<camera>* b, std::size_t count) {
    for (std::size_t c = 0; c < count; ++c)
      if (std::memcmp(&a[c].camera, &b[c].camera, sizeof a[c].camera) != 0 ||
          std::memcmp(&a[c].T_camera_body, &b[c].T_camera_body, sizeof a[c].T_camera_body) != 0 || a[c].bf != b[c].bf)
        return false;
    return true;
  }

  struct rig_place {
    std::size_t first, count;
  };
  static constexpr bool on_host = is_host_accessible_v<memory_of_t<Policy>>;

  array<std::byte, memory_of_t<Policy>> inputs_;
  array<vec3<double>, memory_of_t<Policy>> resident_pixel_;  ///< of the rows gathered last, on a device
  array<double, memory_of_t<Policy>> resident_information_;
  list_of<view> views_;  ///< of the frames that are gathered at a time
  // Where those are not all: their rows, the numbers of their frames among them, and results.
  plain_vector<std::size_t> place_;
  plain_vector<std::int32_t> frame_, keypoint_;
  plain_vector<vec3<double>> piece_pixel_;
  plain_vector<double> piece_information_;
  plain_vector<std::uint8_t> piece_camera_;
  array<vec3<double>, host_memory> pixel_;
  array<double, host_memory> information_;
  array<std::uint8_t, host_memory> camera_;
  array<rig_camera<camera>, host_memory> rigs_;  ///< [frame][most]
  plain_vector<rig_camera<camera>> cameras_;     ///< of the distinct rigs
  plain_vector<rig_place> starts_;
  plain_vector<std::size_t> first_camera_;  ///< of each frame
};

TURBOMAP_END_NAMESPACE
