// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A long run: a camera goes to and fro in a corridor for as long as you say, loops are closed now and then, the oldest keyframes
/// leave the map, and the store has a byte budget. The map does not grow and agrees with a recount; handles of keyframes that
/// have left are refused, and the others name the keyframe that they were given for. Runs of 3000 keyframes and more also check
/// that memory and time per keyframe stay: before some 900 keyframes lists and pools still grow to what they need.
/// TURBOMAP_TEST_KEYFRAMES in the environment: how many keyframes (300, and no fewer), 0.2 s apart; TURBOMAP_TEST_SEED: of the
/// scene (5); TURBOMAP_TEST_CSV: a file for figures, written as the run goes.

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <fstream>
#include <map>
#include <random>
#include <type_traits>
#include <vector>

#include "local_mapper_cases.hpp"
#include "support/environment.hpp"
#include "support/process_memory.hpp"

namespace turbomap_test {
namespace soak {

using flat = mapped_by<pinhole_camera>;
using traits = turbomap::map_traits<flat>;
using orb_descriptor = turbomap::binary_descriptor<256>;

constexpr int corridor = 150;            // keyframes from one end to the other
constexpr std::size_t remembered = 200;  // keyframes that the system keeps
constexpr std::size_t budget = std::size_t{384} << 10;

inline mapping_case<pinhole_camera> soak_case() {
  mapping_recipe recipe = noisy(static_cast<unsigned>(environment("TURBOMAP_TEST_SEED", 5)));
  auto c = stereo_case(recipe);
  c.options.adjustment.solve.max_iterations = 3;
  return c;
}

/// A system around the mapper that forgets: views, truth and keyframes of long ago.
template <class Policy>
class system {
 public:
  system(const mapping_case<pinhole_camera>& c, const Policy& policy)
      : scene_(c.rig, c.recipe), ctx_(policy), store_(bounded()), mapper_(ctx_, map_, store_, c.options) {}

  /// Tracking and mapping of keyframe n; its time in ms.
  double step(int n) {
    const int phase = n % (2 * corridor);
    const mapping_view v = scene_.view(phase <= corridor ? phase : 2 * corridor - phase);
    const auto previous = alive_.empty() || !map_.alive(alive_.back()) ? turbomap::map_keyframe_id{} : alive_.back();
    const auto k = map_.add_keyframe(turbomap::span<const turbomap::keypoint>(v.keypoints), v.T_cw, 0.2 * n, previous);
    mapper_.insert(k, scene_.data<orb_descriptor>(v));
    const auto handle = mapper_.stored().at(traits::id(map_, k));
    note(k, handle, v);
    associate(k, v, n);
    const auto start = std::chrono::steady_clock::now();
    mapper_.process(k);
    const auto took = std::chrono::steady_clock::now() - start;
    alive_.push_back(k);
    while (!alive_.empty() && (alive_.size() > remembered || !map_.alive(alive_.front()))) forget(alive_.front());
    if (n % 250 == 249) close_loop(k);
    return std::chrono::duration<double, std::milli>(took).count();
  }
  /// Everything agrees with a look at all of it.
  void check() {
    CHECK(turbomap::validate(map_).empty());  // counts per octave are counted anew, too
    CHECK(store_.statistics().pinned_sets == 0);
    CHECK(store_.statistics().peak_chunk_bytes <= budget);
    CHECK(store_.statistics().keyframes == map_.keyframe_count());
    CHECK(mapper_.stored().size() == map_.keyframe_count());
    std::size_t wrong = 0, dead = 0;
    for (const auto& [id, known] : named_) {
      turbomap::keyframe_handle handle;
      const bool stored = mapper_.stored().find(id, handle);
      dead += stored ? 0 : 1;
      wrong += stored == store_.contains(known.handle) ? 0 : 1;
      if (!stored) {
        CHECK_THROWS_AS(store_.pin(ctx_, {known.handle}), turbomap::stale_handle);
        continue;
      }
      const auto pinned = store_.pin(ctx_, {known.handle});
      wrong += handle == known.handle && pinned[0].keypoint_count == known.keypoints ? 0 : 1;
      if constexpr (std::is_same_v<turbomap::memory_of_t<Policy>, turbomap::host_memory>)
        wrong += std::memcmp(pinned[0].descriptor_of(known.keypoints / 2), known.descriptor.data(), 32) == 0 ? 0 : 1;
    }
    CHECK(wrong == 0);
    dead_ += dead;
    while (named_.size() > 4 * remembered) named_.erase(named_.begin());
  }
  std::size_t keyframes() const { return map_.keyframe_count(); }
  std::size_t points() const { return map_.point_count(); }
  std::size_t dead_handles() const { return dead_; }
  turbomap::keyframe_store_statistics statistics() { return store_.statistics(); }

 private:
  struct name {
    turbomap::keyframe_handle handle;
    int keypoints;
    std::vector<std::uint8_t> descriptor;  ///< of the keypoint in the middle
  };

