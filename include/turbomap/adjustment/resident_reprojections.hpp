// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A group of reprojections as a problem keeps it.

#include <cstddef>
#include <cstdint>

#include "../array.hpp"
#include "../config.hpp"
#include "../error.hpp"
#include "../math/number_checks.hpp"
#include "../plain_vector.hpp"
#include "adjustment_camera.hpp"
#include "factors.hpp"
#include "linearise_reprojections.hpp"
#include "reprojection_cost.hpp"
#include "reprojection_view.hpp"
#include "resident_group.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Reprojections.
template <class Camera, class Kernel, class Frame, class Memory>
class resident_group<reprojections<Camera, Kernel>, Frame, Memory> {
 public:
  static_assert(require_camera<Camera>());
  /// @{
  /// See the list of members at resident_group.
  using group_type = reprojections<Camera, Kernel>;
  static constexpr bool with_landmarks = true, own_landmark_factors = false, reprojects = true;
  /// @}

  /// \param staging  see context::staging_resource()
  resident_group(std::pmr::memory_resource* r, std::pmr::memory_resource* staging)
      : cameras_(r), entries_(r), rows_(staging), resident_rows_(r) {}

  /// @{
  /// See the list of members at resident_group.
  static void check(const group_type& g, int frames, int landmarks) {
    const std::size_t n = g.frame.size();
    require(g.landmark.size() == n, "landmark.size()", g.landmark.size(), "must be that of frame");
    require(g.pixel.size() == n, "pixel.size()", g.pixel.size(), "must be that of frame");
    require(g.information.size() == n, "information.size()", g.information.size(), "must be that of frame");
    require(g.camera.empty() || g.camera.size() == n, "camera.size()", g.camera.size(), "must be that of frame, or 0");
    require(g.stereo.empty() || g.stereo.size() == n, "stereo.size()", g.stereo.size(), "must be that of frame, or 0");
    detail::require_indices(g.frame, frames, "frame");
    detail::require_indices(g.landmark, landmarks, "landmark");
    validate_rig(g.rig);
    check_correlation("stereo_correlation", g.stereo_correlation);
    detail::require_kernel(g.mono_kernel, "mono_kernel");
    detail::require_kernel(g.stereo_kernel, "stereo_kernel");
    detail::require_undefined_chi2(g.undefined_chi2);
    require(g.nearest >= 0 && g.nearest < 1, "nearest", g.nearest, "must be in [0, 1)");
    require(g.rig.count <= 127, "rig.count", g.rig.count, "must be below 128");
    std::uint8_t last = 0;  // of the cameras that are named: no branches in the loop
    for (const std::uint8_t c : g.camera) last = c > last ? c : last;
    require(g.camera.empty() || last < g.rig.count, "camera", static_cast<int>(last), "is not in the rig");
    bool all_have_right = true;
    for (int c = 0; c < g.rig.count; ++c) all_have_right = all_have_right && g.rig[c].bf > 0;
    for (std::size_t i = 0; !all_have_right && i < g.stereo.size(); ++i)
      require(g.stereo[i] == 0 || g.rig[g.camera.empty() ? 0 : g.camera[i]].bf > 0, "stereo", i,
              "is a row whose camera has no right image (bf = 0)");
    std::uint64_t signs = 0;  // whether any is set: no comparison in the loop
    for (std::size_t i = 0; i < n; ++i) signs |= detail::bits_of(g.information[i]);
    for (std::size_t i = 0; signs >> 63 != 0 && i < n; ++i)
      require(!(g.information[i] < 0), "information", g.information[i], "must not be negative");
  }
  static bool all_finite(const group_type& g) {
    bool finite = true;
    const std::uint8_t* const stereo = g.stereo.empty() ? nullptr : g.stereo.data();
    for (std::size_t i = 0; i < g.pixel.size(); ++i) {
      const vec3<double>& z = g.pixel[i];
      finite &= detail::is_finite(z.x);
      finite &= detail::is_finite(z.y);
      finite &= detail::is_finite(g.information[i]);
      if (stereo != nullptr) finite &= (stereo[i] == 0) | detail::is_finite(z.z);
    }
    return finite;
  }

  void describe(const group_type& g, structure_inputs& to) {
    kind_.resize(g.frame.size());
    const std::uint8_t* const stereo = g.stereo.empty() ? nullptr : g.stereo.data();
    if (stereo != nullptr)
      describe_rows(g, [=](std::size_t i, int) { return stereo[i] != 0; });
    else
      describe_rows(g, [&](std::size_t i, int c) {
        const double z = g.pixel[i].z;
        const bool has_baseline = g.rig[c].bf > 0;
        return (z >= 0) & detail::is_finite(z) & has_baseline;
      });
    to.landmark_groups.push_back({g.frame, g.landmark, kind_.data(), 2 * g.rig.count});
  }

