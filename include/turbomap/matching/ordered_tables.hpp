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
#include "../math/pack.hpp"
#include "epipolar_order.hpp"
#include "search_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Which keypoints are sorted: those of the neighbours, or those of the query.
enum class sorted_side { candidates, queries };

/// The tables of one search, in scratch memory: one for each neighbour n, query camera a and neighbour camera b. Each owns
/// offset_count() offsets, and room for as many keypoints as its side has. Host only.
template <class Descriptor, class Camera, sorted_side Side = sorted_side::candidates>
struct ordered_tables {
  static constexpr bool of_candidates =
      Side == sorted_side::candidates;  ///< whether candidates are sorted, not queries

  search_view<Descriptor, Camera> search;  ///< keyframes and pairs
  std::int32_t* offsets;                   ///< of each table, offset_count()
  std::int32_t* sorted;                    ///< keypoints by bucket, one table after the other
  plane_codes codes;                       ///< of `sorted`, in its order. Null: not made
  std::uint16_t* sorted_width;             ///< of each table: epipolar_table::sorted_width
  std::int32_t* keypoints;                 ///< those of the camera, before sorting
  plane_codes unsorted;                    ///< of `keypoints`, in their order
  /// Of `sorted`, in its order. Null: not copied.
  typename Descriptor::element* descriptors;

  /// One table.
  epipolar_table view(int n, int a, int b) const {
    const std::int64_t table = number(n, a, b);
    const std::int64_t slice = first(n, a, b);
    return {offsets + table * epipolar_order_layout::offset_count(), sorted + slice,
            codes.angles == nullptr ? plane_codes{} : codes.from(slice), sorted_width + table};
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

/// Index = (n, camera of this side): its tables for all cameras of the other side. Rays are read once for all of them.
template <class Descriptor, class Camera, sorted_side Side>
struct build_ordered_tables {
  ordered_tables<Descriptor, Camera, Side> tables;  ///< where they are built

  /// How many there are to build.
  static int count(const search_view<Descriptor, Camera>& search) {
    return search.neighbour_count * own_cameras(search);
  }
  /// Builds those of index i.
  void operator()(int i) const {
    const auto& search = tables.search;
    const int own = i % own_cameras(search), n = i / own_cameras(search);
    const int others = tables.of_candidates ? search.query_cameras : search.neighbour_cameras;
    const auto& view = tables.of_candidates ? search.neighbour(n) : search.query();
    std::int32_t* const keypoints = tables.keypoints + (view_of(n, own, 0).candidates - tables.sorted);
    const int count = collect(view, n, own, keypoints);
    ray_batch rays;
    for (int first = 0; first < count; first += ray_batch::size) {
      const int size = count - first < ray_batch::size ? count - first : ray_batch::size;
      for (int k = 0; k < size; ++k) rays.set(k, view.bearing[keypoints[first + k]], 0);
      bool has_spreads = false, straight = false;
      for (int other = 0; other < others; ++other) {
        if (!used(n, own, other)) continue;
        const int a = tables.of_candidates ? other : own, b = tables.of_candidates ? own : other;
        const pair_geometry& g = search.pair(n, a, b);
        const plane_measure measure =
            tables.of_candidates ? tables.candidate_measure(g, n, b) : tables.query_measure(g, a);
        if (!has_spreads || straight != g.straight)
          for (int k = 0; k < size; ++k)
            rays.spread[k] = measure.spread(rays.z[k], search.scale[view.octave[keypoints[first + k]]]);
        has_spreads = true, straight = g.straight;
        plane_code_batch codes;
        measure(rays, size, codes);
        tables.unsorted.set(view_of(n, own, other).candidates - tables.sorted + first, codes, size);
      }
    }
    for (int other = 0; other < others; ++other) sort(view, n, own, other, keypoints, used(n, own, other) ? count : 0);
  }

 private:
  static int own_cameras(const search_view<Descriptor, Camera>& search) {
    return Side == sorted_side::candidates ? search.neighbour_cameras : search.query_cameras;
  }
  epipolar_table view_of(int n, int own, int other) const {
    return tables.of_candidates ? tables.view(n, other, own) : tables.view(n, own, other);
  }
  /// Whether two cameras are compared at all.
  bool used(int n, int own, int other) const {
    const int a = tables.of_candidates ? other : own, b = tables.of_candidates ? own : other;
    return b < tables.search.neighbour(n).camera_count && tables.search.compares(n, a, b);
  }
  /// The keypoints of this side that the camera sees.
  int collect(const keyframe_view<Descriptor, Camera>& view, int n, int own, std::int32_t* keypoints) const {
    const auto& search = tables.search;
    const std::int32_t* const list =
        tables.of_candidates ? search.candidates + search.candidate_begin[n] : search.queries;
    const int listed = tables.of_candidates ? search.candidate_end[n] - search.candidate_begin[n] : search.slot_count;
    int count = 0;
    for (int k = 0; k < listed; ++k)
      if (view.camera_of(list[k]) == own) {
        if (tables.descriptors != nullptr) prefetch(view.descriptor_of(list[k]), 1);
        keypoints[count++] = list[k];
      }
    return count;
  }
  void sort(const keyframe_view<Descriptor, Camera>& view, int n, int own, int other, const std::int32_t* keypoints,
            int count) const {
    const epipolar_table table = view_of(n, own, other);
    table.build(keypoints, tables.unsorted.from(table.candidates - tables.sorted), count);
    if (tables.descriptors == nullptr) return;
    auto* to = tables.descriptors + (table.candidates - tables.sorted) * Descriptor::elements;
    for (int k = 0; k < count; ++k, to += Descriptor::elements)
      std::memcpy(to, view.descriptor_of(table.candidates[k]), Descriptor::bytes);
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
  result.offsets = scratch.template take<std::int32_t>(tables * epipolar_order_layout::offset_count());
  result.sorted = scratch.template take<std::int32_t>(entries);
  result.sorted_width = scratch.template take<std::uint16_t>(tables);
  result.keypoints = scratch.template take<std::int32_t>(entries);
  const auto take_codes = [&]() -> plane_codes {
    return {scratch.template take<std::uint16_t>(entries), scratch.template take<std::uint16_t>(entries),
            scratch.template take<std::int16_t>(entries)};
  };
  result.unsorted = take_codes();
  if (for_search) {
    result.codes = take_codes();
    result.descriptors = scratch.template take<typename Descriptor::element>(entries * Descriptor::elements);
  }
  return result;
}

/// Sorts the keypoints of all pairs. O(keypoints x cameras).
template <class Derived, class Descriptor, class Camera, sorted_side Side>
void launch_build_tables(const thrust::execution_policy<Derived>& policy,
                         const ordered_tables<Descriptor, Camera, Side>& tables) {
  using body = build_ordered_tables<Descriptor, Camera, Side>;
  for_each_index(derived(policy), body::count(tables.search), body{tables});
}

TURBOMAP_END_NAMESPACE
