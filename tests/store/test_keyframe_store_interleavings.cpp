// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// A model check of the keyframe store's slots, pins and reclamation. Its members take one lock, and insert() takes it twice, so
/// what two threads do is what some order of their steps does. Every program of four steps of a writer is run against a
/// reader that pins and releases, in every order, from the beginning; and every step within an insertion.

#include <doctest/doctest.h>

#include <thrust/detail/seq.h>

#include <turbomap/context.hpp>
#include <turbomap/store/keyframe_store.hpp>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "scenes/keyframe_samples.hpp"

namespace turbomap_test {

/// Called once by the next camera that a keyframe is packed with: between the two locks of an insertion.
inline std::function<void()> within_insertion;

struct interrupting_camera : turbomap::pinhole<float> {
  template <class S>
  bool unproject(const turbomap::vec2<S>& pixel, turbomap::vec3<S>& bearing) const {
    if (const auto once = std::exchange(within_insertion, nullptr)) once();
    return turbomap::pinhole<float>::unproject(pixel, bearing);
  }
};

}  // namespace turbomap_test

namespace {

using namespace turbomap_test;
using store_type = turbomap::keyframe_store<sample_descriptor, interrupting_camera>;
using turbomap::keyframe_handle;

/// Two keyframes that are told apart by their descriptors.
struct sample {
  explicit sample(unsigned seed) : source(make_keyframe(seed, 3, 1, true, 0)) {
    turbomap::rig_camera<interrupting_camera> one{};
    static_cast<turbomap::pinhole<float>&>(one.camera) = source.cameras[0].camera;
    camera = one;
  }
  turbomap::keyframe_data<sample_descriptor, interrupting_camera> data() const {
    return {3, source.keypoints.data(), source.descriptors.data(), &camera, 1, source.bounds};
  }
  sample_keyframe source;
  turbomap::rig_camera<interrupting_camera> camera;
};

/// A store with room for three keyframes, and what it should hold.
class store_world {
 public:
  store_world() : store_(room()) {
    for (std::size_t i = 0; i < 2; ++i) insert();
  }

  /// What the writer may do.
  enum class step : std::uint8_t { erase_first, erase_second, insert, insert_interrupted, collect };
  static constexpr int steps = 5;

  /// \param meanwhile  what the reader does within an interrupted insertion
  void write(step s, const std::function<void()>& meanwhile) {
    switch (s) {
      case step::erase_first:
        return erase(0);
      case step::erase_second:
        return erase(1);
      case step::insert:
        return insert();
      case step::insert_interrupted:
        within_insertion = meanwhile;
        insert();
        within_insertion = nullptr;
        return;
      case step::collect:
        store_.statistics();
    }
  }
  /// Step 0 and 2 pin, 1 and 3 release. What is pinned must stay what it was.
  void read(int s) {
    check_pinned();
    if (s % 2 == 1) {
      pinned_.reset();
      return;
    }
    const std::vector<keyframe_handle> wanted = s == 0
                                                    ? std::vector<keyframe_handle>{known_[0].handle, known_[1].handle}
                                                    : std::vector<keyframe_handle>{known_[0].handle};
    bool stale = false;
    for (std::size_t i = 0; i < wanted.size(); ++i) stale = stale || !known_[i].alive;
    try {
      pinned_.emplace(store_.pin(ctx_, turbomap::span<const keyframe_handle>(wanted.data(), wanted.size())));
      REQUIRE(!stale);
    } catch (const turbomap::stale_handle&) {
      REQUIRE(stale);
    }
    check_pinned();
  }
  void check() {
    std::size_t alive = 0;
    for (const auto& k : known_) {
      REQUIRE(store_.contains(k.handle) == k.alive);
      alive += k.alive ? 1 : 0;
    }
    const auto s = store_.statistics();
    REQUIRE(s.keyframes == alive);
    REQUIRE(s.pinned_sets == (pinned_ ? 1 : 0));
    REQUIRE(s.chunk_bytes <= store_.options().byte_budget);
    if (!pinned_) REQUIRE(s.resident_blocks + s.paged_blocks == alive);
  }
  /// All that is left is what was inserted, and nothing is left of it in the end.
  void finish() {
    check_pinned();
    pinned_.reset();
    check();
    for (const auto& k : known_) {
      if (!k.alive) continue;
      const auto one = store_.pin(ctx_, {k.handle});
      REQUIRE(holds(one[0], k.kind));
    }
    store_.clear();
    REQUIRE(store_.statistics().resident_blocks + store_.statistics().paged_blocks == 0);
  }

