// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Keeps the immutable part of keyframes in the memory of an execution policy: inserted once, named by handles, read
/// through views by every search. See docs/keyframe_store.md for the layout in bytes. Longer than other headers by the
/// docstrings of one class.

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <mutex>
#include <string>
#include <type_traits>

#include "../config.hpp"
#include "../error.hpp"
#include "../memory.hpp"
#include "../plain_vector.hpp"
#include "../precompiled.hpp"
#include "../slot_table.hpp"
#include "../span.hpp"
#include "../traits.hpp"
#include "block_cache.hpp"
#include "first_cameras.hpp"
#include "gather.hpp"
#include "insertion_lanes.hpp"
#include "keyframe_handle.hpp"
#include "keyframe_packing.hpp"
#include "keyframe_store_options.hpp"
#include "keyframe_view.hpp"
#include "memory_space.hpp"
#include "pin_records.hpp"
#include "pinned_keyframes.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The store. `Memory` is host_memory for every host policy, device_memory for CUDA: `memory_of_t<Policy>`. A device
/// store belongs to the device that is current when it is made, whichever is current in a thread that inserts.
///
/// All members may be called from any thread at any time, while contexts search what they have pinned. The lock is
/// short: keyframes are packed and sent outside of it; only growth and paging happen inside. Neither copyable nor
/// movable.
template <class Descriptor, class Camera, class Memory = host_memory>
class keyframe_store {
 public:
  using descriptor_type = Descriptor;                                ///< of the keypoints.
  using camera_type = Camera;                                        ///< of the rigs.
  using memory_type = Memory;                                        ///< where keyframes are resident.
  using data_type = keyframe_data<Descriptor, Camera>;               ///< what insert() takes: host arrays.
  using view_type = keyframe_view<Descriptor, Camera>;               ///< what a pinned keyframe is seen as.
  using pinned_type = pinned_keyframes<Descriptor, Camera, Memory>;  ///< what pin() gives.

  /// Throws std::invalid_argument naming the option when one makes no sense. Reserves nothing yet.
  explicit keyframe_store(const keyframe_store_options& options = {})
      : options_((validate(options), options)),
        blocks_(options.resident != nullptr ? options.resident : default_resource(Memory{}),
                options.paging != nullptr ? options.paging : default_staging_resource(Memory{}), options.chunk_bytes,
                options.byte_budget),
        lanes_(options.staging != nullptr ? options.staging : default_staging_resource(Memory{})) {}
  keyframe_store(const keyframe_store&) = delete;
  keyframe_store& operator=(const keyframe_store&) = delete;
  /// Waits for the work that still reads its memory.
  ~keyframe_store() { pins_.wait(); }

  /// Inserts one keyframe: one packed upload (a packed copy in host memory). Returns when the caller may change its
  /// arrays and any context may search it. Throws std::invalid_argument naming what is wrong with the data,
  /// out_of_memory when there is no room even with everything paged out that is not pinned; the store is then as it
  /// was. O(N + G log G).
  keyframe_handle insert(const data_type& data) {
    const visit here(home_);
    loan lane(lanes_);
    return insert_through(*lane, data);
  }
  /// The same from the user's own type, read through keyframe_traits<KeyFrame> under its guard.
  template <class KeyFrame>
  keyframe_handle insert(const KeyFrame& keyframe) {
    const visit here(home_);
    loan lane(lanes_);
    return insert_through(*lane, gather(keyframe, lane->buffer));
  }

  /// Removes a keyframe. Its handle is stale at once; its memory is used again after the work that has it pinned.
  /// Throws stale_handle. O(1), without a wait but that of cudaFree() where it leaves a second chunk empty.
  void erase(keyframe_handle handle) {
    const std::lock_guard<std::mutex> lock(mutex_);
    poll();
    require_alive(handle, "handle");
    retire(handle.slot);
  }

  /// Removes all keyframes, as erase() does one by one. A mapper whose keyframes are in this store has none then: remove() them, or
  /// reset() the mapper. O(keyframes).
  void clear() {
    const std::lock_guard<std::mutex> lock(mutex_);
    poll();
    for (std::uint32_t slot = 0; slot < slots_.slot_count(); ++slot) {
      if (slots_.alive(slot)) retire(slot);
    }
  }