  template <class Policy>
  void assign(const Policy& policy, const group_type& g, const adjustment_structure& structure, group_place& place) {
    const group_structure& s = structure.groups[static_cast<std::size_t>(place.landmark_group)];
    begin(g, place);
    prepare_cameras(g, place.distance);
    place.first_chunk += static_cast<int>(s.chunks.size());
    stride_ = s.source.size();
    rows_.resize_discard(row_size * stride_);
    double* const row = rows_.data();
    for (const auto& c : s.chunks) {
      const auto begin = static_cast<std::size_t>(c.begin), end = begin + static_cast<std::size_t>(c.count);
      const bool right = c.kind % 2 == 1;
      const auto copy = [&](std::size_t e, bool real) {
        const auto o = static_cast<std::size_t>(s.source[e]);
        const vec3<double>& z = g.pixel[o];
        row[e] = z.x, row[stride_ + e] = z.y, row[2 * stride_ + e] = right ? z.z : 0;
        row[3 * stride_ + e] = real ? g.information[o] : 0;
      };
      for (std::size_t e = begin; e < end; ++e) copy(e, true);
      for (std::size_t e = end; e % observation_padding != 0; ++e) copy(e, false);
    }
    cameras_.send(policy), resident_rows_.send(policy, rows_.data(), rows_.size());
    entries_.send(policy, s);
  }

  /// @}

  /// assign() of the only group, where the policy makes its lists. \param to  where they belong
  /// \param measurements  where they do
  void make(const group_type& g, std::size_t most_chunks, observation_lists& to, place_observations& measurements) {
    group_place first;
    begin(g, first);
    entries_.make(most_chunks, to);
    stride_ = most_chunks * observation_padding;
    double* const row = resident_rows_.make(row_size * stride_);
    measurements.chunks = to.chunks, measurements.source = to.source, measurements.right_given = !g.stereo.empty();
    measurements.u = row, measurements.v = row + stride_, measurements.u_right = row + 2 * stride_;
    measurements.to_information = row + 3 * stride_;
  }
  /// \param distance  see group_place
  void prepare_cameras(const group_type& g, double distance) {
    cameras_.host().clear();
    for (int c = 0; c < g.rig.count; ++c) {
      cameras_.host().push_back(adjustment_camera<Camera>(g.rig[c], g.stereo_correlation));
      cameras_.host().back().nearest = g.nearest * distance;
    }
  }
  /// The prepared cameras, for the caller to send.
  const plain_vector<adjustment_camera<Camera>>& cameras() const { return cameras_.host(); }
  /// \param cameras  where they are now   \param chunks  how many the policy made
  void made(const adjustment_camera<Camera>* cameras, int chunks) { cameras_.adopt(cameras), entries_.made(chunks); }
  /// [row] of describe().
  const std::uint8_t* kinds() const { return kind_.data(); }
  /// Fetches what the policy made. Waits.
  template <class Policy>
  void fetch(const Policy& policy, adjustment_structure& structure) {
    structure.groups.resize(1);
    entries_.fetch(policy, structure.groups[0]);
    rows_.resize_discard(row_size * stride_);
    for (std::size_t k = 0; k < row_size; ++k)
      copy_out(policy, rows_.data() + k * stride_, resident_rows_.data() + k * stride_,
               entries_.size() * sizeof(double));
    turbomap::synchronize(policy);
  }
  /// @{
  /// See the list of members at resident_group.
  template <class G, class Policy, class A>
  void linearise(const Policy& policy, const estimate_view<Frame>& x, const factor_sums<A>& sums,
                 const cost_sums& costs) const {
    launch_linearise_reprojections<G, Frame::landmark_dof>(policy, view(), x.poses, x.landmarks, sums, costs);
  }
  template <class G, class Policy>
  void cost(const Policy& policy, const estimate_view<Frame>& x, const cost_sums& sums) const {
    launch_sum_reprojection_cost<G>(policy, view(), x.poses, x.landmarks, sums);
  }
  template <class Policy>
  void chi2(const Policy& policy, const estimate_view<Frame>& x, double* chi2, double* depth) const {
    launch_measure_reprojections(policy, view(), x.poses, x.landmarks, chi2, depth);
  }
  /// @}

