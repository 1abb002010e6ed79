// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The search along epipolar curves: every query keypoint is compared with the candidates in its window of the sorted tables
/// only, a few percent of all. The answer is that of the exhaustive search, bit for bit.

#include <atomic>
#include <cstdint>
#include <cstring>

#include "../config.hpp"
#include "../context.hpp"
#include "candidate_scan.hpp"
#include "listed_distances.hpp"
#include "ordered_tables.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = neighbour * chunks + chunk of query slots.
template <class Descriptor, class Camera>
struct ordered_search {
  static constexpr int chunk_size = 64;  ///< query slots that one thread takes one after the other

  ordered_tables<Descriptor, Camera> tables;  ///< the candidates in epipolar order
  int chunks;                                 ///< chunks per neighbour
  std::atomic<bool>* stopped;                 ///< set once the user's flag was seen, which may be cleared again

  /// Searches for one chunk.
  void operator()(int i) const {
    const auto& search = tables.search;
    const int n = i / chunks, first = i % chunks * chunk_size;
    const int last = first + chunk_size < search.slot_count ? first + chunk_size : search.slot_count;
    for (int slot = first; slot < last; ++slot) {
      search.match[n * search.slot_count + slot] = no_match;
      search.distance[n * search.slot_count + slot] = search.max_distance;
    }
    if (search.options.stopped()) stopped->store(true, std::memory_order_relaxed);
    if (stopped->load(std::memory_order_relaxed)) return;
    // One table at a time, so that it stays in the nearest cache.
    for (int a = 0; a < search.query_cameras; ++a) {
      chunk_rays chunk;
      for (int b = 0; b < search.neighbour(n).camera_count; ++b)
        if (!tables.view(n, a, b).empty()) match(n, a, b, first, last, chunk);
    }
  }

 private:
  /// The slots of a chunk that one camera sees, and their rays. Curved images: rays are the same for all cameras they are
  /// matched with.
  struct chunk_rays {
    ray_batch rays;
    int slots[chunk_size];
    int count = 0;
    bool collected = false, straight = false;
  };
  static_assert(chunk_size == ray_batch::size);
  /// A candidate that is near enough.
  struct hit {
    int owner;                                    ///< number of the query in the chunk
    std::int32_t candidate;                       ///< a keypoint
    typename Descriptor::distance_type distance;  ///< of the two
  };
  /// Pairs of a query and a candidate whose codes meet.
  struct near_list {
    static constexpr int room = 1024;  ///< pairs that are kept until they are compared
    static constexpr int beyond =
        room + 4 * plane_codes::padding;  ///< what is listed with a window, or written behind it
    std::uint8_t owners[beyond];          ///< numbers of queries in the chunk
    std::int32_t places[beyond];          ///< of candidates in the table
    hit hits[beyond];                     ///< of those, ordered by distance for each query
    int count = 0;

    /// The pairs from `before` on are those of query i. 32 at once: most lists are shorter, and a length that varies costs a
    /// branch that cannot be predicted.
    void own(int before, int i) {
      do std::memset(owners + before, i, 32);
      while ((before += 32) < count);
    }
  };
  static_assert(chunk_size <= 256 && plane_codes::padding >= 32);

  void consider(int n, int slot, const hit& one) const {
    const auto& search = tables.search;
    std::int32_t& match = search.match[n * search.slot_count + slot];
    auto& distance = search.distance[n * search.slot_count + slot];
    candidate_scan<Descriptor, Camera> scan(search, n, search.queries[slot], match, distance);
    scan.consider(one.candidate, one.distance);
    match = scan.best();
    distance = scan.best_distance();
  }
  void collect(const plane_measure& measure, int a, int first, int last, chunk_rays& chunk) const {
    const auto& search = tables.search;
    const auto& query = search.query();
    chunk.count = 0;
    for (int slot = first; slot < last; ++slot) {
      const int keypoint = search.queries[slot];
      if (query.camera_of(keypoint) != a) continue;
      const vec3<float> ray = query.bearing[keypoint];
      chunk.slots[chunk.count] = slot;
      chunk.rays.set(chunk.count++, ray, measure.spread(ray.z, search.scale[query.octave[keypoint]]));
    }
    chunk.collected = true;
  }