  static turbomap::keyframe_store_options bounded() {
    turbomap::keyframe_store_options o;
    o.chunk_bytes = std::size_t{1} << 15, o.byte_budget = budget;
    o.packing.grid_columns = 32, o.packing.grid_rows = 24;
    return o;
  }
  void note(turbomap::map_keyframe_id k, turbomap::keyframe_handle handle, const mapping_view& v) {
    const auto middle = v.keypoints.size() / 2;
    const auto* const d = v.descriptors.data() + 32 * middle;
    named_[traits::id(map_, k)] = {handle, static_cast<int>(v.keypoints.size()), {d, d + 32}};
  }
  /// As a system that bounds its map does.
  void forget(turbomap::map_keyframe_id k) {
    alive_.pop_front();
    if (!map_.alive(k)) return;  // culled
    const std::uint64_t id = traits::id(map_, k);
    touched_.clear();
    turbomap::erase_keyframe(map_, k, 2, &touched_);
    mapper_.remove(id);
    touched_.erase(
        std::remove_if(touched_.begin(), touched_.end(), [this](turbomap::map_point_id p) { return !map_.alive(p); }),
        touched_.end());
    mapper_.update_appearance(touched_);
  }
  void close_loop(turbomap::map_keyframe_id k) {
    move_all(map_, 1e-3);
    move_all(map_, -1e-3);
    mapper_.refresh();
    map_.forget_replacements();  // names of merged points, which else add up
    if (map_.alive(k)) mapper_.fuse_around(k);
  }
  /// Tracking: known landmarks are recognised, some others get a stereo point.
  void associate(turbomap::map_keyframe_id k, const mapping_view& v, int n) {
    std::mt19937 random(static_cast<unsigned>(n));
    created_.clear();
    for (std::size_t i = 0; i < v.keypoints.size(); ++i) {
      const landmark_id l = v.landmark[i];
      if (l < 0 || random() % 10 < 3) continue;
      const auto known = known_.find(l);
      const auto p = known == known_.end() ? turbomap::map_point_id{} : turbomap::resolve(map_, known->second);
      if (p != turbomap::map_point_id{}) {
        turbomap::observe(map_, p, k, i);
        continue;
      }
      if (!(v.keypoints[i].u_right >= 0) || random() % 10 < 5 ||
          traits::point_at(map_, k, i) != turbomap::map_point_id{})
        continue;
      const auto x = scene_.position(l);
      const auto made = map_.add_point({x.x(), x.y(), x.z()}, k);
      turbomap::observe(map_, made, k, i);
      known_[l] = made;
      created_.push_back(made);
    }
    mapper_.watch(created_);
  }

  mapping_scene<pinhole_camera> scene_;
  turbomap::context<Policy> ctx_;
  flat map_;
  turbomap::store_of<flat, Policy> store_;
  turbomap::local_mapper<flat, Policy, turbomap::local_adjustment<flat, Policy>> mapper_;
  std::deque<turbomap::map_keyframe_id> alive_;
  std::map<std::uint64_t, name> named_;  ///< by id: the last ones, dead or alive
  std::map<landmark_id, turbomap::map_point_id> known_;
  std::vector<turbomap::map_point_id> created_, touched_;
  std::size_t dead_ = 0;
};

struct row {
  int keyframe;
  double ms, resident;
  std::size_t keyframes, points;
};

inline double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

}  // namespace soak

template <class Policy>
void check_long_run(const Policy& policy) {
  using namespace soak;
  const auto keyframes = static_cast<int>(std::max(300.0, environment("TURBOMAP_TEST_KEYFRAMES", 300)));
  const int every = std::min(1000, keyframes / 10);
  const auto c = soak_case();
  system<Policy> running(c, policy);
  std::vector<row> rows;
  std::vector<double> ms;
  std::ofstream csv;
  if (const char* const file = std::getenv("TURBOMAP_TEST_CSV")) csv.open(file);
  csv << "keyframe,ms_median,resident_mb,keyframes,points" << std::endl;
  for (int n = 0; n < keyframes; ++n) {
    CAPTURE(n);
    ms.push_back(running.step(n));
    if ((n + 1) % every != 0) continue;
    running.check();
    rows.push_back({n + 1, median(ms), resident_mb(), running.keyframes(), running.points()});
    ms.clear();
    const row& r = rows.back();
    csv << r.keyframe << ',' << r.ms << ',' << r.resident << ',' << r.keyframes << ',' << r.points << std::endl;
  }
  CHECK(running.dead_handles() > 0);
  CHECK(running.keyframes() <= remembered);
  CHECK(running.statistics().page_ins > 0);
  // After a fifth of the run the map is about as large as it gets.
  const row &early = rows[rows.size() / 5], &last = rows.back();
  CHECK(last.points < 2 * early.points);
  if (keyframes < 3000) return;
  CHECK(last.resident < 1.1 * early.resident + 1);  // MB; measured: 0.2 more after 60,000 keyframes
  CHECK(last.ms < 3 * early.ms);                    // others may use the machine
}

}  // namespace turbomap_test