  /// The derivatives of all rows that are defined, on the host.
  template <class Rows>
  TURBOMAP_ONE_BODY void list_rows(const adjustment_structure& structure,
                                   const typename Frame::template state<double>* states, const vec3<double>* landmarks,
                                   Rows& rows) const {
    const group_structure& s = structure.groups[static_cast<std::size_t>(landmark_group_)];
    for (const auto& c : s.chunks)
      for (int i = c.begin; i < c.begin + c.count; ++i) {
        const isometry<double> T =
            to_isometry<double>(normalised(Frame::template pose<double>(states[static_cast<std::size_t>(c.frame)])));
        if (c.kind % 2 == 1)
          list_row<true>(c, static_cast<std::size_t>(i), s.landmark[static_cast<std::size_t>(i)], T, landmarks, rows);
        else
          list_row<false>(c, static_cast<std::size_t>(i), s.landmark[static_cast<std::size_t>(i)], T, landmarks, rows);
      }
  }

  /// Its entries, where the policy computes.
  const resident_entries<Memory>& entries() const { return entries_; }
  /// Observations, as the caller gave them.
  std::size_t size() const { return size_; }

 private:
  /// Fills in the kinds. No choice in the loops: they take a few rows at once. \param has_right  whether row i, of camera c, is stereo
  template <class HasRight>
  void describe_rows(const group_type& g, HasRight has_right) {
    std::uint8_t* const kind = kind_.data();
    const std::size_t n = kind_.size();
    if (g.camera.empty()) {
      for (std::size_t i = 0; i < n; ++i) kind[i] = has_right(i, 0) ? 1 : 0;
    } else {
      const std::uint8_t* const camera = g.camera.data();
      for (std::size_t i = 0; i < n; ++i)
        kind[i] = static_cast<std::uint8_t>(2 * camera[i] + (has_right(i, camera[i]) ? 1 : 0));
    }
  }
  void begin(const group_type& g, group_place& place) {
    landmark_group_ = place.landmark_group++, first_chunk_ = place.first_chunk;
    size_ = g.frame.size();
    mono_ = g.mono_kernel, stereo_ = g.stereo_kernel, undefined_chi2_ = g.undefined_chi2;
  }
  template <bool Stereo, class Rows>
  void list_row(const observation_chunk& c, std::size_t i, std::int32_t landmark, const isometry<double>& T,
                const vec3<double>* landmarks, Rows& rows) const {
    using P = pack<double, 1>;
    constexpr int size = Stereo ? 3 : 2;
    const vec3<double> X = T * landmarks[static_cast<std::size_t>(landmark)];
    lane_reprojection<double, double, 1> r{};
    r.template compute<true, Stereo>(cameras_.host()[static_cast<std::size_t>(c.kind / 2)], {P(X.x), P(X.y), P(X.z)},
                                     {P(row(0)[i]), P(row(1)[i]), P(row(2)[i])});
    if (!(r.defined.v[0] > 0)) return;
    const double information = row(3)[i];
    double chi2 = 0, rho = 0, weight = 0, by_landmark[3 * size], by_frame[6 * size];
    for (int k = 0; k < size; ++k) chi2 += information * r.e[k].v[0] * r.e[k].v[0];
    (Stereo ? stereo_ : mono_)(chi2, rho, weight);
    for (int k = 0; k < size; ++k) {
      const vec3<double> d{r.d[k][0].v[0], r.d[k][1].v[0], r.d[k][2].v[0]}, turn = cross(X, d);
      const vec3<double> by = transpose(T.R) * d;
      const double all[6] = {turn.x, turn.y, turn.z, d.x, d.y, d.z}, point[3] = {by.x, by.y, by.z};
      for (int m = 0; m < 6; ++m) by_frame[6 * k + m] = all[m];
      for (int m = 0; m < 3; ++m) by_landmark[3 * k + m] = point[m];
    }
    rows.add(size, weight * information, 6, {landmark, by_landmark}, {c.free, by_frame});
  }

  reprojection_view<Camera, Kernel> view() const {
    reprojection_view<Camera, Kernel> v{};
    entries_.point(v);
    v.cameras = cameras_.data();
    const double* row = resident_rows_.data();
    v.u = row, v.v = row + stride_, v.u_right = row + 2 * stride_, v.information = row + 3 * stride_;
    v.mono = mono_, v.stereo = stereo_, v.undefined_chi2 = undefined_chi2_, v.first_chunk = first_chunk_;
    return v;
  }

  const double* row(std::size_t k) const { return rows_.data() + k * stride_; }

  uploaded<adjustment_camera<Camera>, Memory> cameras_;
  resident_entries<Memory> entries_;
  static constexpr std::size_t row_size = 4;
  array<double, host_memory> rows_;  ///< u, v, u_right, information of all entries, one after the other, sent at once
  resident_copy<double, Memory> resident_rows_;
  std::size_t stride_ = 0;
  plain_vector<std::uint8_t> kind_;
  Kernel mono_{}, stereo_{};
  double undefined_chi2_ = 0;
  std::size_t size_ = 0;
  int landmark_group_ = 0, first_chunk_ = 0;
};

TURBOMAP_END_NAMESPACE
