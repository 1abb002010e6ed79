// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The epipolar-ordered search of host policies: first every table (one task each), then every chunk of query keypoints
/// against every neighbour. The answer is exhaustive_search's, bit for bit.

#include <cmath>
#include <cstdint>
#include <cstring>

#include "../config.hpp"
#include "../context.hpp"
#include "epipolar_order.hpp"
#include "search_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Scratch of one ordered search. Table (n, a, b) owns total_buckets() + 1 offsets, and as many candidates and keys as
/// neighbour n has.
template <class Descriptor, class Camera>
struct ordered_tables {
  search_view<Descriptor, Camera> search;
  std::int32_t* offsets;
  std::int32_t* candidates;
  float* narrowest;
  std::int32_t* keypoints;  ///< the candidates of camera b, before sorting
  plane_interval* intervals;
  std::int32_t* keys;
  typename Descriptor::element* descriptors;  ///< of `candidates`, in their order: windows are read as a stream

  int table(int n, int a, int b) const { return (n * search.query_cameras + a) * search.neighbour_cameras + b; }
  epipolar_table view(int n, int a, int b) const {
    const int cameras = search.query_cameras * search.neighbour_cameras;
    const std::int64_t begin = search.candidate_offset[n], count = search.candidate_offset[n + 1] - begin;
    const std::int64_t slice = cameras * begin + (a * search.neighbour_cameras + b) * count;
    return {offsets + static_cast<std::int64_t>(table(n, a, b)) * (epipolar_order_layout::total_buckets() + 1),
            candidates + slice, narrowest + table(n, a, b)};
  }
  /// Measure of the candidates (side b) of a pair.
  plane_measure candidate_measure(const pair_geometry& g, int n, int b) const {
    if (g.straight) return plane_measure::line(g, std::sqrt(search.options.line_chi2), std::fmin(g.K_b.fx, g.K_b.fy));
    return plane_measure::ray(g, std::sqrt(search.options.reprojection_chi2),
                              search.neighbour(n).cameras[b].resolution);
  }
  /// Measure of the query keypoints (side a). A line test measures from the exact query pixel: no width of its own.
  plane_measure query_measure(const pair_geometry& g, int a) const {
    if (g.straight) return plane_measure::line(g, 0, 1);
    return plane_measure::ray(g, std::sqrt(search.options.reprojection_chi2), search.query().cameras[a].resolution);
  }
};

/// Index = table (n, a, b).
template <class Descriptor, class Camera>
struct build_ordered_table {
  ordered_tables<Descriptor, Camera> tables;

  void operator()(int i) const {
    const auto& search = tables.search;
    const int b = i % search.neighbour_cameras, a = i / search.neighbour_cameras % search.query_cameras;
    const int n = i / (search.neighbour_cameras * search.query_cameras);
    const auto& neighbour = search.neighbour(n);
    epipolar_table table = tables.view(n, a, b);
    const std::int64_t slice = table.candidates - tables.candidates;
    std::int32_t* keypoints = tables.keypoints + slice;
    plane_interval* intervals = tables.intervals + slice;
    int count = 0;
    if (b < neighbour.camera_count) {
      const plane_measure measure = tables.candidate_measure(search.pair(n, a, b), n, b);
      for (int k = search.candidate_offset[n]; k < search.candidate_offset[n + 1]; ++k) {
        const std::int32_t c = search.candidates[k];
        if (neighbour.camera_of(c) != b) continue;
        keypoints[count] = c;
        intervals[count++] = measure(neighbour.bearing[c], neighbour.bearing[c].z, search.scale[neighbour.octave[c]]);
      }
    }
    table.build(keypoints, intervals, tables.keys + slice, count);
    auto* descriptors = tables.descriptors + slice * Descriptor::elements;
    for (int k = 0; k < count; ++k)
      std::memcpy(descriptors + static_cast<std::int64_t>(k) * Descriptor::elements,
                  neighbour.descriptor_of(table.candidates[k]), Descriptor::elements * sizeof(*descriptors));
  }
};

/// Index = neighbour * chunks + chunk of query slots.
template <class Descriptor, class Camera>
struct ordered_search {
  static constexpr int chunk_size = 64;