  /// Holds keyframes in place for the work of `execution` (a context or a policy in the memory of this store), bringing
  /// back those that were paged out. A handle may be named twice. Throws stale_handle naming index, slot and
  /// generation; out_of_memory when they do not fit together with all that is pinned. In both cases nothing is pinned.
  template <class Execution>
  pinned_type pin(const Execution& execution, span<const keyframe_handle> handles) {
    const auto order = order_of(detail::policy_in(execution));
    static_assert(std::is_same_v<decltype(order), const work_order<Memory>>,
                  "turbomap: this execution policy does not compute in the memory of this keyframe_store");
    return pin_behind(order, handles);
  }
  /// The same of a list: `pin(ctx, {a, b})`.
  template <class Execution>
  pinned_type pin(const Execution& execution, std::initializer_list<keyframe_handle> handles) {
    return pin(execution, span<const keyframe_handle>(handles.begin(), handles.size()));
  }

  /// Whether the handle names a keyframe that has not been erased.
  bool contains(keyframe_handle handle) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return alive(handle);
  }
  /// How the first camera of a keyframe's rig is mounted: maps body to camera, metres. Throws stale_handle. Does not wait for what pages
  /// or uploads.
  rigid_transform<double> first_camera(keyframe_handle handle) const {
    rigid_transform<double> T_camera_body;
    if (!first_cameras_.find(handle, T_camera_body)) throw stale(handle, "handle");
    return T_camera_body;
  }
  /// Keyframes that have not been erased.
  std::size_t size() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return slots_.alive_count();
  }
  /// As they were given.
  const keyframe_store_options& options() const { return options_; }

  /// Counts of this moment. Also takes back the memory of erased keyframes whose readers have finished.
  keyframe_store_statistics statistics() {
    const std::lock_guard<std::mutex> lock(mutex_);
    poll();
    keyframe_store_statistics s;
    s.keyframes = slots_.alive_count();
    s.pinned_sets = pins_.count();
    s.uploads = uploads_;
    blocks_.count(s);
    const std::size_t blocks = s.resident_blocks + s.paged_blocks;
    const auto bytes = static_cast<double>(s.resident_bytes + s.paged_bytes);
    s.bytes_per_keyframe = blocks == 0 ? 0 : bytes / static_cast<double>(blocks);
    return s;
  }

 private:
  friend class pinned_keyframes<Descriptor, Camera, Memory>;
  using record_type = pin_record<Descriptor, Camera, Memory>;
  using visit = typename memory_home<Memory>::visit;
  using loan = typename insertion_lanes<Descriptor, Camera, Memory>::loan;

  /// A slot with a block that nobody else sees yet; undone unless published.
  class reservation {
   public:
    reservation(keyframe_store& store, const keyframe_layout& layout) : store_(store) {
      const std::lock_guard<std::mutex> lock(store.mutex_);
      store.poll();
      slot_ = store.slots_.acquire();
      try {
        if (store.layouts_.size() <= slot_) store.layouts_.resize(std::size_t{slot_} + 1);
        store.first_cameras_.make_room(slot_);
        store.waiting_for_room([&] { block_ = store.blocks_.place(slot_, layout.bytes); });
      } catch (...) {
        store.slots_.recycle(slot_);
        throw;
      }
      store.layouts_[slot_] = layout;
    }
    reservation(const reservation&) = delete;
    reservation& operator=(const reservation&) = delete;
    ~reservation() {
      if (published_) return;
      const std::lock_guard<std::mutex> lock(store_.mutex_);
      store_.unpin(slot_);
    }
    std::byte* block() const { return block_; }
    keyframe_handle publish(const rigid_transform<double>& T_camera_body) {
      const std::lock_guard<std::mutex> lock(store_.mutex_);
      published_ = true;
      ++store_.uploads_;
      store_.slots_.publish(slot_);
      const keyframe_handle handle{slot_, store_.slots_.generation(slot_)};
      store_.first_cameras_.set(handle, T_camera_body);
      store_.unpin(slot_);
      return handle;
    }

   private:
    keyframe_store& store_;
    std::uint32_t slot_;
    std::byte* block_ = nullptr;
    bool published_ = false;
  };

  keyframe_handle insert_through(insertion_lane<Descriptor, Camera, Memory>& lane, const data_type& data);
  pinned_type pin_behind(work_order<Memory> order, span<const keyframe_handle> handles);

  [[gnu::noinline]] void release(record_type* record, work_order<Memory> order) noexcept {
    record->done.record(order);
    const std::lock_guard<std::mutex> lock(mutex_);
    pins_.give_up(record, unpinning{*this});
  }

  // What follows is called under the lock.

  void retire(std::uint32_t slot) {
    slots_.retire(slot);
    first_cameras_.forget(slot);
    if (!blocks_.pinned(slot)) reclaim(slot);
  }
  bool alive(keyframe_handle handle) const { return slots_.alive(handle.slot, handle.generation); }
  void require_alive(keyframe_handle handle, const char* argument) const {
    if (!alive(handle)) throw stale(handle, argument);
  }
  /// Names the argument, slot and generation.
  static stale_handle stale(keyframe_handle handle, const char* argument) {
    std::string text = "turbomap: ";
    text.append(argument).append(" = {slot ").append(printed(handle.slot)).append(", generation ");
    text.append(printed(handle.generation)).append("}: no such keyframe: it was erased, or is of another store");
    return stale_handle(text);
  }

  struct unpinning {
    keyframe_store& store;
    void operator()(std::uint32_t slot) const noexcept { store.unpin(slot); }
  };

  /// Calls `attempt`; while that finds no room, waits for the oldest work that still holds keyframes, and tries again.
  template <class Attempt>
  void waiting_for_room(Attempt attempt) {
    for (;;) {
      try {
        return attempt();
      } catch (const out_of_memory&) {
        if (!pins_.any_given_up()) throw;
      }
      pins_.finish_oldest(unpinning{*this});
    }
  }
  /// Releases the pins whose work is done.
  [[gnu::noinline]] void poll() noexcept { pins_.finish_passed(unpinning{*this}); }
  [[gnu::noinline]] void unpin(std::uint32_t slot) noexcept {
    blocks_.unpin(slot);
    if (!blocks_.pinned(slot) && !slots_.alive(slot)) reclaim(slot);
  }
  [[gnu::noinline]] void reclaim(std::uint32_t slot) noexcept {
    blocks_.remove(slot);
    slots_.recycle(slot);
  }

  keyframe_store_options options_;
  memory_home<Memory> home_;
  mutable std::mutex mutex_;
  slot_table slots_;
  block_cache<Memory> blocks_;
  plain_vector<keyframe_layout> layouts_;  // by slot
  first_cameras first_cameras_;
  pin_records<Descriptor, Camera, Memory> pins_;
  insertion_lanes<Descriptor, Camera, Memory> lanes_;
  std::uint64_t uploads_ = 0;
};

