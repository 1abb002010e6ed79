// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The keypoints of every pair of cameras in epipolar order, for searches on the host. All points that a keypoint can be the
/// image of lie in one plane through both camera centres; planes through that line are ordered by one angle. So keypoints are
/// sorted by the angle of their plane once, and those that a keypoint of the other image may match are then a short window of
/// the sorted list.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "../config.hpp"
#include "../context.hpp"
#include "epipolar_order.hpp"
#include "search_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Which keypoints are sorted: those of the neighbours, or those of the query.
enum class sorted_side { candidates, queries };

/// The tables of one search, in scratch memory: one for each neighbour n, query camera a and neighbour camera b. Each owns
/// total_buckets() + 1 offsets, and as many keypoints and keys as its side has. Host only.
template <class Descriptor, class Camera, sorted_side Side = sorted_side::candidates>
struct ordered_tables {
  static constexpr bool of_candidates =
      Side == sorted_side::candidates;  ///< whether candidates are sorted, not queries

  search_view<Descriptor, Camera> search;  ///< keyframes and pairs
  std::int32_t* offsets;                   ///< of each table, total_buckets() + 1
  std::int32_t* sorted;                    ///< keypoints by bucket, one table after the other
  plane_codes codes;                       ///< of `sorted`, in its order. Null: not made
  float* sorted_width;                     ///< of each table, rad
  std::int32_t* keypoints;                 ///< those of the camera, before sorting
  plane_interval* intervals;               ///< of each keypoint, before sorting
  std::int32_t* keys;                      ///< buckets, before sorting
  /// Of `sorted`, in its order. Null: not copied.
  typename Descriptor::element* descriptors;

  /// One table.
  epipolar_table view(int n, int a, int b) const {
    const std::int64_t table = number(n, a, b);
    const std::int64_t slice = first(n, a, b);
    const plane_codes its_codes =
        codes.angles == nullptr ? plane_codes{}
                                : plane_codes{codes.angles + slice, codes.half_widths + slice, codes.least + slice};
    return {offsets + table * (epipolar_order_layout::total_buckets() + 1), sorted + slice, its_codes,
            sorted_width + table};
  }
  /// The descriptors of one table.
  typename Descriptor::element* descriptors_of(int n, int a, int b) const {
    return descriptors + first(n, a, b) * Descriptor::elements;
  }
  /// Measures the candidates (side b) of a pair.
  plane_measure candidate_measure(const pair_geometry& g, int n, int b) const {
    if (g.straight) return plane_measure::line(g, std::sqrt(search.options.line_chi2), std::fmin(g.K_b.fx, g.K_b.fy));
    return plane_measure::ray(g, std::sqrt(search.options.reprojection_chi2),
                              search.neighbour(n).cameras[b].resolution);
  }
  /// Measures the query keypoints (side a), by bearings in their own camera. A line test measures from the exact query
  /// pixel: no width of its own.
  plane_measure query_measure(const pair_geometry& g, int a) const {
    if (g.straight) return plane_measure::line(g, 0, 1).turned(g.T_ba.R);
    return plane_measure::ray(g, std::sqrt(search.options.reprojection_chi2), search.query().cameras[a].resolution)
        .turned(g.T_ba.R);
  }
  /// The plane interval of a candidate of neighbour n.
  plane_interval candidate_interval(const plane_measure& measure, int n, std::int32_t keypoint) const {
    const auto& neighbour = search.neighbour(n);
    const vec3<float>& ray = neighbour.bearing[keypoint];
    return measure(ray, measure.spread(ray.z, search.scale[neighbour.octave[keypoint]]));
  }
  /// The plane interval of a query keypoint.
  plane_interval query_interval(const plane_measure& measure, std::int32_t keypoint) const {
    const vec3<float>& ray = search.query().bearing[keypoint];
    return measure(ray, measure.spread(ray.z, search.scale[search.query().octave[keypoint]]));
  }

 private:
  std::int64_t number(int n, int a, int b) const {
    return (std::int64_t{n} * search.query_cameras + a) * search.neighbour_cameras + b;
  }
  /// Entries of each table of neighbour n that hold keypoints.
  std::size_t capacity(int n) const {
    if constexpr (of_candidates) return static_cast<std::size_t>(search.candidate_end[n] - search.candidate_begin[n]);
    return static_cast<std::size_t>(search.slot_count);
  }
  /// Entries of all tables before.
  std::int64_t first(int n, int a, int b) const {
    const std::int64_t padding = number(n, a, b) * plane_codes::padding;
    if constexpr (of_candidates) {
      const std::int64_t cameras = search.query_cameras * search.neighbour_cameras;
      return padding + cameras * search.candidate_begin[n] +
             (a * search.neighbour_cameras + b) * static_cast<std::int64_t>(capacity(n));
    }
    return padding + number(n, a, b) * search.slot_count;
  }
};

/// Index = table (n, a, b).
template <class Descriptor, class Camera, sorted_side Side>
struct build_ordered_table {
  ordered_tables<Descriptor, Camera, Side> tables;  ///< where it is built

