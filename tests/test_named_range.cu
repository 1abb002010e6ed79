// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// With TURBOMAP_WITH_NVTX the library opens and closes ranges in the domain "turbomap"; this test is the profiler that hears them.

#define TURBOMAP_WITH_NVTX 1

#include <turbomap/named_range.hpp>

#include <cstdint>
#include <string>
#include <vector>

#include <doctest/doctest.h>

namespace {

struct heard {
  std::vector<std::string> domains, begun;
  int ended = 0;
} events;

nvtxDomainHandle_t create_domain(const char* name) {
  events.domains.push_back(name);
  return reinterpret_cast<nvtxDomainHandle_t>(std::uintptr_t{1});
}
int begin_range(nvtxDomainHandle_t, const nvtxEventAttributes_t* event) {
  events.begun.push_back(event->message.ascii);
  return static_cast<int>(events.begun.size());
}
int end_range(nvtxDomainHandle_t) { return ++events.ended; }

template <class Function>
void hear(NvtxFunctionTable table, int event, Function function) {
  *table[event] = reinterpret_cast<NvtxFunctionPointer>(function);
}
int listen(NvtxGetExportTableFunc_t tables) {
  const auto* callbacks = static_cast<const NvtxExportTableCallbacks*>(tables(NVTX_ETID_CALLBACKS));
  NvtxFunctionTable table = nullptr;
  unsigned size = 0;
  if (callbacks == nullptr || callbacks->GetModuleFunctionTable(NVTX_CB_MODULE_CORE2, &table, &size) == 0) return 0;
  hear(table, NVTX_CBID_CORE2_DomainCreateA, create_domain);
  hear(table, NVTX_CBID_CORE2_DomainRangePushEx, begin_range);
  hear(table, NVTX_CBID_CORE2_DomainRangePop, end_range);
  return 1;
}

/// Where NVTX looks for a tool that is linked in, at its first event.
const bool listening = (InitializeInjectionNvtx2_fnptr = listen) != nullptr;

TEST_CASE("ranges nest, and have names and a domain") {
  REQUIRE(listening);
  {
    const turbomap::named_range outer("outer");
    const turbomap::named_range inner("inner");
    CHECK(events.ended == 0);
  }
  CHECK(events.domains == std::vector<std::string>{"turbomap"});
  CHECK(events.begun == std::vector<std::string>{"outer", "inner"});
  CHECK(events.ended == 2);
}

}  // namespace