// Out of the class, so that a file that finds them precompiled does not compile them.

template <class Descriptor, class Camera, class Memory>
keyframe_handle keyframe_store<Descriptor, Camera, Memory>::insert_through(
    insertion_lane<Descriptor, Camera, Memory>& lane, const data_type& data) {
  const keyframe_layout layout = plan_packing(data, options_.packing, lane.scratch);
  lane.transfer.reserve(layout.bytes);
  reservation place(*this, layout);
  std::byte* host = lane.transfer.packing_area(place.block());
  pack_keyframe(data, layout, lane.scratch, host);
  lane.transfer.upload(place.block(), host, layout.bytes);
  lane.transfer.wait();
  return place.publish(data.cameras[0].T_camera_body);
}

template <class Descriptor, class Camera, class Memory>
auto keyframe_store<Descriptor, Camera, Memory>::pin_behind(work_order<Memory> order,
                                                            span<const keyframe_handle> handles) -> pinned_type {
  const visit here(home_);
  const std::lock_guard<std::mutex> lock(mutex_);
  poll();
  for (std::size_t i = 0; i < handles.size(); ++i)
    if (!alive(handles[i])) require_alive(handles[i], std::string("handles[").append(printed(i)).append("]").c_str());
  record_type* const record = pins_.idle(handles.size());
  for (std::size_t i = 0; i < handles.size(); ++i) record->slots[i] = handles[i].slot;
  waiting_for_room([&] { blocks_.pin(record->slots); });
  for (std::size_t i = 0; i < handles.size(); ++i) {
    const std::uint32_t slot = handles[i].slot;
    record->views[i] = view_at<Descriptor, Camera>(layouts_[slot], blocks_.data(slot));
  }
  pins_.hold(record);
  return pinned_type(this, record, order);
}

#define TURBOMAP_INSTANTIATE(Descriptor, Camera)                                                     \
  TURBOMAP_INSTANCE keyframe_handle keyframe_store<Descriptor, Camera, host_memory>::insert_through( \
      insertion_lane<Descriptor, Camera, host_memory>&, const keyframe_data<Descriptor, Camera>&);   \
  TURBOMAP_INSTANCE pinned_keyframes<Descriptor, Camera, host_memory>                                \
      keyframe_store<Descriptor, Camera, host_memory>::pin_behind(work_order<host_memory>,           \
                                                                  span<const keyframe_handle>);
TURBOMAP_PRECOMPILED_STORES(TURBOMAP_INSTANTIATE)
#undef TURBOMAP_INSTANTIATE

TURBOMAP_END_NAMESPACE