  ordered_tables<Descriptor, Camera> tables;
  int chunks;

  void operator()(int i) const {
    const auto& search = tables.search;
    const int n = i / chunks, first = i % chunks * chunk_size;
    const int last = first + chunk_size < search.slot_count ? first + chunk_size : search.slot_count;
    for (int slot = first; slot < last; ++slot) {
      search.match[n * search.slot_count + slot] = no_match;
      search.distance[n * search.slot_count + slot] = search.max_distance;
    }
    // One table at a time, so that it stays in the nearest cache.
    for (int a = 0; a < search.query_cameras; ++a)
      for (int b = 0; b < search.neighbour(n).camera_count; ++b) match(n, a, b, first, last);
  }

 private:
  void match(int n, int a, int b, int first, int last) const {
    const auto& search = tables.search;
    const auto& query = search.query();
    const pair_geometry& g = search.pair(n, a, b);
    const plane_measure measure = tables.query_measure(g, a);
    const epipolar_table table = tables.view(n, a, b);
    if (table.empty()) return;
    const auto* descriptors = tables.descriptors + (table.candidates - tables.candidates) * Descriptor::elements;
    float R[9];
    for (int k = 0; k < 9; ++k) R[k] = static_cast<float>(g.T_ba.R.m[k].value);
    for (int slot = first; slot < last; ++slot) {
      const int keypoint = search.queries[slot];
      if (query.camera_of(keypoint) != a) continue;
      const auto* descriptor = query.descriptor_of(keypoint);
      const vec3<float> r = query.bearing[keypoint];
      const vec3<float> ray{R[0] * r.x + R[1] * r.y + R[2] * r.z, R[3] * r.x + R[4] * r.y + R[5] * r.z,
                            R[6] * r.x + R[7] * r.y + R[8] * r.z};
      const plane_interval interval = measure(ray, r.z, search.scale[query.octave[keypoint]]);
      std::int32_t& match = search.match[n * search.slot_count + slot];
      auto& distance = search.distance[n * search.slot_count + slot];
      candidate_scan<Descriptor, Camera> scan(search, n, keypoint, match, distance);
      table.windows(interval, [&](std::int32_t begin, std::int32_t end) {
        for (std::int32_t k = begin; k < end; ++k) {
          const auto d =
              Descriptor::distance(descriptor, descriptors + static_cast<std::int64_t>(k) * Descriptor::elements);
          if (d <= scan.best_distance()) scan.consider(table.candidates[k], d);
        }
      });
      match = scan.best();
      distance = scan.best_distance();
    }
  }
};

/// Runs it under a host policy; scratch comes from the context.
template <class Descriptor, class Camera, class Policy>
void run_ordered(context<Policy>& ctx, const search_view<Descriptor, Camera>& search, std::size_t candidate_count) {
  const int cameras = search.query_cameras * search.neighbour_cameras, table_count = search.neighbour_count * cameras;
  const std::size_t entries = candidate_count * static_cast<std::size_t>(cameras);
  ordered_tables<Descriptor, Camera> tables{
      search,
      ctx.template scratch<std::int32_t>(static_cast<std::size_t>(table_count) *
                                         (epipolar_order_layout::total_buckets() + 1)),
      ctx.template scratch<std::int32_t>(entries),
      ctx.template scratch<float>(static_cast<std::size_t>(table_count)),
      ctx.template scratch<std::int32_t>(entries),
      ctx.template scratch<plane_interval>(entries),
      ctx.template scratch<std::int32_t>(entries),
      ctx.template scratch<typename Descriptor::element>(entries * Descriptor::elements)};
  for_each_index(ctx.policy(), table_count, build_ordered_table<Descriptor, Camera>{tables});
  const int chunks = (search.slot_count + ordered_search<Descriptor, Camera>::chunk_size - 1) /
                     ordered_search<Descriptor, Camera>::chunk_size;
  for_each_index(ctx.policy(), search.neighbour_count * chunks, ordered_search<Descriptor, Camera>{tables, chunks});
}

TURBOMAP_END_NAMESPACE
