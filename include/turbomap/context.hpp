// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The first argument of every algorithm: an execution policy with the memory that its calls reuse.

#include <cstddef>
#include <memory_resource>
#include <type_traits>
#include <utility>

#include "array.hpp"
#include "memory.hpp"
#include "packed_inputs.hpp"
#include "parallel.hpp"
#include "plain_vector.hpp"
#include "sequential_policy.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The blocks of a scratch_arena: everything that needs no type.
class scratch_blocks {
 public:
  /// Takes no memory yet.
  explicit scratch_blocks(std::pmr::memory_resource* resource) : resource_(resource) {}
  /// Takes the blocks over.
  scratch_blocks(scratch_blocks&& other) noexcept : resource_(other.resource_) { exchange(other); }
  /// Exchanges blocks and resources.
  scratch_blocks& operator=(scratch_blocks&& other) noexcept {
    std::pmr::memory_resource* const resource = resource_;
    resource_ = other.resource_;
    other.resource_ = resource;
    exchange(other);
    return *this;
  }
  ~scratch_blocks() { release(); }

  /// Whether reset() will exchange the blocks for a single one.
  bool fragmented() const { return blocks_.size() > 1; }

  /// Takes everything back. The caller knows that nothing enqueued still uses the memory of this arena, or that it is used
  /// in the same stream order.
  void reset() {
    if (blocks_.size() > 1) {
      std::size_t total = 0;
      for (const block& b : blocks_) total += b.bytes;
      release();
      add_block(total);
    }
    used_ = 0;
  }

 protected:
  /// So many bytes, aligned for every type.
  [[gnu::noinline]] std::byte* take_bytes(std::size_t n) {
    const std::size_t bytes = align_up(n);
    if (blocks_.empty() || used_ + bytes > blocks_.back().bytes) add_block(bytes);
    std::byte* const piece = blocks_.back().data + used_;
    used_ += bytes;
    return piece;
  }

 private:
  static constexpr std::size_t smallest_block = std::size_t{1} << 16;
  struct block {
    std::byte* data;
    std::size_t bytes;
  };

  [[gnu::noinline]] void add_block(std::size_t bytes) {
    blocks_.reserve(blocks_.size() + 1);
    if (bytes < smallest_block) bytes = smallest_block;
    blocks_.push_back({static_cast<std::byte*>(resource_->allocate(bytes, block_alignment)), bytes});
    used_ = 0;
  }
  [[gnu::noinline]] void release() noexcept {
    for (const block& b : blocks_) resource_->deallocate(b.data, b.bytes, block_alignment);
    blocks_.clear();
    used_ = 0;
  }
  /// All but the resources.
  void exchange(scratch_blocks& other) noexcept {
    blocks_.swap(other.blocks_);
    const std::size_t used = used_;
    used_ = other.used_;
    other.used_ = used;
  }

  std::pmr::memory_resource* resource_;
  plain_vector<block> blocks_;
  std::size_t used_ = 0;
};

/// Bump allocator: memory is taken piece after piece and given back all at once. After the first calls it owns one block
/// that is large enough, and allocates no more.
template <class Memory>
class scratch_arena : public scratch_blocks {
 public:
  using scratch_blocks::scratch_blocks;

  /// `n` elements of unspecified value, valid until the next reset().
  template <class T>
  T* take(std::size_t n) {
    static_assert(__is_trivially_copyable(T));
    return reinterpret_cast<T*>(take_bytes(n * sizeof(T)));
  }
};

namespace detail {
/// What a context keeps of its policy: the policy itself, but for thrust::seq, whose type may be incomplete here.
template <class Policy>
struct kept_policy {
  using type = Policy;
};
/// Of thrust::seq.
template <>
struct kept_policy<thrust::detail::seq_t> {
  using type = sequential_policy;
};
}  // namespace detail

/// An execution policy, its stream and reusable memory. `context ctx;` (sequential on the host, without the headers of
/// Thrust's other policies, which take longer to compile than a search), `context ctx{thrust::host};`, `{thrust::omp::par}`,
/// `{thrust::device}`, `{thrust::cuda::par_nosync.on(stream)}`. Not shared between threads; any number may live side by
/// side, also on one GPU. In the steady state no call allocates. Move-only.
template <class Policy = thrust::detail::seq_t>
class context {
 public:
  using policy_type = Policy;                                    ///< of Thrust
  using kept_type = typename detail::kept_policy<Policy>::type;  ///< the same, or a sequential_policy for thrust::seq
  using memory_type = memory_of_t<Policy>;                       ///< where it computes

