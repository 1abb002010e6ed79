// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The context and what it is made of: arrays, scratch, uploads, parallel loops, spans, errors.

#include <turbomap/context.hpp>
#include <turbomap/error.hpp>
#include <turbomap/index_iterator.hpp>

#include <thrust/execution_policy.h>
#include <thrust/for_each.h>

#include <atomic>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "context_cases.hpp"
#include "scenes/keyframe_samples.hpp"
#include "support/policies.hpp"

namespace {

using turbomap_test::counting_resource;
using turbomap_test::sequential;

TEST_CASE_TEMPLATE("loops, copies, uploads and scratch", Policy, TURBOMAP_TEST_POLICIES) {
  turbomap_test::check_parallel(Policy{});
  turbomap_test::check_scratch(Policy{});
  turbomap_test::check_upload(Policy{});
  turbomap_test::check_packed_inputs(Policy{});
}

TEST_CASE("a context without a policy is sequential, on the host") {
  turbomap::context ctx;
  static_assert(std::is_same_v<decltype(ctx), turbomap::context<thrust::detail::seq_t>>);
  static_assert(std::is_same_v<decltype(ctx)::memory_type, turbomap::host_memory>);
  int next = 0;
  turbomap::for_each_index(ctx.policy(), 5, [&next](int i) { next = i == next ? next + 1 : -9; });
  CHECK(next == 5);
}

TEST_CASE("thrust::seq with resources, and Thrust's own algorithms under the policy that its context keeps") {
  counting_resource resource(std::pmr::new_delete_resource());
  turbomap::context ctx{thrust::seq, &resource, &resource};
  static_assert(std::is_same_v<decltype(ctx), turbomap::context<sequential>>);
  CHECK(ctx.resource() == &resource);
  CHECK(ctx.staging_resource() == &resource);
  const turbomap::plain_detail::index_iterator begin(0);
  int next = 0;
  thrust::for_each(ctx.policy(), begin, begin + 5, [&next](int i) { next = i == next ? next + 1 : -9; });
  CHECK(next == 5);
  auto last = begin + 5;
  CHECK(*--last == 4);
  CHECK(begin[3] == 3);
  CHECK((begin + 3) - begin == 3);
}

TEST_CASE("thrust::host and thrust::device are policies too") {
  turbomap::context host{thrust::host};
  turbomap::context device{thrust::device};
  static_assert(std::is_same_v<decltype(host)::memory_type, turbomap::host_memory>);
  static_assert(std::is_same_v<decltype(device)::memory_type, turbomap::host_memory>);  // of this THRUST_DEVICE_SYSTEM
  int sum = 0;
  turbomap::for_each_index(host.policy(), 5, [&sum](int i) { sum += i; });
  CHECK(sum == 10);
}

TEST_CASE("an array grows, keeps its capacity, and is as it was when memory runs out") {
  counting_resource resource(std::pmr::new_delete_resource());
  {
    turbomap::array<double, turbomap::host_memory> a(&resource);
    CHECK(a.size() == 0);
    CHECK(resource.allocations == 0);
    a.resize_discard(100);
    const double* const data = a.data();
    CHECK(reinterpret_cast<std::uintptr_t>(data) % turbomap::block_alignment == 0);
    a.resize_discard(0);
    a.resize_discard(a.capacity());
    CHECK(a.data() == data);
    CHECK(resource.allocations == 1);
    a.data()[0] = 42;
    resource.refuse_from = resource.allocations, resource.refusals = 1;
    const std::size_t size = a.size();
    CHECK_THROWS_AS(a.resize_discard(100000), std::bad_alloc);
    CHECK(a.size() == size);
    CHECK(a.data() == data);
    CHECK(a.data()[0] == 42);
    turbomap::array<double, turbomap::host_memory> b(std::move(a));
    CHECK(b.data() == data);
    CHECK(a.data() == nullptr);
    CHECK(a.size() == 0);
    turbomap::array<double, turbomap::host_memory> c(&resource);
    c.resize_discard(1);
    c = std::move(b);
    CHECK(c.data() == data);
    CHECK(c.data()[0] == 42);
    a = std::move(c);
    a.resize_discard(7);
  }
  CHECK(resource.bytes_out == 0);
  CHECK(resource.mismatched == 0);
}

TEST_CASE("scratch settles in one block") {
  counting_resource resource(std::pmr::new_delete_resource());
  {
    turbomap::context<sequential> ctx(sequential{}, &resource, &resource);
    long settled = 0;
    for (int call = 0; call < 6; ++call) {
      ctx.begin_call();
      std::vector<std::pair<char*, std::size_t>> pieces;
      for (const std::size_t n : {10u, 100000u, 0u, 300000u, 1u}) {
        char* piece = ctx.scratch<char>(n);
        std::memset(piece, call, n);
        pieces.push_back({piece, n});
        CHECK(reinterpret_cast<std::uintptr_t>(piece) % turbomap::block_alignment == 0);
      }
      for (std::size_t i = 0; i < pieces.size(); ++i)
        for (std::size_t j = 0; j < i; ++j)
          CHECK((pieces[i].first + pieces[i].second <= pieces[j].first ||
                 pieces[j].first + pieces[j].second <= pieces[i].first));
      if (call == 2) settled = resource.allocations;
    }
    CHECK(settled > 0);
    CHECK(resource.allocations == settled);
  }
  CHECK(resource.bytes_out == 0);
}

TEST_CASE("scratch survives a refused allocation") {
  counting_resource resource(std::pmr::new_delete_resource());
  {
    turbomap::context<sequential> ctx(sequential{}, &resource, &resource);
    ctx.begin_call();
    ctx.scratch<char>(1000);
    resource.refuse_from = resource.allocations, resource.refusals = 2;
    CHECK_THROWS_AS(ctx.scratch<char>(1 << 20), std::bad_alloc);
    std::memset(ctx.scratch<char>(1000), 1, 1000);
    CHECK_THROWS_AS(ctx.scratch<char>(1 << 20), std::bad_alloc);
    std::memset(ctx.scratch<char>(1 << 20), 2, 1 << 20);
    // Refused while the blocks are being exchanged for one.
    resource.refuse_from = resource.allocations, resource.refusals = 1;
    CHECK_THROWS_AS(ctx.begin_call(), std::bad_alloc);
    ctx.begin_call();
    std::memset(ctx.scratch<char>(1 << 20), 3, 1 << 20);
  }
  CHECK(resource.bytes_out == 0);
  CHECK(resource.mismatched == 0);
}

TEST_CASE("a context moves") {
  turbomap::context<sequential> a{};
  a.begin_call();
  a.scratch<int>(10);
  turbomap::context<sequential> b(std::move(a));
  b.begin_call();
  std::memset(b.scratch<int>(10), 0, 40);
  static_assert(!std::is_copy_constructible_v<turbomap::context<sequential>>);
}

TEST_CASE("spans") {
  std::vector<int> v{1, 2, 3, 4};
  const turbomap::span<int> s(v);
  const turbomap::span<const int> c(v), sub = c.subspan(1, 2);
  CHECK((s.size() == 4 && !s.empty() && s[3] == 4));
  s[0] = 7;
  CHECK(c[0] == 7);
  CHECK((sub.size() == 2 && sub[0] == 2 && sub.end() - sub.begin() == 2));
  CHECK(turbomap::span<int>().empty());
  const std::vector<int>& constant = v;
  CHECK(turbomap::span<const int>(constant).data() == v.data());
  static_assert(!std::is_constructible_v<turbomap::span<int>, const std::vector<int>&>);
}

TEST_CASE("errors say what, how much and why") {
  CHECK_NOTHROW(turbomap::require(true, "a", 1, "rule"));
  CHECK_THROWS_WITH_AS(turbomap::require(false, "neighbours", -3, "must not be negative"),
                       "turbomap: neighbours = -3: must not be negative", std::invalid_argument);
  CHECK_THROWS_WITH_AS(turbomap::reject("x", 0.125, "is odd"), "turbomap: x = 0.125: is odd", std::invalid_argument);
  const turbomap::out_of_memory none("device", 4096);
  CHECK(std::string(none.what()) == "turbomap: out of device memory: 4096 bytes were asked for");
  CHECK_THROWS_AS(throw none, std::bad_alloc);
  CHECK_THROWS_AS(throw turbomap::stale_handle("h"), std::invalid_argument);
  CHECK_THROWS_AS(throw turbomap::bad_file("f"), std::runtime_error);
}

}  // namespace
