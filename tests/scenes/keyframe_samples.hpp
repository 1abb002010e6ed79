// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Keyframes to fill a store with, and memory resources that count and fail.

#include <turbomap/camera/pinhole.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/store/keyframe_packing.hpp>

#include <cstddef>
#include <cstdint>
#include <memory_resource>
#include <mutex>
#include <new>
#include <random>
#include <unordered_map>
#include <vector>

namespace turbomap_test {

using sample_descriptor = turbomap::binary_descriptor<256>;
using sample_camera = turbomap::pinhole<float>;
using sample_data = turbomap::keyframe_data<sample_descriptor, sample_camera>;
using sample_view = turbomap::keyframe_view<sample_descriptor, sample_camera>;

/// A keyframe that owns its arrays.
struct sample_keyframe {
  std::vector<turbomap::keypoint> keypoints;
  std::vector<std::uint8_t> descriptors;
  std::vector<turbomap::rig_camera<sample_camera>> cameras;
  turbomap::image_bounds bounds{0, 0, 752, 480};

  sample_data data() const {
    return {static_cast<int>(keypoints.size()),
            keypoints.data(),
            descriptors.data(),
            cameras.data(),
            static_cast<int>(cameras.size()),
            bounds};
  }
};

/// Random keypoints of a 752 x 480 image in about `groups` word groups; stereo ones have u_right and depth now and
/// then.
inline sample_keyframe make_keyframe(unsigned seed, int n, int cameras = 1, bool stereo = true, int groups = 100) {
  std::mt19937 random(seed);
  const auto uniform = [&random](float low, float high) {
    return low + (high - low) * static_cast<float>(random() % 100000) / 100000.0F;
  };
  sample_keyframe k;
  for (int c = 0; c < cameras; ++c) {
    turbomap::rig_camera<sample_camera> one{};
    one.camera = {458.5F + static_cast<float>(c), 457.25F, 367.0F, 248.5F};
    one.bf = stereo ? 50 : 0;
    k.cameras.push_back(one);
  }
  for (int i = 0; i < n; ++i) {
    turbomap::keypoint p;
    p.x = uniform(0, 752);
    p.y = uniform(0, 480);
    p.angle = uniform(0, 360);
    p.octave = static_cast<std::uint8_t>(random() % 8);
    p.camera = static_cast<std::uint8_t>(random() % static_cast<unsigned>(cameras));
    if (stereo && random() % 3 != 0) p.u_right = p.x - 3, p.depth = 50.0F / 3;
    if (groups > 0 && random() % 10 != 0) p.group = 1000 + 7 * (random() % static_cast<unsigned>(groups));
    k.keypoints.push_back(p);
  }
  k.descriptors.resize(static_cast<std::size_t>(n) * sample_descriptor::elements);
  for (auto& byte : k.descriptors) byte = static_cast<std::uint8_t>(random());
  return k;
}

/// Its packed form, made by the packing itself: what a store must give back to the last byte.
inline std::vector<std::byte> packed(const sample_keyframe& k, const turbomap::keyframe_packing_options& options = {}) {
  turbomap::keyframe_packing_scratch scratch;
  const auto data = k.data();
  const auto layout = turbomap::plan_packing(data, options, scratch);
  std::vector<std::byte> block(layout.bytes);
  turbomap::pack_keyframe(data, layout, scratch, block.data());
  return block;
}

/// Passes on to another resource; counts what is out, and refuses the allocations from number `refuse_from` on,
/// `refusals` of them. Thread safe. Complains by `mismatched` when memory comes back with another size than it went out
/// with.
class counting_resource : public std::pmr::memory_resource {
 public:
  explicit counting_resource(std::pmr::memory_resource* upstream) : upstream_(upstream) {}
  long refuse_from = -1, refusals = 0;
  long allocations = 0;
  std::size_t bytes_out = 0;
  long mismatched = 0;

 private:
  void* do_allocate(std::size_t bytes, std::size_t alignment) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    const long number = allocations++;
    if (refuse_from >= 0 && number >= refuse_from && number < refuse_from + refusals) throw std::bad_alloc();
    void* memory = upstream_->allocate(bytes, alignment);
    sizes_[memory] = bytes;
    bytes_out += bytes;
    return memory;
  }
  void do_deallocate(void* memory, std::size_t bytes, std::size_t alignment) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = sizes_.find(memory);
    if (found == sizes_.end() || found->second != bytes)
      ++mismatched;
    else
      sizes_.erase(found);
    bytes_out -= bytes;
    upstream_->deallocate(memory, bytes, alignment);
  }
  bool do_is_equal(const memory_resource& other) const noexcept override { return this == &other; }

  std::pmr::memory_resource* upstream_;
  std::unordered_map<void*, std::size_t> sizes_;
  std::mutex mutex_;
};

}  // namespace turbomap_test