  /// \param policy    any Thrust execution policy
  /// \param resource  where scratch and results of this context live; the policy's own memory when not given
  /// \param staging   host memory that calls are packed in before they are sent (pinned for CUDA when not given)
  explicit context(kept_type policy = kept_type(),
                   std::pmr::memory_resource* resource = default_resource(memory_type{}),
                   std::pmr::memory_resource* staging = default_staging_resource(memory_type{}))
      : policy_(std::move(policy)),
        resource_(resource),
        staging_resource_(staging),
        scratch_(resource),
        staging_(staging) {}
  /// What was moved from may only be destroyed.
  context(context&& other) noexcept
      : policy_(other.policy_),
        resource_(std::exchange(other.resource_, nullptr)),  // what was moved from has nothing to wait for
        staging_resource_(other.staging_resource_),
        scratch_(std::move(other.scratch_)),
        staging_(std::move(other.staging_)),
        upload_in_flight_(other.upload_in_flight_) {}
  /// Work that is still enqueued may use this memory: waits for it.
  ~context() {
    if (resource_ != nullptr) settle();
  }

  /// As it was given; for thrust::seq one that does the same.
  const kept_type& policy() const { return policy_; }
  /// Where scratch and results live.
  std::pmr::memory_resource* resource() const { return resource_; }
  /// Of host memory that copies to and from the policy's memory run from at full rate.
  std::pmr::memory_resource* staging_resource() const { return staging_resource_; }

  /// Starts a call: the scratch of the previous one is taken back. Later work of the same stream may overwrite it, because
  /// it runs after that call's.
  void begin_call() {
    if (scratch_.fragmented()) synchronize();  // its blocks are about to be freed
    scratch_.reset();
  }

  /// `n` elements in the policy's memory, valid for work enqueued before the next begin_call().
  template <class T>
  T* scratch(std::size_t n) {
    return scratch_.template take<T>(n);
  }

  /// The same memory, for launchers that take what they need themselves.
  scratch_arena<memory_type>& scratch() { return scratch_; }

  /// `n` elements of a result for the host to read after synchronize(): where they are if the host can read them there, else
  /// copied into `buffer`.
  template <class T, class List>
  const T* on_host(const T* resident, std::size_t n, List& buffer) {
    if constexpr (is_host_accessible_v<memory_type>) return resident;
    buffer.resize(n);
    copy_out(policy_, buffer.data(), resident, n * sizeof(T));
    return buffer.data();
  }
  /// The same with a buffer of staging_resource().
  template <class T>
  const T* on_host(const T* resident, std::size_t n, array<T, host_memory>& buffer) {
    if constexpr (is_host_accessible_v<memory_type>) return resident;
    buffer.resize_discard(n);
    copy_out(policy_, buffer.data(), resident, n * sizeof(T));
    return buffer.data();
  }

  /// The block that a call packs its inputs into (packed_inputs.hpp); `target` holds them in the policy's memory. Waits only
  /// if the previous call of this context is still running.
  upload_block begin_upload(array<std::byte, memory_type>& target, std::size_t bytes) {
    if (upload_in_flight_) synchronize();
    target.resize_discard(bytes);
    if constexpr (is_host_accessible_v<memory_type>) return {target.data(), target.data()};
    staging_.resize_discard(bytes);
    return {staging_.data(), target.data()};
  }
  /// Sends it: one copy (none under a host policy).
  void send(const upload_block& block, std::size_t bytes) {
    copy_in(policy_, block.resident, block.host, bytes);
    upload_in_flight_ = !is_host_accessible_v<memory_type>;
  }

  /// Waits until all work of this context is done.
  void synchronize() {
    turbomap::synchronize(policy_);
    upload_in_flight_ = false;
  }
  /// The same in a destructor, or after an exception, so that nothing under way is still read or written. What fails is
  /// reported by the next call of the stream.
  void settle() noexcept {
    try {
      turbomap::synchronize(policy_);
    } catch (...) {
    }
  }

 private:
  kept_type policy_;
  std::pmr::memory_resource* resource_;
  std::pmr::memory_resource* staging_resource_;
  scratch_arena<memory_type> scratch_;
  array<std::byte, host_memory> staging_;
  bool upload_in_flight_ = false;
};

/// `context ctx{policy};`
template <class Policy>
context(Policy) -> context<Policy>;
/// With resources.
template <class Policy>
context(Policy, std::pmr::memory_resource*, std::pmr::memory_resource* = nullptr) -> context<Policy>;

template <class T>
struct is_context : std::false_type {};
template <class Policy>
struct is_context<context<Policy>> : std::true_type {};

TURBOMAP_END_NAMESPACE