 private:
  struct item {
    keyframe_handle handle;
    std::size_t kind;
    bool alive;
  };
  static const std::vector<sample>& samples() {
    static const std::vector<sample> all = [] {
      std::vector<sample> made;
      for (unsigned i = 0; i < 6; ++i) made.emplace_back(i);
      return made;
    }();
    return all;
  }
  static turbomap::keyframe_store_options room() {
    turbomap::keyframe_packing_options packing;
    packing.grid_columns = packing.grid_rows = 0;
    const std::size_t block =
        turbomap::align_up(packed(samples()[0].source, packing).size(), turbomap::chunk_allocator::alignment);
    turbomap::keyframe_store_options o;
    o.packing = packing;
    o.chunk_bytes = block, o.byte_budget = 3 * block;
    return o;
  }
  static bool holds(const store_type::view_type& view, std::size_t kind) {
    const auto& d = samples()[kind].source.descriptors;
    return view.keypoint_count == 3 && std::memcmp(view.descriptor_of(0), d.data(), d.size()) == 0;
  }
  void check_pinned() {
    if (!pinned_) return;
    for (std::size_t i = 0; i < pinned_->size(); ++i) REQUIRE(holds((*pinned_)[i], known_[i].kind));
  }
  void insert() {
    const std::size_t kind = known_.size() % samples().size();
    try {
      const keyframe_handle h = store_.insert(samples()[kind].data());
      for (const auto& k : known_) REQUIRE(!(k.handle == h));  // no handle is given twice
      known_.push_back({h, kind, true});
    } catch (const turbomap::out_of_memory&) {
      REQUIRE(pinned_.has_value());  // else there is something to page out
    }
  }
  void erase(std::size_t n) {
    try {
      store_.erase(known_[n].handle);
      REQUIRE(known_[n].alive);
      known_[n].alive = false;
    } catch (const turbomap::stale_handle&) {
      REQUIRE(!known_[n].alive);
    }
  }

  turbomap::context<std::decay_t<decltype(thrust::seq)>> ctx_;
  store_type store_;
  std::vector<item> known_;  ///< 0 and 1 are there at the beginning
  std::optional<store_type::pinned_type> pinned_;
};

TEST_CASE("every order of a writer's and a reader's steps") {
  constexpr int writes = 4, reads = 4, slots = writes + reads;
  int programs = 1, runs = 0, interrupted = 0;
  for (int i = 0; i < writes; ++i) programs *= store_world::steps;
  for (int program = 0; program < programs; ++program) {
    for (unsigned order = 0; order < (1U << slots); ++order) {  // bit i: the writer's turn
      int turns = 0;
      for (int i = 0; i < slots; ++i) turns += static_cast<int>(order >> i & 1U);
      if (turns != writes) continue;
      CAPTURE(program);
      CAPTURE(order);
      store_world world;
      int rest = program, next_read = 0;
      const auto read = [&] {
        if (next_read < reads) world.read(next_read++);
      };
      for (int i = 0; i < slots; ++i) {
        if ((order >> i & 1U) == 0) {
          read();
        } else {
          const auto step = static_cast<store_world::step>(rest % store_world::steps);
          rest /= store_world::steps;
          world.write(step, [&] { read(), ++interrupted; });
        }
        world.check();
      }
      while (next_read < reads) read();
      world.finish();
      ++runs;
    }
  }
  CHECK(runs == 625 * 70);
  CHECK(interrupted > 20000);
}

}  // namespace