  /// Builds table i.
  void operator()(int i) const {
    const auto& search = tables.search;
    const int b = i % search.neighbour_cameras, a = i / search.neighbour_cameras % search.query_cameras;
    const int n = i / (search.neighbour_cameras * search.query_cameras);
    epipolar_table table = tables.view(n, a, b);
    const std::ptrdiff_t slice = table.candidates - tables.sorted;
    const bool used = b < search.neighbour(n).camera_count && search.compares(n, a, b);
    const int count = used ? collect(n, a, b, tables.keypoints + slice, tables.intervals + slice) : 0;
    table.build(tables.keypoints + slice, tables.intervals + slice, tables.keys + slice, count);
    if (tables.descriptors == nullptr) return;
    auto* to = tables.descriptors_of(n, a, b);
    const auto& from = tables.of_candidates ? search.neighbour(n) : search.query();
    for (int k = 0; k < count; ++k, to += Descriptor::elements)
      std::memcpy(to, from.descriptor_of(table.candidates[k]), Descriptor::bytes);
  }

 private:
  /// The keypoints of this side that the camera sees, with their intervals.
  int collect(int n, int a, int b, std::int32_t* keypoints, plane_interval* intervals) const {
    const auto& search = tables.search;
    const pair_geometry& g = search.pair(n, a, b);
    int count = 0, measured = 0;
    ray_batch rays;
    if constexpr (Side == sorted_side::candidates) {
      const plane_measure measure = tables.candidate_measure(g, n, b);
      const auto& neighbour = search.neighbour(n);
      const auto measure_rest = [&] {
        measure(rays, count - measured, intervals + measured);
        measured = count;
      };
      for (int k = search.candidate_begin[n]; k < search.candidate_end[n]; ++k) {
        const std::int32_t keypoint = search.candidates[k];
        if (neighbour.camera_of(keypoint) != b) continue;
        const vec3<float>& ray = neighbour.bearing[keypoint];
        rays.set(count - measured, ray, measure.spread(ray.z, search.scale[neighbour.octave[keypoint]]));
        keypoints[count++] = keypoint;
        if (count - measured == ray_batch::size) measure_rest();
      }
      measure_rest();
    } else {
      const plane_measure measure = tables.query_measure(g, a);
      for (int k = 0; k < search.slot_count; ++k) {
        const std::int32_t keypoint = search.queries[k];
        if (search.query().camera_of(keypoint) != a) continue;
        keypoints[count] = keypoint;
        intervals[count++] = tables.query_interval(measure, keypoint);
      }
    }
    return count;
  }
};

/// Memory for the tables of all pairs, valid as long as the scratch is.
/// \param for_search  with codes and descriptors, which filters do not read
template <sorted_side Side, class Descriptor, class Camera, class Memory>
ordered_tables<Descriptor, Camera, Side> take_tables(scratch_arena<Memory>& scratch,
                                                     const search_view<Descriptor, Camera>& search, bool for_search) {
  const auto cameras =
      static_cast<std::size_t>(search.query_cameras) * static_cast<std::size_t>(search.neighbour_cameras);
  const auto neighbours = static_cast<std::size_t>(search.neighbour_count), tables = neighbours * cameras;
  const std::int32_t last_candidate = neighbours == 0 ? 0 : search.candidate_end[neighbours - 1];
  const std::size_t entries =
      tables * plane_codes::padding + cameras * (Side == sorted_side::candidates
                                                     ? static_cast<std::size_t>(last_candidate)
                                                     : neighbours * static_cast<std::size_t>(search.slot_count));
  ordered_tables<Descriptor, Camera, Side> result{};
  result.search = search;
  result.offsets = scratch.template take<std::int32_t>(tables * (epipolar_order_layout::total_buckets() + 1));
  result.sorted = scratch.template take<std::int32_t>(entries);
  result.sorted_width = scratch.template take<float>(tables);
  result.keypoints = scratch.template take<std::int32_t>(entries);
  result.intervals = scratch.template take<plane_interval>(entries);
  result.keys = scratch.template take<std::int32_t>(entries);
  if (for_search) {
    result.codes.angles = scratch.template take<std::uint16_t>(entries);
    result.codes.half_widths = scratch.template take<std::uint16_t>(entries);
    result.codes.least = scratch.template take<std::int16_t>(entries);
    result.descriptors = scratch.template take<typename Descriptor::element>(entries * Descriptor::elements);
  }
  return result;
}

/// Sorts the keypoints of all pairs. O(keypoints x cameras).
template <class Derived, class Descriptor, class Camera, sorted_side Side>
void launch_build_tables(const thrust::execution_policy<Derived>& policy,
                         const ordered_tables<Descriptor, Camera, Side>& tables) {
  const auto& search = tables.search;
  for_each_index(derived(policy), search.neighbour_count * search.query_cameras * search.neighbour_cameras,
                 build_ordered_table<Descriptor, Camera, Side>{tables});
}

TURBOMAP_END_NAMESPACE
