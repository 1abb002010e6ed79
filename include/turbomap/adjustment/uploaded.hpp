// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Arrays that the host and the policy both look at. Under a host policy they are one array, else a copy is made; which of
/// the two is decided by overloads and specialisations on the memory that the policy computes in.

#include <cstddef>
#include <tuple>

#include "../array.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../packed_inputs.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// What the policy reads of an array of the host.
template <class T, class Memory>
class resident_copy {
 public:
  /// Nothing was sent. \param resource  memory of the policy; must outlive this
  explicit resident_copy(std::pmr::memory_resource* resource = default_resource(Memory{})) : copy_(resource) {}

  /// Makes `n` elements readable to the policy. Enqueued under CUDA; what is at `from` must stay until it has passed.
  template <class Policy>
  void send(const Policy& policy, const T* from, std::size_t n) {
    copy_in(policy, make(n), from, n * sizeof(T));
  }
  /// The same for a list.
  template <class Policy>
  void send(const Policy& policy, const plain_vector<T>& from) {
    send(policy, from.data(), from.size());
  }
  /// Room for `n` elements that the policy writes itself.
  T* make(std::size_t n) {
    copy_.resize_discard(n);
    data_ = copy_.data();
    return copy_.data();
  }
  /// Elements that are where the policy computes already, and stay there as long as they are read.
  void adopt(const T* there) { data_ = there; }

  /// Where the policy computes.
  const T* data() const { return data_; }

 private:
  array<T, Memory> copy_;
  const T* data_ = nullptr;
};

/// Host memory: read in place, so what was sent must stay as long as it is read.
template <class T>
class resident_copy<T, host_memory> {
 public:
  /// Nothing was sent; needs no memory.
  explicit resident_copy(std::pmr::memory_resource* = nullptr) {}

  /// Makes elements readable to the policy: they stay where they are.
  template <class Policy>
  void send(const Policy&, const T* from, std::size_t) {
    data_ = from;
  }
  /// The same for a list.
  template <class Policy>
  void send(const Policy&, const plain_vector<T>& from) {
    data_ = from.data();
  }
  /// Where the policy reads.
  const T* data() const { return data_; }

 private:
  const T* data_ = nullptr;
};

/// Enqueues a copy of `n` elements that the policy made.
template <class Policy, class T, class Memory>
void fetch_list(const Policy& policy, const resident_copy<T, Memory>& from, std::size_t n, plain_vector<T>& to) {
  to.resize(n);
  copy_out(policy, to.data(), from.data(), n * sizeof(T));
}

/// A host vector, and what the policy reads of it.
template <class T, class Memory>
class uploaded {
 public:
  /// Empty. \param resource  memory of the policy; must outlive this
  explicit uploaded(std::pmr::memory_resource* resource) : resident_(resource) {}

  /// What the host writes.
  plain_vector<T>& host() { return host_; }
  /// What the host wrote.
  const plain_vector<T>& host() const { return host_; }

  /// Makes what the host wrote readable to the policy.
  template <class Policy>
  void send(const Policy& policy) {
    resident_.send(policy, host_);
  }
  /// See resident_copy.
  void adopt(const T* there) { resident_.adopt(there); }
  /// Where the policy reads.
  const T* data() const { return resident_.data(); }

 private:
  plain_vector<T> host_;
  resident_copy<T, Memory> resident_;
};

/// `n` elements of the policy's memory for the host to read and write: in place, or copied into `buffer`. Waits.
template <class T, class Policy, class List>
T* on_host(context<Policy>& ctx, T* data, std::size_t n, List& buffer) {
  T* host = const_cast<T*>(ctx.on_host(data, n, buffer));  // data itself, or in the buffer
  ctx.synchronize();
  return host;
}

/// What with_resident() sends as one block, at most: more than that takes longer to pack than its copies take to start.
inline constexpr std::size_t most_packed_bytes = std::size_t{1} << 18;

/// Calls use(pointers) with the elements of views of the caller's for the policy to read: in place, or in one block that is
/// sent in one copy where it is small. Empty: null. \param buffer  keeps the block; use it again
template <class Policy, class Use, class... T>
void with_resident(context<Policy>& ctx, array<std::byte, memory_of_t<Policy>>& buffer, Use use,
                   span<const T>... views) {
  if constexpr (is_host_accessible_v<memory_of_t<Policy>>) {
    use((views.empty() ? nullptr : views.data())...);
  } else {
    packed_inputs inputs;
    const std::tuple<input_slot<T>...> slots{inputs.place<T>(views.size())...};  // in their order: braces
    const bool packed = inputs.bytes() <= most_packed_bytes;
    if (!packed) buffer.resize_discard(inputs.bytes());
    const upload_block block = packed ? ctx.begin_upload(buffer, inputs.bytes()) : upload_block{nullptr, buffer.data()};
    std::apply(
        [&](const auto&... slot) {
          if (packed) {
            (slot.copy(block, views.data()), ...);
            ctx.send(block, inputs.bytes());
          } else {
            (copy_in(ctx.policy(), block.resident + slot.at, views.data(), views.size() * sizeof(T)), ...);
          }
          use((slot.size == 0 ? nullptr : slot.resident(block))...);
        },
        slots);
  }
}

TURBOMAP_END_NAMESPACE