  void match(int n, int a, int b, int first, int last, chunk_rays& chunk) const {
    const auto& search = tables.search;
    const auto& query = search.query();
    const pair_geometry& g = search.pair(n, a, b);
    const plane_measure measure = tables.query_measure(g, a);
    const epipolar_table table = tables.view(n, a, b);
    if (!chunk.collected || chunk.straight != g.straight) collect(measure, a, first, last, chunk);
    chunk.straight = g.straight;
    if (chunk.count == 0) return;
    plane_code_batch codes;
    measure(chunk.rays, chunk.count, codes);
    // All windows first: the loads of one need not wait until the branches of the last query are known.
    epipolar_table::window windows[chunk_size];
    for (int i = 0; i < chunk.count; ++i) windows[i] = table.window_of(codes[i]);
    const listed_distances<Descriptor> distances{tables.descriptors_of(n, a, b)};
    const typename Descriptor::element* descriptors[chunk_size];
    for (int i = 0; i < chunk.count; ++i) descriptors[i] = query.descriptor_of(search.queries[chunk.slots[i]]);
    // Compared for many queries in one loop (listed_distances.hpp). Of a query, the nearest first: the first consistent one makes
    // the tests of the others needless.
    near_list near;
    const auto compare = [&] {
      int hits = 0;
      distances.visit_near(descriptors, near.owners, near.places, near.count, search.max_distance, [&](int i, auto d) {
        const hit one{near.owners[i], table.candidates[near.places[i]], d};
        int at = hits++;
        for (; at > 0 && near.hits[at - 1].owner == one.owner && near.hits[at - 1].distance > d; --at)
          near.hits[at] = near.hits[at - 1];
        near.hits[at] = one;
      });
      for (int h = 0; h < hits; ++h) consider(n, chunk.slots[near.hits[h].owner], near.hits[h]);
      near.count = 0;
    };
    for (int i = 0; i < chunk.count; ++i) {
      const plane_code code = codes[i];
      const epipolar_table::window& window = windows[i];
      const int size = window.size();
      if (size > near_list::room - near.count) compare();
      const auto list = [&](std::int32_t first, std::int32_t last) {
        near.count = table.codes.list_meeting(code, first, last, near.places, near.count);
      };
      const int before = near.count;
      if (size <= near_list::room) {
        list(window.first[0], window.last[0]), list(window.first[1], window.last[1]);
        near.own(before, i);
        continue;
      }
      for (int range = 0; range < 2; ++range) {
        const std::int32_t last = window.last[range];
        for (std::int32_t k = window.first[range]; k < last; k += near_list::room) {
          list(k, last - k < near_list::room ? last : k + near_list::room);
          near.own(0, i);
          compare();
        }
      }
    }
    compare();
  }
};

/// Makes the tables in scratch memory, then searches them. A device does without: cuda/search_ordered.cuh.
/// \return false: stopped before the end; what was not reached has no matches
template <class Derived, class Descriptor, class Camera, class Memory>
bool launch_search_ordered(const thrust::execution_policy<Derived>& policy,
                           const search_view<Descriptor, Camera>& search, scratch_arena<Memory>& scratch) {
  using body = ordered_search<Descriptor, Camera>;
  const auto tables = take_tables<sorted_side::candidates>(scratch, search, true);
  launch_build_tables(derived(policy), tables);
  std::atomic<bool> stopped{false};
  const int chunks = (search.slot_count + body::chunk_size - 1) / body::chunk_size;
  for_each_index(derived(policy), search.neighbour_count * chunks, body{tables, chunks, &stopped});
  return !stopped.load(std::memory_order_relaxed);
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/search_ordered.cuh"
#endif
